// SPDX-License-Identifier: GPL-3.0-or-later
// Bodies out of soups, compared with closed forms and with winding numbers summed up by brute force.
#include "padding/meshing/mend.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <set>
#include <source_location>

#include "padding/by_tolerance/cull.h"
#include "padding/geometry/random.h"
#include "padding/geometry/triangle.h"
#include "padding/verify/certify.h"
#include "tests/error_of.h"
#include "tests/padding/random_input.h"
#include "tests/padding/threads.h"

namespace padder {
namespace {

using shapes::RandomInput, shapes::in_box, shapes::joined, shapes::mapped, shapes::moved,
    shapes::polygon_area, shapes::roughened, shapes::scaled, shapes::turned_over, shapes::volume,
    shapes::winding, shapes::with_corners_off, shapes::without;

const Mesh kCube = shapes::box({0, 0, 0}, {1, 1, 1}, 2);
const Mesh kOpenCube = without(kCube, [](const Point& p) { return p.z() == 1; });

// n^3 unit cubes side by side, without some.
Mesh cells(int n, int parts, const std::set<int>& gone = {}) {
  Mesh mesh;
  for (int k = 0; k < n * n * n; k++) {
    const Point low(k % n, k / n % n, k / n / n);
    if (!gone.contains(k)) mesh.add(shapes::box(low, low + Vector(1, 1, 1), parts));
  }
  return mesh;
}

Repaired mended(const Mesh& mesh, RepairMode mode = RepairMode::automatic) {
  return mend(mesh, {.mode = mode}).value();
}

double volume(const Repaired& r) { return shapes::volume(r.boundary()); }

// The mesh mends to a solid of this volume.
Repaired expect_solid(const Mesh& mesh, double expected, double within,
                      RepairMode mode = RepairMode::automatic,
                      const std::source_location& at = std::source_location::current()) {
  const testing::ScopedTrace trace(at.file_name(), static_cast<int>(at.line()), "");
  Repaired r = mended(mesh, mode);
  EXPECT_EQ(r.kind, BodyKind::solid) << r.report;
  EXPECT_NEAR(volume(r), expected, within);
  return r;
}

using Inside = std::function<bool(const Point&)>;

// The body is where `inside` says, and the surface has all of its boundary: no ball around a point that
// reaches to the surface holds points of the other side.
void expect_body(const Repaired& r, const Inside& inside, std::uint64_t seed, int points = 300) {
  RandomInput random(seed);
  const Surface surface = r.surface();
  ASSERT_TRUE(surface.closed());
  Vector flux = Vector::Zero();
  const Mesh boundary = r.boundary();
  for (std::size_t t = 0; t < boundary.triangles.size(); t++) flux += boundary.area_normal(t);
  EXPECT_LT(flux.norm(), 1e-9);
  const Box box = surface.bounds();
  for (int k = 0; k < points; k++) {
    const Point p = random.in(box);
    const Nearest at = surface.signed_nearest(p);
    EXPECT_EQ(at.distance < 0, inside(p));
    for (int j = 0; j < 20; j++) {
      const Point q = p + random.direction() * std::abs(at.distance) * random.uniform(0, 0.999999);
      EXPECT_EQ(inside(q), inside(p)) << p.transpose() << " and " << q.transpose();
    }
  }
}

double sampled_volume(const Box& box, const Inside& inside, std::uint64_t seed, int points) {
  RandomInput random(seed);
  int hits = 0;
  for (int k = 0; k < points; k++) hits += inside(random.in(box));
  return (box.high - box.low).prod() * hits / points;
}

TEST(Mend, CubesThatShareAFaceAnEdgeOrACornerAreOneBody) {
  RandomInput random(11);
  for (const Vector& step : {Vector(1, 0, 0), Vector(1, 1, 0), Vector(1, 1, 1), Vector(1, 0.25, 0.3)}) {
    // Turned walls would lie apart by rounding.
    const bool wall = step.x() == 1 && step.y() < 1;
    const Eigen::Matrix3d turn = wall ? Eigen::Matrix3d::Identity() : random.rotation();
    const Mesh both = moved(joined(kCube, moved(kCube, step)), turn, {3, 1, 2});
    const Repaired r = expect_solid(both, 2, 1e-9);
    EXPECT_EQ(r.sheet, 0u);
    const Inside inside = [&](const Point& p) {
      const Point q = turn.transpose() * (p - Point(3, 1, 2));
      return in_box(q, {0, 0, 0}, {1, 1, 1}) || in_box(q, step, step + Vector(1, 1, 1));
    };
    if (!wall) expect_body(r, inside, 1);
    // A wall that both cubes have is buried, as far as they share it.
    EXPECT_NEAR(2 * r.steps.buried_area + r.mesh.area(), 12, 1e-9);
    EXPECT_NEAR(r.steps.buried_area, wall ? (1 - step.y()) * (1 - step.z()) : 0, 1e-9);
  }
}

TEST(Mend, ACubeInACubeIsACavityWhicheverWayItFaces) {
  const Mesh inner = shapes::box({0.25, 0.25, 0.25}, {0.75, 0.75, 0.75}, 2);
  for (const Mesh& shell : {inner, turned_over(inner)})
    for (const Mesh& outer : {kCube, turned_over(kCube)}) {
      EXPECT_NEAR(volume(mended(joined(outer, shell))), 1 - 0.125, 1e-12);
      EXPECT_NEAR(volume(mended(joined(outer, shell), RepairMode::united)), 1, 1e-12);
    }
}

// Pieces that repeat wind twice, and sheets that cross a shell do not touch it.
TEST(Mend, ACavityInARepeatedBodyOrWithAScrapThroughItsWall) {
  const Mesh inner = turned_over(shapes::box({0.25, 0.25, 0.25}, {0.75, 0.75, 0.75}, 2));
  const Mesh hollow = joined(kCube, inner);
  // Of the two copies, only some triangles are equal, so that each piece has both.
  Mesh some = hollow;
  some.triangles.erase(some.triangles.begin(), some.triangles.begin() + 4);
  for (const Mesh& mesh : {joined(hollow, moved(hollow, {1e-6, 0, 0})), joined(hollow, some)})
    EXPECT_NEAR(volume(mended(mesh)), 1 - 0.125, 1e-4);
  const Mesh scrap{{{0.1, 0.4, 0.4}, {0.5, 0.4, 0.4}, {0.5, 0.5, 0.4}}, {{0, 1, 2}}};
  for (const Mesh& mesh : {hollow, turned_over(hollow), joined(kCube, turned_over(inner))})
    EXPECT_NEAR(volume(mended(joined(mesh, scrap))), 1 - 0.125, 1e-9);
}

// The walls of a bow tie cross each other: one lobe is turned inside out and bounds nothing.
TEST(Mend, ACavityThatCrossesItself) {
  Mesh tie;
  for (const double z : {0.3, 0.7})
    for (const Point& p :
         {Point(0.25, 0.4, z), Point(0.75, 0.7, z), Point(0.75, 0.4, z), Point(0.25, 0.6, z)})
      tie.points.push_back(p);
  tie.triangles = {{0, 2, 1}, {0, 3, 2}, {4, 5, 6}, {4, 6, 7}};
  for (std::uint32_t k = 0; k < 4; k++) {
    const std::uint32_t next = (k + 1) % 4;
    shapes::add_quad(tie, k, next, next + 4, k + 4);
  }
  const double larger_lobe = 0.5 * 0.3 * 0.3;
  for (const Mesh& shell : {tie, turned_over(tie)}) {
    const Repaired r = mended(joined(kCube, shell));
    EXPECT_EQ(r.steps.cavities, 1u);
    EXPECT_NEAR(volume(r), 1 - larger_lobe * 0.4, 1e-12);
    const double around = 0.3 + std::hypot(0.3, 0.18) + std::hypot(0.3, 0.12);
    EXPECT_NEAR(r.mesh.area(), 6 + 2 * larger_lobe + around * 0.4, 1e-12);
  }
}

TEST(Mend, ACubeInACavityIsSolidAndRepeatedPiecesCountOnce) {
  Mesh mesh = joined(kCube, shapes::box({0.1, 0.1, 0.1}, {0.9, 0.9, 0.9}));
  mesh = joined(mesh, shapes::box({0.3, 0.3, 0.3}, {0.7, 0.7, 0.7}));
  EXPECT_NEAR(volume(mended(mesh)), 1 - 0.512 + 0.064, 1e-12);
  EXPECT_NEAR(volume(mended(joined(mesh, turned_over(mesh)))), 1 - 0.512 + 0.064, 1e-12);
  // The same place with another triangulation.
  EXPECT_NEAR(volume(mended(joined(kCube, shapes::box({0, 0, 0}, {1, 1, 1}, 3)))), 1, 1e-12);
  EXPECT_NEAR(volume(mended(joined(kCube, turned_over(shapes::box({0, 0, 0}, {1, 1, 1}, 3))))), 1, 1e-12);
}

// Levels of detail in one file: each coarser ball lies within the finer one, with its corners on it or a
// little below it.
TEST(Mend, CoarserLevelsOfDetailWithinABodyAreNoCavities) {
  const auto level = [](int n, double scale) { return scaled(shapes::sphere(n), scale); };
  const Mesh fine = level(4, 1);
  for (const double inset : {1.0, 0.99, 0.97}) {
    const Repaired r = mended(joined(joined(fine, level(3, inset)), level(2, inset * inset)));
    EXPECT_EQ(r.steps.copies, 2u);
    EXPECT_NEAR(volume(r), volume(fine), 1e-9) << inset;
  }
  EXPECT_NEAR(volume(mended(joined(fine, level(2, 1)))), volume(fine), 1e-9);
  EXPECT_NEAR(volume(mended(joined(fine, level(2, 0.99)))), volume(fine), 1e-9);
  // A coarse hollow below a thick wall, a core in a hollow, and a level that faces inward are none.
  const double core = volume(level(2, 1));
  EXPECT_NEAR(volume(mended(joined(fine, level(2, 0.95)))), volume(fine) - 0.857375 * core, 1e-9);
  EXPECT_NEAR(volume(mended(joined(fine, level(2, 0.5)))), volume(fine) - 0.125 * core, 1e-9);
  const Mesh box = shapes::box({-0.57, -0.57, -0.57}, {0.57, 0.57, 0.57});  // its corners reach the ball
  EXPECT_NEAR(volume(mended(joined(fine, box))), volume(fine) - volume(box), 1e-9);
  EXPECT_NEAR(volume(mended(joined(fine, turned_over(level(2, 0.99))))), volume(fine) - 0.970299 * core,
              1e-9);
}

TEST(Mend, AThinWallWhoseInnerShellFacesOutwardIsHollow) {
  for (const Mesh& outer : {shapes::sphere(4), shapes::box({-1, -1, -1}, {1, 1, 1}, 3)})
    for (const double thickness : {0.01, 0.001}) {
      const Mesh inner = scaled(outer, 1 - thickness);
      const Repaired r = mended(joined(outer, inner));
      EXPECT_EQ(r.steps.copies, 0u);
      EXPECT_NEAR(volume(r), volume(outer) - volume(inner), 1e-9);
      // So it is in a mesh that repair leaves as it is.
      EXPECT_NEAR(volume(repair(joined(outer, inner), {}, "wall")), volume(outer) - volume(inner), 1e-9);
    }
  // Nearer, it is a copy.
  const Mesh copy = shapes::box(Point(5e-6, 5e-6, 5e-6), Point(1 - 5e-6, 1 - 5e-6, 1 - 5e-6), 2);
  const Repaired r = mended(joined(kCube, copy));
  EXPECT_EQ(r.steps.copies, 1u);
  EXPECT_NEAR(volume(r), 1, 1e-12);
}

TEST(Mend, APieceThatFacesInwardIsTurnedUnlessItIsACavity) {
  const Mesh post = shapes::box({0.4, 0.4, -0.5}, {0.6, 0.6, 1.5}),
             core = shapes::box({0.1, 0.1, 0.1}, {0.3, 0.3, 0.3});
  const Repaired r = mended(joined(joined(kCube, turned_over(post)), turned_over(core)));
  EXPECT_EQ(r.steps.turned_pieces, 1u);
  EXPECT_EQ(r.steps.cavities, 1u);
  EXPECT_NEAR(volume(r), 1 + 2 * 0.5 * 0.04 - 0.008, 1e-12);
  const Repaired all = repair(turned_over(joined(kCube, post)), {}, "inside out");
  EXPECT_TRUE(holds(all.report, "turned 2 closed pieces that faced inward"));
}

TEST(Mend, RandomBoxesBecomeTheirUnion) {
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    RandomInput random(seed);
    struct Placed {
      Eigen::Matrix3d turn;
      Vector half, at;
    };
    std::vector<Placed> boxes;
    Mesh mesh;
    const int count = seed == 1 ? 1000 : 30;
    for (int k = 0; k < count; k++) {
      // Every second one is not turned, so that there are faces in one plane.
      const double size = count > 100 ? 0.125 : 0.5;
      Placed b{k % 2 ? random.rotation() : Eigen::Matrix3d::Identity(), Vector(size, size, size) * 0.5,
               random.point(0.5)};
      if (k % 2 == 0) b.at = (b.at / size * 4).array().round().matrix() * size / 4;
      mesh.add(moved(shapes::box(-b.half, b.half), b.turn, b.at));
      boxes.push_back(b);
    }
    const Inside inside = [&](const Point& p) {
      return std::any_of(boxes.begin(), boxes.end(), [&](const Placed& b) {
        return ((b.turn.transpose() * (p - b.at)).cwiseAbs().array() < b.half.array()).all();
      });
    };
    const Repaired r = mended(mesh, RepairMode::united);
    expect_body(r, inside, seed);
    // Three standard deviations of the sample; compilers order the draws of a box differently.
    EXPECT_NEAR(volume(r) / sampled_volume(mesh.bounds(), inside, seed, 200000), 1, 0.01);
    // The boundary alone closes, up to rounding: it winds round the same points.
    for (int k = 0; k < 30; k++) {
      const Point p = random.point(0.6);
      EXPECT_NEAR(winding(r.boundary(), p), inside(p), 1e-3);
    }
  }
}

TEST(Mend, LinkedAndCrossingRings) {
  const Mesh ring = shapes::torus(1, 0.3, 36, 14);
  const double one = mass_properties(ring).volume;
  Eigen::Matrix3d upright;
  upright << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  EXPECT_NEAR(volume(mended(joined(ring, moved(ring, upright, {1, 0, 0})))), 2 * one, 1e-9);
  const Mesh crossing = joined(ring, moved(ring, upright, {0.1, 0, 0}));
  const Inside inside = [&](const Point& p) { return winding(crossing, p) > 0.5; };
  const Repaired r = mended(crossing);
  expect_body(r, inside, 4, 60);
  EXPECT_NEAR(volume(r) / sampled_volume(crossing.bounds(), inside, 4, 20000), 1, 0.05);
}

TEST(Mend, TrianglesTurnedAtRandomAreTurnedBack) {
  RandomInput random(5);
  for (const bool also_box : {false, true}) {
    Mesh mesh = shapes::blob(random);
    if (also_box) mesh = joined(mesh, shapes::box({0, 0, 0}, {1, 1, 1}));
    const double expected = volume(mended(mesh));
    EXPECT_GT(expected, 1);
    for (auto& t : mesh.triangles)
      if (random.uniform(0, 1) < 0.5) std::swap(t[1], t[2]);
    const Repaired r = mended(mesh);
    EXPECT_EQ(r.sheet, 0u);
    EXPECT_NEAR(volume(r), expected, 1e-12);
    EXPECT_GT(r.steps.turned, 0u);
  }
}

TEST(Mend, EverySecondTriangleMissing) {
  const Mesh whole = shapes::sphere(4);
  Mesh mesh = whole;
  mesh.triangles.clear();
  // The middle one of each four is missing: its neighbours only touch in points.
  for (std::size_t t = 0; t < whole.triangles.size(); t++)
    if (t % 4 != 3) mesh.triangles.push_back(whole.triangles[t]);
  const Repaired r = expect_solid(mesh, mass_properties(whole).volume, 1e-9);
  EXPECT_EQ(r.patches.size(), whole.triangles.size() / 4);
}

Mesh lathe(const std::vector<std::array<double, 2>>& profile, int n) {  // radius and height, from the axis up
  Mesh mesh;
  for (const auto& [radius, height] : profile)
    for (int k = 0; k < n; k++) mesh.points.push_back(shapes::on_circle(k, n, radius, height));
  for (std::uint32_t row = 0; row + 1 < profile.size(); row++)
    for (int k = 0; k < n; k++) {
      const auto at = [&](int r, int c) {
        return (row + std::uint32_t(r)) * std::uint32_t(n) + std::uint32_t(c % n);
      };
      shapes::add_quad(mesh, at(0, k), at(0, k + 1), at(1, k + 1), at(1, k));
    }
  return mesh;
}

Mesh bottle_of(int n) { return lathe({{0, 0}, {1, 0}, {1, 3}, {0.3, 3.6}, {0.3, 4.4}}, n); }

Mesh lower_half_of_a_ball() {
  std::vector<std::array<double, 2>> profile;
  for (int k = 0; k <= 12; k++)
    profile.push_back({std::sin(k * std::numbers::pi / 24), -std::cos(k * std::numbers::pi / 24)});
  return lathe(profile, 40);
}

TEST(Mend, ABottleIsASolidWithAHoleAndABowlIsASheet) {
  const Repaired bottle = mended(bottle_of(40));
  EXPECT_EQ(bottle.kind, BodyKind::solid);
  ASSERT_EQ(bottle.patches.size(), 1u);
  EXPECT_NEAR(bottle.patches[0].area, std::numbers::pi * 0.09, 0.01);
  EXPECT_NEAR(bottle.patches[0].rim, 2 * std::numbers::pi * 0.3, 0.01);
  EXPECT_LT((bottle.patches[0].place - Point(0, 0, 4.4)).norm(), 1e-9);
  EXPECT_GT(volume(bottle), 3 * std::numbers::pi * 0.98);

  const Mesh cup = lower_half_of_a_ball();
  const Repaired bowl = mended(cup);
  EXPECT_EQ(bowl.kind, BodyKind::sheet);
  EXPECT_EQ(bowl.patches.size(), 0u);
  EXPECT_LT(bowl.steps.sheet_winding, 0.8);
  EXPECT_NEAR(bowl.mesh.area(), cup.area(), 1e-9);
  // It is none the more a solid where it faces inward.
  const Repaired inward = mended(turned_over(cup));
  EXPECT_EQ(inward.kind, BodyKind::sheet);
  EXPECT_NEAR(inward.steps.sheet_winding, bowl.steps.sheet_winding, 1e-9);
  // As asked, it is filled, and a bottle is none.
  EXPECT_NEAR(volume(mended(cup, RepairMode::fill)), 2.0 / 3 * std::numbers::pi, 0.05);
  EXPECT_EQ(mended(bottle_of(40), RepairMode::sheet).kind, BodyKind::sheet);
}

// The inner shell faces inward, and takes nothing from the evidence that the outer one is a solid.
TEST(Mend, AHollowBallWithAHoleInItsOuterShellIsASolid) {
  const Mesh ball = shapes::sphere(3);
  const Mesh outer = without(ball, [](const Point& p) { return p.z() > 0.9; });
  const Mesh inner = scaled(turned_over(ball), 0.8);
  const Repaired r = expect_solid(joined(outer, inner), 4.0 / 3 * std::numbers::pi * (1 - 0.512), 0.1);
  EXPECT_EQ(r.patches.size(), 1u);
  EXPECT_EQ(r.steps.cavities, 1u);
  EXPECT_EQ(r.steps.turned_pieces, 0u);
}

TEST(Mend, AHelmetOfTwoOutwardWallsWithoutARimIsAShell) {
  const Mesh outer = lower_half_of_a_ball();
  const double filled = volume(mended(outer, RepairMode::fill));
  for (const double thickness : {0.05, 0.1, 0.2, 1e-4}) {
    const Mesh inner = scaled(outer, 1 - thickness);
    const Repaired r = mended(joined(outer, inner));
    if (thickness > 1e-3) {
      EXPECT_EQ(r.kind, BodyKind::solid);
      EXPECT_NEAR(volume(r), filled * (1 - std::pow(1 - thickness, 3)), 1e-9);
      continue;
    }
    EXPECT_LT(volume(r), 1e-3);  // nor do copies say of each other that they are solid
  }
}

TEST(Mend, HalvesOfABallThatLieApartAreSolid) {
  const Mesh lower = lower_half_of_a_ball();
  const Mesh upper = moved(lower, Eigen::Vector3d(1, -1, -1).asDiagonal(), {0, 0, 0.1});
  expect_solid(joined(upper, lower), 4.0 / 3 * std::numbers::pi, 0.05);
}

// What a closed piece covers is no opening: its own lid, or the ground that it stands on.
TEST(Mend, ABoxThatAClosedPieceCoversIsASolid) {
  const Mesh& open = kOpenCube;
  EXPECT_EQ(mended(open).kind, BodyKind::sheet);
  EXPECT_NEAR(volume(mended(joined(open, shapes::box({0, 0, 1}, {1, 1, 1.1}, 3)))), 1.1, 1e-9);
  EXPECT_NEAR(volume(mended(joined(open, shapes::box({-1, -1, 0.9}, {2, 2, 1.5}, 5)))), 0.9 + 5.4, 1e-9);
  // A wall inside is no solid, though the box covers its rim.
  RandomInput random(5);
  const Mesh wall = roughened(moved(shapes::square(0.8, 4), {0.1, 0.1, 0.5}), 1e-4, random);
  EXPECT_EQ(mended(joined(kCube, wall)).patches.size(), 0u);
  EXPECT_EQ(mended(joined(kCube, wall)).steps.sheet_pieces, 1u);
  // A lid that covers nine tenths of it closes it, and one that covers half closes nothing.
  EXPECT_NEAR(volume(mended(joined(open, shapes::box({0, 0, 1}, {0.9, 1, 1.1}, 3)))), 1.09, 1e-9);
  EXPECT_NEAR(volume(mended(joined(open, shapes::box({0, 0, 1}, {0.5, 1, 1.1}, 3)))), 0.05, 1e-9);
}

// Six strips that overlap around a ball.
Mesh strips_around_a_ball() {
  Mesh strips;
  for (int k = 0; k < 6; k++)
    strips.add(shapes::grid(12, 20, [&](int i, int j) -> Point {
      const double u = k * std::numbers::pi / 3 - 0.1 + i * (std::numbers::pi / 3 + 0.2) / 12;
      const double v = -1.55 + j * 3.1 / 20;
      return (1 + 0.003 * k) * Point(std::cos(v) * std::cos(u), std::cos(v) * std::sin(u), std::sin(v));
    }));
  return strips;
}

// Each strip by itself would be closed by a patch through the ball.
TEST(Mend, StripsOfAScanThatOverlapAreNoLenses) {
  const Mesh strips = strips_around_a_ball();
  const double tolerance = 0.02 * strips.bounds().diagonal();
  const RepairOptions options{.tolerance = tolerance, .accuracy = tolerance};
  std::string why;
  EXPECT_FALSE(mend(strips, options, &why));
  EXPECT_EQ(why, "its open pieces enclose a body together, but not one by one");
  const Repaired r = repair(strips, options, "strips");
  EXPECT_EQ(r.kind, BodyKind::wrap);
  EXPECT_NEAR(volume(r), 4.0 / 3 * std::numbers::pi, 0.3);
}

// A wrap would go in through the window and be a shell.
TEST(Mend, StripsAroundARoomWithAWindowAreNotWrapped) {
  Mesh strips = strips_around_a_ball();
  std::erase_if(strips.triangles, [&](const auto& t) {
    const Point& p = strips.points[t[0]];
    return p.x() > 0 && std::abs(p.y()) < 0.3 && std::abs(p.z()) < 0.3;
  });
  RepairOptions options;
  options.tolerance = options.accuracy = 0.02 * strips.bounds().diagonal();
  const Repaired r = repair(strips, options, "strips");
  EXPECT_EQ(r.kind, BodyKind::solid) << r.report;
  EXPECT_GT(volume(r), 0.5);
}

TEST(Mend, AnOpenSheetThatIsNearlyASolidNamesWhatClosesIt) {
  const auto report = [&](RepairMode mode) { return repair(kOpenCube, {.mode = mode}, "cube").report; };
  EXPECT_TRUE(holds(report(RepairMode::automatic), "use --repair fill"));
  EXPECT_EQ(report(RepairMode::sheet).find("--repair fill"), std::string::npos);
}

TEST(Mend, ASolidWithAnOpenSeamIsStillASolid) {
  Mesh bottle = bottle_of(24);
  for (std::size_t t = bottle.triangles.size(); t-- > 0;)
    if (t % 48 < 2) bottle.triangles.erase(bottle.triangles.begin() + std::ptrdiff_t(t));
  const Repaired r = mended(bottle);
  EXPECT_EQ(r.kind, BodyKind::solid) << r.steps.sheet_winding << " " << r.steps.sheet_rim;
  ASSERT_EQ(r.patches.size(), 1u);
  EXPECT_GT(r.patches[0].rim, 1.5 * bottle.bounds().diagonal());
  EXPECT_GT(volume(r), 8);
}

// The prism lies half in the box, and two of its edges lie in the box's face but for rounding: they cross its
// plane here and there. What lies on the two sides of such an edge is not decided together, and where it
// crosses the plane its place is not left to rounding.
TEST(Mend, AnEdgeInAFacePartsInsideFromOutside) {
  RandomInput random(7);
  std::vector<std::array<double, 2>> profile = {{0, -0.5}};
  for (int k = 0; k <= 6; k++) profile.push_back({0.5, k / 6.0 - 0.5});
  profile.push_back({0, 0.5});
  const Mesh prism = mapped(lathe(profile, 4), [](auto p) { return Point(p.z(), p.x(), p.y() + 1); });
  const Mesh cube_on_its_edge = mapped(shapes::box({-0.5, -0.5, -0.5}, {0.5, 0.5, 0.5}, 6),
                                       [](auto p) { return Point(p.x(), p.y() + p.z(), p.z() - p.y() + 1); });
  const Mesh box = shapes::box({-2, -2, -1}, {2, 2, 1}, 3);
  for (const Mesh& half : {prism, cube_on_its_edge})
    for (int k = 0; k < 50; k++) {
      const Eigen::Matrix3d turn = random.rotation();
      const Repaired r = mended(moved(joined(box, half), turn, random.direction()));
      EXPECT_NEAR(volume(r), volume(box) + volume(half) / 2, 1e-9) << k;
    }
}

// A tire alone has no wall where its wheel belongs. A barrel is closed by a lid and a floor.
TEST(Mend, TheHoleThroughATireIsNotFilled) {
  for (const int n : {40, 200})
    for (const double half_width : {0.01, 0.2, 0.33, 0.36, 0.9}) {
      const bool tire = half_width < 0.6 / std::sqrt(3);
      std::vector<std::array<double, 2>> profile;
      for (int k = 0; k <= 12; k++) {
        const double u = std::numbers::pi * k / 12;
        profile.push_back({0.6 + 0.4 * std::sin(u), -half_width * std::cos(u)});
      }
      double whole = 0;  // with the hole through it
      for (std::size_t k = 0; k + 1 < profile.size(); k++) {
        const auto [r, low] = profile[k];
        const auto [s, high] = profile[k + 1];
        whole += (high - low) * (r * r + r * s + s * s) / 3;
      }
      const double hole = 2 * half_width * 0.6 * 0.6, per_turn = shapes::polygon_area(n, 1);
      const Mesh mesh = lathe(profile, n);
      for (const Mesh& side : {mesh, turned_over(mesh)}) {
        const Repaired r = expect_solid(side, per_turn * (whole - tire * hole), 1e-9, RepairMode::fill);
        EXPECT_EQ(r.patches.size(), tire ? 1u : 2u);
      }
    }
}

// The rims of a wide tire lie farther apart than in the test above, but are small in it; those of a bead lie
// farther apart than it is wide, and those of a barrel are large in it.
TEST(Mend, TheHoleThroughAWideTireIsNotFilled) {
  struct Body {
    double rim, tread, half_width;
    bool is_tire;
  };
  for (const auto& [rim, tread, half_width, is_tire] : {Body{1, 2.5, 0.55, true},
                                                        {1, 2.5, 0.6, true},
                                                        {0.3, 0.675, 0.178, true},
                                                        {0.097, 0.277, 0.123, true},
                                                        {1, 1.9, 0.6, false},
                                                        {0.3, 1, 0.9, false},
                                                        {1, 1.2, 1.5, false}}) {
    const Mesh mesh =
        lathe({{rim, -half_width}, {tread, -half_width}, {tread, half_width}, {rim, half_width}}, 48);
    const double per_turn = shapes::polygon_area(48, 1);
    for (const Mesh& side : {mesh, turned_over(mesh)}) {
      const Repaired r = mended(side, RepairMode::fill);
      EXPECT_EQ(r.patches.size(), is_tire ? 1u : 2u) << rim << ' ' << half_width;
      EXPECT_NEAR(volume(r), per_turn * 2 * half_width * (tread * tread - is_tire * rim * rim), 1e-9);
    }
  }
}

// The edges of the two discs run beside each other as those of a crack do.
TEST(Mend, TwoPlatesAsCloseAsACrackAreNoBody) {
  for (const double apart : {1e-6, 4e-6, 1e-5}) {
    Mesh plates;
    plates.points = {{0, 0, 0}, {0, 0, apart}};
    constexpr std::uint32_t n = 32;
    for (std::uint32_t k = 0; k < n; k++) {
      const std::uint32_t next = 2 + 2 * ((k + 1) % n), at = 2 + 2 * k;
      for (const double z : {0.0, apart}) plates.points.push_back(shapes::on_circle(k, n, 1, z));
      plates.triangles.push_back({0, next, at}), plates.triangles.push_back({1, at + 1, next + 1});
    }
    EXPECT_EQ(mended(plates).kind, BodyKind::sheet) << apart;
  }
}

// The walls of a pipe are two pieces, and nothing joins them at its ends.
TEST(Mend, APipeOfTwoWallsIsNoRod) {
  const auto wall = [](double radius, const Point& at, int n) {
    return moved(lathe({{radius, 0}, {radius, 3}}, n), at);
  };
  const Point middle(0, 0, 0), left(-0.5, 0, 0), right(0.5, 0, 0);
  const Mesh outer = wall(1, middle, 40);
  const Mesh pipe = joined(outer, turned_over(wall(0.8, middle, 31)));
  const double thin = 3 * (polygon_area(40, 1) - polygon_area(31, 0.8));
  for (const Mesh& mesh : {pipe, turned_over(pipe)}) {
    const Repaired r = expect_solid(mesh, thin, 1e-6);
    EXPECT_EQ(r.patches.size(), 2u);
  }
  const Mesh bores = joined(turned_over(wall(0.3, left, 20)), turned_over(wall(0.3, right, 20)));
  EXPECT_NEAR(volume(mended(joined(outer, bores))), 3 * (polygon_area(40, 1) - 2 * polygon_area(20, 0.3)),
              1e-6);
  const Mesh sleeve = joined(wall(0.7, middle, 40), turned_over(wall(0.6, middle, 40)));
  EXPECT_NEAR(volume(mended(joined(pipe, sleeve))),
              thin + 3 * (polygon_area(40, 0.7) - polygon_area(40, 0.6)), 1e-6);
  // Both walls may face outward. Of three, the innermost is a rod.
  EXPECT_NEAR(volume(mended(joined(outer, wall(0.8, middle, 31)))), thin, 1e-6);
  const Mesh walls = joined(outer, joined(wall(0.8, middle, 31), wall(0.5, middle, 20)));
  EXPECT_NEAR(volume(mended(walls)), thin + 3 * polygon_area(20, 0.5), 1e-6);
}

TEST(Mend, ACarBodyIsASheet) {
  Mesh body = without(shapes::box({0, 0, 0}, {4, 1.8, 1.4}, 4), [](const Point& p) { return p.z() == 0; });
  body.add(shapes::square(1));  // a seat
  const Repaired r = mended(body);
  EXPECT_EQ(r.kind, BodyKind::sheet);
  EXPECT_NEAR(r.mesh.area(), body.area(), 1e-9);
}

TEST(Mend, ASheetThatRunsIntoASolidKeepsTheRestOutside) {
  const Mesh fin = mapped(shapes::square(1), [](auto p) {  // half of its length lies in the cube
    return Point(p.x() + 0.5, 0.5 * (p.y() + 0.2), 0.4);
  });
  const Repaired r = expect_solid(joined(kCube, fin), 1, 1e-9);
  EXPECT_NEAR(r.steps.sheet_area, 0.25, 1e-9);
  EXPECT_NEAR(r.steps.buried_area, 0.25, 1e-9);
}

TEST(Mend, FacesWithTwoSidesCountOnce) {
  const Repaired r = mended(joined(kOpenCube, turned_over(kOpenCube)));
  EXPECT_EQ(r.kind, BodyKind::sheet);
  EXPECT_NEAR(r.mesh.area(), 5, 1e-9);
  EXPECT_NEAR(volume(mended(joined(kCube, turned_over(kCube)))), 1, 1e-12);
}

// Cut along one diagonal and along the other: all edges of the face have three triangles. The triangles stand
// in any order in the file, and the second face may look inward.
TEST(Mend, AFaceThatIsGivenTwiceWithAnotherDiagonalCountsOnce) {
  RandomInput random(11);
  for (int k = 0; k < 40; k++) {
    Mesh cube = shapes::box({0, 0, 0}, {1, 1, 1});
    std::vector<std::array<std::uint32_t, 3>> top;
    for (const auto& t : cube.triangles)
      if (cube.points[t[0]].z() + cube.points[t[1]].z() + cube.points[t[2]].z() == 3) top.push_back(t);
    ASSERT_EQ(top.size(), 2u);
    for (std::uint32_t v = 0; v < 3; v++)  // the corner of the first that the second has not
      if (std::find(top[1].begin(), top[1].end(), top[0][0]) != top[1].end())
        std::rotate(top[0].begin(), top[0].begin() + 1, top[0].end());
    const auto [a, b, c] = top[0];
    const std::uint32_t d = top[1][0] ^ top[1][1] ^ top[1][2] ^ b ^ c;
    const bool inward = k % 2 == 0;
    cube.triangles.push_back(inward ? std::array{a, d, b} : std::array{a, b, d});
    cube.triangles.push_back(inward ? std::array{a, c, d} : std::array{a, d, c});
    for (std::size_t t = cube.triangles.size(); t-- > 1;)
      std::swap(cube.triangles[t], cube.triangles[static_cast<std::size_t>(random.uniform(0, double(t)))]);
    expect_solid(moved(cube, random.rotation(), random.direction()), 1, 1e-12);
  }
}

// Cut along their crossings they would be some millions of triangles.
TEST(Mend, SheetsThatCrossAreNotCut) {
  RandomInput random(5);
  Mesh mesh;
  for (int k = 0; k < 1000; k++) mesh.add({random.point(), random.point(), random.point()});
  const Repaired r = mended(mesh);
  EXPECT_EQ(r.kind, BodyKind::sheet);
  EXPECT_EQ(r.mesh.triangles.size(), mesh.triangles.size());
  EXPECT_NEAR(r.mesh.area(), mesh.area(), 1e-9 * mesh.area());
}

// Half of the sheet lies on the cube's face, and is no surface of its own there. The face stays whole.
TEST(Mend, ASheetOnAFaceIsTheFace) {
  const Repaired r = expect_solid(joined(kCube, moved(shapes::square(1), {0.5, 0, 1})), 1, 1e-12);
  EXPECT_NEAR(r.steps.sheet_area, 0.5, 1e-12);
  EXPECT_NEAR(r.mesh.area(), 6.5, 1e-12);
}

TEST(Mend, CracksAndTJunctionsAreClosed) {
  for (const double crack : {0.0, 5e-5}) {
    const Mesh lid = moved(shapes::square(1, 7), {0, 0, 1 + crack});  // seven parts where the rim has two
    const Repaired r = expect_solid(joined(kOpenCube, lid), 1, 1e-4);
    EXPECT_EQ(r.patches.size(), 0u);
    EXPECT_GT(crack > 0 ? r.steps.cracks : r.steps.split, 0u);
    EXPECT_NEAR(r.steps.crack_width, crack, 1e-12);
  }
}

// As where a program divides each face of a solid by itself, and parts of an assembly touch.
TEST(Mend, TouchingCubesWhoseFacesAreDividedEachByItselfAreSolid) {
  const auto cube = [](double x, std::array<int, 6> parts) {
    Mesh all;
    for (std::size_t face = 0; face < 6; face++)
      all.add(shapes::face_of_cube(static_cast<int>(face), parts[face]));
    return moved(all, {x, 0, 0});
  };
  const Mesh one = cube(0, {1, 2, 4, 3, 5, 3}), other = cube(1, {4, 1, 3, 3, 2, 5});
  for (const Mesh& mesh : {joined(one, other), joined(one, turned_over(other))}) {
    const Repaired r = expect_solid(mesh, 2, 1e-9);
    EXPECT_EQ(r.steps.sheet_area, 0);
  }
  RandomInput random(3);
  Mesh block;
  for (int k = 0; k < 18; k++) {
    std::array<int, 6> parts;
    for (int& n : parts) n = 1 + static_cast<int>(random.uniform(0, 4.999));
    block.add(moved(cube(k % 3, parts), {0., k / 3 % 3 * 1., k / 9 * 1.}));
  }
  EXPECT_NEAR(volume(mended(block)), 18, 1e-9);
}

TEST(Mend, CracksWiderThanAQuarterOfTheToleranceAreHoles) {
  const Mesh mesh = joined(kOpenCube, moved(shapes::square(1), {0, 0, 1 + 5e-5}));
  for (const double tolerance : {2.1e-4, 1.9e-4}) {
    const Repaired r = mend(mesh, {.tolerance = tolerance}).value();
    EXPECT_EQ(r.steps.cracks > 0, tolerance > 2e-4);
    EXPECT_EQ(r.patches.empty(), tolerance > 2e-4);
  }
}

// Each triangle a little smaller, so that none shares a point with another. At the poles many corners lie
// within a crack of each other.
TEST(Mend, TrianglesThatAllLieApartByCracksAreOneBody) {
  std::vector<std::array<double, 2>> half;
  for (int k = 0; k <= 20; k++)
    half.push_back({std::sin(k * std::numbers::pi / 20), -std::cos(k * std::numbers::pi / 20)});
  const Mesh ball = lathe(half, 32);
  Mesh apart;
  for (std::size_t t = 0; t < ball.triangles.size(); t++) {
    const Point middle = ball.middle(t);
    auto corners = ball.corners(t);
    for (Point& p : corners) p = middle + 0.9995 * (p - middle);
    if (ball.area_normal(t).norm() > 1e-9) apart.add(corners);
  }
  const Repaired r = expect_solid(apart, mass_properties(ball).volume, 0.01);
  EXPECT_LT(r.steps.cracks, 8 * apart.triangles.size());
}

TEST(Mend, CornersThatLieNearEachOtherAreJoined) {
  const Mesh wall = moved(shapes::square(1, 2),
                          Eigen::AngleAxisd(std::numbers::pi / 2, Vector::UnitX()).matrix(), {0, 0.5, 0});
  for (const bool keep : {false, true}) {
    const RepairOptions options{.join_width = keep ? 0 : RepairOptions().join_width};
    const Repaired r = mend(with_corners_off(joined(kCube, wall), 3e-5), options).value();
    EXPECT_EQ(r.steps.joined > 0, !keep);
    EXPECT_LE(r.steps.joined_width, 6e-5);
    if (keep) continue;
    EXPECT_EQ(r.kind, BodyKind::solid);
    EXPECT_EQ(r.patches.size(), 0u);
    EXPECT_NEAR(volume(r), 1, 1e-3);
    EXPECT_NEAR(r.steps.buried_area, 1, 1e-3);
  }
  // Copies that lie close to each other, each with holes of its own, are not knitted together.
  Mesh holed = shapes::box({0, 0, 0}, {1, 1, 1}, 6);
  Mesh copy = moved(holed, {1e-6, 1e-6, 2e-6});
  for (std::size_t t = holed.triangles.size(); t-- > 0;) {
    if (t % 23 == 0) holed.triangles.erase(holed.triangles.begin() + std::ptrdiff_t(t));
    if (t % 29 == 4) copy.triangles.erase(copy.triangles.begin() + std::ptrdiff_t(t));
  }
  const Repaired copies = expect_solid(joined(holed, copy), 1, 1e-4);
  EXPECT_EQ(copies.steps.joined, 0u);
  // Nor where they have the same holes; but the two sides of a thin plate belong together.
  copy = moved(holed, {1e-6, 1e-6, 2e-6});
  EXPECT_NEAR(volume(mended(joined(holed, copy))), 1, 1e-4);
  const Mesh plate = shapes::box({0, 0, 0}, {1, 1, 1e-3}, 3);
  EXPECT_NEAR(volume(mended(with_corners_off(plate, 3e-5))), 1e-3, 1e-4);
  // Fewer open edges must be left: a lid that shares two corners with a box hangs together with it no more.
  EXPECT_EQ(mended(joined(kOpenCube, moved(shapes::square(1, 7), {0, 0, 1 + 5e-5}))).steps.joined, 0u);
}

// Walls inside included: more triangles meet there, and none of them says which way it faces.
TEST(Mend, CornersAreJoinedOverAShareOfTheTolerance) {
  const Mesh block = cells(2, 3);
  const double diagonal = block.bounds().diagonal();
  for (const double off : {1e-4, 1e-3}) {
    const Repaired r = mend(with_corners_off(block, off * diagonal), {.tolerance = 0.01 * diagonal}).value();
    EXPECT_EQ(r.kind, BodyKind::solid);
    EXPECT_LE(r.steps.joined_width, 0.0025 * diagonal);
    EXPECT_NEAR(volume(r), 8, 0.02);
    EXPECT_NEAR(r.steps.buried_area, 12, 0.1);
    EXPECT_NEAR(r.steps.sheet_area, 0, 1e-12);
  }
}

TEST(Mend, AMirroredHalfThatFacesInwardIsTurned) {
  const Mesh half =
      without(shapes::box({0, 0, 0}, {1, 1, 0.5}, 3), [](const Point& p) { return p.z() == 0; });
  const Mesh other = mapped(half, [](auto p) { return Point(p.x(), p.y(), -2e-5 - p.z()); });
  const Repaired r = expect_solid(joined(half, other), 1, 1e-4);
  EXPECT_EQ(r.patches.size(), 0u);
  EXPECT_NEAR(r.steps.joined_width, 1e-5, 1e-12);
}

TEST(Mend, TrianglesWithoutAreaHoldTheSurfaceTogether) {
  // A point on the edge of a face, and a triangle without area that joins it to the face on the other side.
  Mesh mesh = shapes::box({0, 0, 0}, {1, 1, 1});
  const auto [a, b, c] = mesh.triangles.back();
  mesh.triangles.pop_back();
  const auto n = static_cast<std::uint32_t>(mesh.points.size());
  mesh.points.push_back(0.5 * (mesh.points[a] + mesh.points[b]));
  mesh.triangles.insert(mesh.triangles.end(), {{a, n, c}, {n, b, c}, {a, b, n}});
  const Repaired r = expect_solid(mesh, 1, 1e-12);
  EXPECT_EQ(r.steps.cracks + r.patches.size() + r.flat.triangles.size(), 0u);
}

// T-junctions alone are cracks. Where scraps stand on the surface, or triangles repeat that are divided
// differently, more than two triangles meet in edges, and the outside came in at the T-junctions.
TEST(Mend, EdgesAreSplitWhereCornersLieOnThem) {
  const Mesh post = lathe({{0, 0}, {1, 0}, {1, 2}, {0, 2}}, 12);
  for (const std::uint64_t seed : {1u, 2u, 3u, 4u}) {
    SCOPED_TRACE(seed);
    RandomInput random(seed);
    const auto divided = [&](const Mesh& mesh) {  // some triangles are cut in two
      Mesh out;
      out.points = mesh.points;
      for (const auto& [a, b, c] : mesh.triangles) {
        const auto q = static_cast<std::uint32_t>(out.points.size());
        out.triangles.push_back({a, b, c});
        if (random.uniform(0, 1) > 0.3) continue;
        out.points.push_back(mesh.points[a] + random.uniform(0.3, 0.7) * (mesh.points[b] - mesh.points[a]));
        out.triangles.back()[1] = q, out.triangles.push_back({q, b, c});
      }
      return out;
    };
    Mesh scraps = divided(post), twice = post;
    for (std::size_t k = 0; k < 3; k++) {
      const auto t = scraps.triangles[static_cast<std::size_t>(random.uniform(0, 40))];
      scraps.triangles.push_back({t[0], t[1], static_cast<std::uint32_t>(scraps.points.size())});
      scraps.points.push_back(Point(0, 0, 1) + 0.3 * random.direction());
    }
    for (const auto& t : post.triangles)
      if (random.uniform(0, 1) < 0.4) twice.triangles.push_back(t);
    twice = divided(twice);
    for (const Mesh& post_in_parts : {scraps, twice})
      for (const double grid : {0x1p40, 0x1p22}) {  // as pad and as a file in float round
        const Repaired r = expect_solid(
            mapped(post_in_parts, [&](const Point& p) -> Point { return (p * grid).array().round() / grid; }),
            volume(post), 20 / grid);
        EXPECT_GT(r.steps.split, 0u);
        EXPECT_GT(r.steps.joined_width, 0.01 / grid);
        EXPECT_LT(r.steps.joined_width, 4 / grid);
      }
    // What a user wants kept is not moved.
    EXPECT_EQ(mend(twice, {.join_width = 0}).value().steps.joined_width, 0);
    // A copy that lies near is not knitted to the surface.
    const Mesh copy = moved(scraps, {1e-6, 2e-6, 1e-6});
    EXPECT_NEAR(volume(mended(joined(scraps, copy))), volume(post), 1e-4);
  }
}

// A cube of 27 cells without the one in the middle, and without one at the rim that shares an edge with it.
TEST(Mend, ACavityMayShareAnEdgeWithTheOutside) {
  const Mesh all = cells(3, 1, {9, 13});
  const auto middle = [&](const auto& t) -> Point {
    return (all.points[t[0]] + all.points[t[1]] + all.points[t[2]]) / 3;
  };
  Mesh mesh = all;  // without the walls, which are there twice
  std::erase_if(mesh.triangles, [&](const auto& t) {
    return std::count_if(all.triangles.begin(), all.triangles.end(),
                         [&](const auto& other) { return (middle(t) - middle(other)).norm() < 1e-9; }) > 1;
  });
  for (int turn = 0; turn < 3; turn++) {
    for (auto& t : mesh.triangles) std::rotate(t.begin(), t.begin() + 1, t.end());
    const Repaired r = mended(mesh);
    EXPECT_EQ(r.steps.cavities, 1u);
    EXPECT_NEAR(volume(r), 25, 1e-12);
  }
}

// The file says that nothing is there, also where a part of what was cut out sticks out: that part is a
// sheet.
TEST(Mend, WhatWasCutOutOfABodyIsACavityAlsoWhereItTouchesAWall) {
  const Mesh bore = shapes::box({0.4, 0.4, 0}, {0.6, 0.6, 1}, 3),
             pocket = shapes::box({0, 0.1, 0.1}, {0.3, 0.3, 0.3}),
             post = shapes::box({0.4, 0.4, 0}, {0.6, 0.6, 1.01}, 3);
  const Repaired r = mended(joined(joined(kCube, turned_over(bore)), turned_over(pocket)));
  EXPECT_EQ(r.steps.cavities, 2u);
  EXPECT_EQ(r.steps.turned_pieces, 0u);
  EXPECT_NEAR(volume(r), 1 - 0.04 - 0.012, 1e-12);
  EXPECT_NEAR(volume(mended(joined(kCube, bore))), 1, 1e-12);
  EXPECT_NEAR(volume(mended(joined(kCube, turned_over(bore)), RepairMode::united)), 1, 1e-12);
  const Mesh open_post = without(post, [](const Point& p) { return p.z() == 0 || p.z() == 1.01; });
  for (const Mesh& cut : {post, open_post}) {
    const Repaired stuck = mended(joined(kCube, turned_over(cut)));
    EXPECT_EQ(stuck.steps.cavities, 1u);
    EXPECT_NEAR(volume(stuck), 1 - 0.04, 1e-9);
  }
  // A copy that is moved a little has no deep walls in the body.
  EXPECT_NEAR(volume(mended(joined(kCube, moved(turned_over(kCube), {1e-4, 2e-4, 1e-4})))), 1, 1e-3);
  // Nor has one of two cubes that touch, though each has the other for a wall; nor a noisy one.
  const Mesh two = joined(kCube, moved(kCube, {0.5, 0.25, 1}));
  EXPECT_NEAR(volume(mended(joined(two, moved(turned_over(two), {1e-6, 2e-6, 0})))), 2, 1e-3);
  const Mesh ball = shapes::sphere(3);
  RandomInput random(7);
  const Mesh noisy = roughened(turned_over(ball), 0.01, random);
  EXPECT_GT(volume(mended(joined(ball, noisy))), 0.99 * mass_properties(ball).volume);
}

// A ball with a thin tube through it, whose far end faces the wrong way: a closed surface that no turning
// makes face one way. The ball stays as it is, whichever triangle comes first.
TEST(Mend, ATwistInABodyTurnsNothingElse) {
  Mesh mesh = shapes::sphere(4);
  const auto end = [&](double side) {  // takes out the triangle nearest to the pole
    const auto last = std::max_element(mesh.triangles.begin(), mesh.triangles.end(), [&](auto& s, auto& t) {
      const auto sum = [&](const auto& c) {
        return mesh.points[c[0]] + mesh.points[c[1]] + mesh.points[c[2]];
      };
      return side * sum(s).x() < side * sum(t).x();
    });
    const auto corners = *last;
    mesh.triangles.erase(last);
    return corners;
  };
  const auto a = end(1), b = end(-1);
  for (int k = 0; k < 3; k++) {
    const int l = (k + 1) % 3;
    mesh.triangles.insert(mesh.triangles.end(), {{a[k], a[l], b[l]}, {a[k], b[l], b[k]}});
  }
  Random random(5);
  for (int order = 0; order < 20; order++) {
    for (std::size_t k = mesh.triangles.size(); k-- > 1;)
      std::swap(mesh.triangles[k], mesh.triangles[random.below(k + 1)]);
    const Repaired r = expect_solid(mesh, mass_properties(shapes::sphere(4)).volume, 0.02);
    EXPECT_EQ(r.steps.turned, 0u);
    EXPECT_LT(r.steps.sheet_area, 0.3);
  }
}

// The lower half of a box once more, with the same triangles where the two share a face: all edges close, but
// not without the repeated triangles.
TEST(Mend, ABodyThatSharesFacesWithAnotherIsSolid) {
  Mesh half = kCube;
  for (Point& p : half.points) p.z() = std::min(p.z(), 0.5);
  std::erase_if(half.triangles, [&](const auto& t) {
    return Triangle3{half.points[t[0]], half.points[t[1]], half.points[t[2]]}.area_normal().norm() == 0;
  });
  for (const bool hole : {false, true}) {
    Mesh mesh = joined(half, kCube);
    if (hole) mesh.triangles.pop_back();
    const Repaired r = expect_solid(mesh, 1, 1e-12);
    EXPECT_EQ(r.steps.sheet_area, 0);
  }
}

// As parts of an assembly that were mirrored: a wall of the one is in the file twice, both times facing
// alike.
TEST(Mend, ACubeThatFacesInwardBetweenOthersIsSolid) {
  const auto at = [](int k) { return shapes::box({k * 1., 0, 0}, {k + 1., 1, 1}); };
  const Repaired r = mended(joined(joined(at(0), turned_over(at(1))), at(2)));
  EXPECT_EQ(r.steps.sheet_area, 0);
  EXPECT_NEAR(volume(r), 3, 1e-12);
  EXPECT_NEAR(r.steps.buried_area, 2, 1e-12);
}

// Most triangles of the copy are those of the ball, and some have corners that differ by rounding.
TEST(Mend, ACopyThatDiffersByRoundingCountsOnce) {
  const Mesh ball = shapes::sphere(4);
  Mesh copy = ball;
  for (std::size_t v = 0; v < copy.points.size(); v += 20)
    copy.points[v] += (v % 40 ? -1 : 1) * 2e-11 * Vector(1, 2, 3);
  const Repaired r = mended(joined(ball, copy));
  EXPECT_EQ(r.patches.size(), 0u);
  EXPECT_EQ(r.steps.cavities, 0u);
  EXPECT_NEAR(volume(r), mass_properties(ball).volume, 1e-9);
}

// All but a few triangles of a ball with a hole are there once more, facing inward: with them all edges
// close, too, but around nothing.
TEST(Mend, ABodyWhoseTrianglesFaceBothWaysIsSolid) {
  Mesh mesh = shapes::sphere(4);
  const double whole = mass_properties(mesh).volume;
  const auto gone = static_cast<std::uint32_t>(mesh.points.size() - 1);  // six triangles meet there
  std::erase_if(mesh.triangles,
                [&](const auto& t) { return std::find(t.begin(), t.end(), gone) != t.end(); });
  for (std::size_t t = mesh.triangles.size() - 1; t-- > 0;) {
    const auto [a, b, c] = mesh.triangles[t];
    mesh.triangles.push_back({a, c, b});
  }
  expect_solid(mesh, whole, 0.01);
}

// Cells with walls between them, as of a mesh of finite elements or of a model drawn with faces inside. Their
// triangles face either way. A fin stands on an edge.
TEST(Mend, CellsWithWallsBetweenThemAreOneBody) {
  Mesh block = cells(2, 3);
  Random random(3);
  for (auto& t : block.triangles)
    if (random.below(2)) std::swap(t[1], t[2]);
  Mesh fin = shapes::fin({1, 1, 2}, {4 / 3.0, 1, 3});
  const auto away = [&, corner = fin.points[1]](const Point& p) { return (p - corner).norm(); };
  fin.points[1] = *std::ranges::min_element(block.points, {}, away);
  for (const bool hole : {false, true})
    for (const bool with_fin : {false, true}) {
      Mesh mesh = block;
      if (hole) mesh.triangles.erase(mesh.triangles.begin() + 8);  // in the middle of a face outside
      if (with_fin) mesh.add(fin);
      const Repaired r = expect_solid(mesh, 8, 1e-12);
      EXPECT_NEAR(r.boundary().area(), 24, 1e-12);
      EXPECT_NEAR(r.steps.buried_area, 12, 1e-12);
      EXPECT_NEAR(r.steps.sheet_area, with_fin ? 1 / 3.0 : 0, 1e-12);
      EXPECT_EQ(r.patches.size(), hole ? 1u : 0u);
    }
  const std::string report = repair(block, {}, "cells").report;
  EXPECT_TRUE(holds(report, "left out walls inside (33.3 % of the surface)"));
  // Without its lid, the upper half is a sheet.
  const Repaired open = mended(without(block, [](const Point& p) { return p.z() == 2; }));
  EXPECT_NEAR(volume(open), 4, 1e-12);
  EXPECT_NEAR(open.steps.sheet_area, 12, 1e-12);
}

TEST(Mend, WhatIsLeftBetweenTheCracksOfASheetIsNoSolid) {
  // A square, and a speck that lacks a side.
  Mesh speck = shapes::box({0.5, 0.5, 0.1}, {0.5 + 1e-6, 0.5 + 1e-6, 0.1 + 1e-6});
  speck.triangles.pop_back();
  const Repaired r = mended(joined(shapes::square(1), speck));
  EXPECT_EQ(r.kind, BodyKind::sheet);
  EXPECT_EQ(r.patches.size(), 0u);
}

TEST(Mend, CertifiedCoversHoldWhenSampled) {
  for (const std::uint64_t seed : {7u, 8u}) {
    RandomInput random(seed);
    Mesh mesh =
        joined(shapes::blob(random, 3), moved(shapes::blob(random, 3), random.rotation(), {0.8, 0.2, 0}));
    mesh.add(moved(shapes::square(1, 3), random.rotation(), {1.2, 0.6, 0.2}));  // a sheet
    const Repaired r = mended(mesh);
    EXPECT_GT(r.steps.sheet_area, 0);
    const double e = 0.03 * mesh.bounds().diagonal();
    const Surface surface = r.surface(), input(mesh);
    const Culled culled = cull(surface, {.tolerance = e, .effort = 0});
    ASSERT_TRUE(culled.proved);
    const Mesh& solid = r.solid->mesh();
    for (const Ball& ball : culled.balls)
      for (int k = 0; k < 10; k++) {
        const Point x = ball.center + ball.radius * random.direction();
        if (winding(solid, x) < 0.5) {
          EXPECT_LE(input.nearest(x).distance, e * (1 + 1e-6));
        }
      }
    const BallSet balls(culled.balls);
    for (std::size_t t = 0; t < mesh.triangles.size(); t++) {
      const Point x = mesh.middle(t);
      if (winding(solid, x + 1e-6 * random.direction()) < 0.5) {
        EXPECT_LE(balls.gap(x).value, e * (1 + 1e-3));
      }
    }
  }
}

TEST(Mend, ASheetOfAThicknessNeedsFewerBalls) {
  RandomInput random(12);
  Mesh mesh = shapes::square(1, 12);
  for (Point& p : mesh.points) p.z() = 0.1 * std::sin(5 * p.x()) * std::cos(4 * p.y());
  std::size_t last = ~0u;
  for (const double thickness : {0.0, 0.05, 0.2}) {
    const Repaired r = mend(mesh, {.thickness = thickness}).value();
    EXPECT_EQ(r.kind, BodyKind::sheet);
    const double e = 0.03;
    const Culled culled = cull(r.surface(), {.tolerance = e, .effort = 0});
    EXPECT_TRUE(culled.proved);
    EXPECT_LT(culled.balls.size(), last);
    last = culled.balls.size();
    const Surface input(mesh);
    for (const Ball& ball : culled.balls)
      for (int k = 0; k < 20; k++) {
        const Point x = ball.center + ball.radius * random.direction();
        EXPECT_LE(input.nearest(x).distance, 0.5 * thickness + e * (1 + 1e-6));
      }
  }
}

TEST(Mend, SameForAnyNumberOfThreads) {
  RandomInput random(9);
  Mesh mesh;
  for (int k = 0; k < 20; k++) mesh.add(moved(kCube, random.rotation(), random.point()));
  mesh.triangles.resize(mesh.triangles.size() - 3);
  const Repaired one = with_threads(1, [&] { return mended(mesh); });
  const Repaired three = with_threads(3, [&] { return mended(mesh); });
  EXPECT_EQ(one.mesh.points, three.mesh.points);
  EXPECT_EQ(one.mesh.triangles, three.mesh.triangles);
  EXPECT_EQ(one.solid->mesh().triangles, three.solid->mesh().triangles);
}

// The face of one box runs through an edge of the other one, along the middle of it: what lies before the two
// triangles of that edge differs there.
TEST(Mend, AFaceThroughAnEdgePartsWhatLiesOnBothSidesOfIt) {
  Mesh slanted = mapped(shapes::box({0, 0.25, 0}, {1, 0.75, 0.5}),
                        [](auto p) { return Point(0.5 + p.x() + p.z(), p.y(), 0.5 + p.x() - p.z()); });
  if (volume(slanted) < 0) slanted = turned_over(slanted);
  for (const int n : {1, 4}) {
    const Mesh cube = shapes::box({0, 0, 0}, {1, 1, 1}, n);
    const Repaired r = mended(joined(cube, slanted));
    EXPECT_NEAR(volume(r), 1.375, 1e-12);
    EXPECT_EQ(r.sheet, 0u);
    expect_body(
        r, [&](const Point& p) { return winding(cube, p) + winding(slanted, p) > 0.5; }, 1);
  }
}

}  // namespace
}  // namespace padder
