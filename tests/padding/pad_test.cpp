// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/pad.h"

#include <gtest/gtest.h>

#include "padding/asset/error.h"
#include "tests/error_of.h"
#include "tests/padding/balls.h"
#include "tests/padding/random_input.h"
#include "tests/padding/threads.h"

namespace padder {
namespace {

using shapes::joined, shapes::mapped, shapes::moved, shapes::scaled;

ReadResult as_file(const Mesh& mesh) {
  ReadResult file;
  file.mesh = mesh;
  file.source.file = "part.obj";
  file.source.triangles = mesh.triangles.size();
  return file;
}

const Mesh kCube = shapes::box({0, 0, 0}, {1, 1, 1});

bool in_spheres(const Cluster& c, const Point& p, double more = 0) { return gap_to(balls_of(c), p) <= more; }

void expect_refused(const Mesh& mesh, const PadOptions& options, const std::string& says) {
  EXPECT_TRUE(refuses([&] { const Padded p = pad(as_file(mesh), options); }, says));
}

TEST(Pad, ClosedFormsAreMetWithinTheCaps) {
  struct Case {
    std::string name;
    Mesh mesh;
    double volume;
  };
  const Case cases[] = {{"cube", kCube, 1},
                        {"sphere", shapes::sphere(6), 4 / 3. * std::numbers::pi},
                        {"torus", shapes::torus(1, 0.3, 200, 60), 2 * std::pow(std::numbers::pi * 0.3, 2)},
                        {"plate 1000:1", shapes::box({0, 0, 0}, {1, 1, 0.001}), 0.001}};
  for (const auto& [name, mesh, volume] : cases) {
    SCOPED_TRACE(name);
    PadOptions options{.edge_length = Length::share(0.04)};
    const Padded p = pad(as_file(mesh), options);
    const double cap = options.depth_ratio_used() * p.report.quality.circumradius_max;
    EXPECT_LE(p.cluster.accuracy.protrusion_max, cap * 1.001);
    EXPECT_LE(p.cluster.accuracy.gap_max, cap * 1.001);
    EXPECT_GT(p.cluster.accuracy.coverage, 0.9);
    EXPECT_NEAR(p.cluster.mass.volume, volume, 2e-3 * volume);
    EXPECT_EQ(p.cluster.bounds.low, mesh.bounds().low);
    EXPECT_EQ(p.report.triangles_in, mesh.triangles.size());
  }
}

TEST(Pad, NoSphereIsRefused) {
  PadOptions inner{.tolerance = Length::share(0.05), .protrusion = Length::of(0)};
  expect_refused(shapes::square(1), inner, "part.obj: no sphere lies inside of it");
  inner.min_radius = Length::share(0.5);
  expect_refused(kCube, inner, "no sphere is as large");
  Mesh bar = shapes::box({0, 0, 0}, {1, 1e-4, 1e-4}), crossing = bar;
  crossing.add(mapped(shapes::turned_over(bar),
                      [](const Point& p) { return Point(p.y() + 0.5, p.x() - 0.5, p.z()); }));
  PadOptions coarse{.depth_ratio = 0.3, .edge_length = Length::share(0.1), .force = true};
  expect_refused(crossing, coarse, "use a shorter --edge-length");
}

// Compares sphere by sphere, to 1e-9 of the diagonal.
void expect_same(const Cluster& a, const Cluster& b, double scale,
                 const std::function<Point(const Point&)>& move) {
  ASSERT_EQ(a.size(), b.size());
  double worst = 0;
  for (std::size_t k = 0; k < a.size(); k++) {
    worst = std::max(worst, (move(a.centers[k]) - b.centers[k]).norm() / b.bounds.diagonal());
    worst = std::max(worst, std::abs(scale * a.radii[k] - b.radii[k]) / b.bounds.diagonal());
  }
  EXPECT_LT(worst, 1e-9);
}

// Each has the edge length in its own unit: the diagonal of its box changes with the turn.
TEST(Pad, TurnedMovedAndScaledInputGivesTheSameSpheres) {
  const auto padded = [](const Mesh& mesh, double scale) {
    return pad(as_file(mesh), {.edge_length = Length::of(0.2 * scale)}).cluster;
  };
  for (std::uint64_t seed = 1; seed <= 3; seed++) {
    shapes::RandomInput random(seed);
    const Mesh mesh = shapes::blob(random);
    const double s = std::exp(random.uniform(-9, 9));
    const Eigen::Matrix3d turn = random.rotation();
    const Vector shift = s * random.point(2);
    const auto similar = [&](const Point& p) -> Point { return s * (turn * p) + shift; };
    expect_same(padded(mesh, 1), padded(mapped(mesh, similar), s), s, similar);
  }
}

TEST(Pad, SameBytesForAnyNumberOfThreads) {
  const ReadResult file = as_file(shapes::torus(1, 0.3, 50, 20));
  const auto text = [&] { return to_json(pad(file, {}).cluster); };
  EXPECT_EQ(with_threads(1, text), with_threads(4, text));
}

TEST(Pad, TinyAndHugeBodies) {
  for (const double s : {1e-30, 1e-6, 1e38}) {
    SCOPED_TRACE(s);
    const Padded p = pad(as_file(shapes::box({0, 0, 0}, {s, s, s})), {.edge_length = Length::share(0.05)});
    EXPECT_NEAR(p.cluster.mass.volume / std::pow(s, 3), 1, 1e-9);
    EXPECT_LT(p.cluster.accuracy.gap_max, 0.02 * s);
  }
}

TEST(Pad, FarFromTheOriginKeepsItsDigits) {
  const Mesh mesh = moved(kCube, {1e7, 1e7, 1e7});
  const Padded p = pad(as_file(mesh), {});
  EXPECT_NEAR(p.cluster.mass.volume, 1, 1e-6);
  EXPECT_LT(p.cluster.accuracy.protrusion_max, 0.01);
}

TEST(Pad, WhatCannotBeWrittenDownIsNotCertified) {
  const Mesh mesh = moved(kCube, {1e15, 1e15, 1e15});
  const Padded p = pad(as_file(mesh), {.tolerance = Length::share(0.01)});
  EXPECT_FALSE(p.cluster.accuracy.certified);
  EXPECT_TRUE(holds(p.report.reason, "move the mesh"));
}

// Where spheres inside of the body leave some of it open, the reason is the true one, and the remedy helps.
TEST(Pad, TheReasonForOpenSurfaceIsTrue) {
  const auto reason = [](const Mesh& mesh, const PadOptions& options) {
    const Padded p = pad(as_file(mesh), options);
    EXPECT_EQ(p.cluster.accuracy.certified, p.report.reason.empty());
    return p.report.reason;
  };
  const Mesh with_fin = joined(shapes::box({0, 0, 0}, {4, 2, 2}), shapes::fin({1, 1, 1.5}, {3, 1, 3}));
  PadOptions options{.protrusion = Length::of(0), .gap = Length::share(0.04), .effort = 0};
  const std::string sheet = reason(with_fin, options);
  EXPECT_TRUE(holds(sheet, "is a sheet") && holds(sheet, "--thickness") && !holds(sheet, "radius")) << sheet;
  options.thickness = Length::share(0.01);
  EXPECT_EQ(reason(with_fin, options), "");
  const Mesh box = shapes::box({0, 0, 0}, {3, 2, 1});
  for (const double protrusion : {0.0, 0.01}) {
    PadOptions large{.protrusion = Length::share(protrusion), .gap = Length::share(0.02), .effort = 0};
    large.min_radius = Length::share(0.1);
    const std::string limit = reason(box, large);
    EXPECT_TRUE(holds(limit, "--min-radius") && !holds(limit, "--protrusion")) << limit;
    large.min_radius = Length::share(0.01);
    EXPECT_EQ(reason(box, large), "");
  }
}

TEST(Pad, AMassOfAPartIsTold) {
  const auto warnings = [](double edge, RepairMode mode) {
    const Mesh sheet = moved(shapes::square(edge), {3, 0, 0});
    return pad(as_file(joined(kCube, sheet)), {.tolerance = Length::share(0.05), .repair = mode})
        .report.warnings;
  };
  const auto told = warnings(2, RepairMode::automatic);  // 4 of 10
  ASSERT_EQ(told.size(), 1u);
  EXPECT_TRUE(holds(told[0], "a part of it, as 40 % of its surface is a sheet: use --repair fill"));
  EXPECT_TRUE(warnings(0.5, RepairMode::automatic).empty());
}

// There writing a sphere down moves it by more than a protrusion of 0 allows for rounding.
TEST(Pad, ATinyPartFarAwayKeepsItsSpheresInside) {
  const Mesh mesh = moved(scaled(shapes::box({0, 0, 0}, {1, 2, 3}), 0.01), {1e6, 1e6, 1e6});
  const Padded p = pad(as_file(mesh), {.protrusion = Length::of(0), .gap = Length::share(0.05)});
  EXPECT_TRUE(p.cluster.accuracy.certified) << p.report.reason;
  for (std::size_t k = 0; k < p.cluster.size(); k++) {
    // Against the planes of the box as the file has them.
    const Vector low = p.cluster.centers[k] - mesh.bounds().low,
                 high = mesh.bounds().high - p.cluster.centers[k];
    EXPECT_LE(p.cluster.radii[k], std::min(low.minCoeff(), high.minCoeff())) << k;
  }
}

// A part of 10 m at its place on a map: there a double moves a sphere by more than rounding is allowed.
TEST(Pad, APartOnAMapIsCertified) {
  const Mesh mesh = moved(shapes::box({0, 0, 0}, {10, 10, 10}), {5e8, 5e7, 300});
  const Padded p = pad(as_file(mesh), {.tolerance = Length::share(0.02)});
  EXPECT_TRUE(p.cluster.accuracy.certified) << p.report.reason;
}

TEST(Pad, ASheetIsSaidToBeOne) {
  const Padded p = pad(as_file(shapes::square(1, 4)), {});
  EXPECT_EQ(p.report.kind, BodyKind::sheet);
  EXPECT_TRUE(holds(p.cluster.source.repair, "sheet"));
  EXPECT_EQ(p.cluster.mass.volume, 0);
}

// Caps that are so flat would cover a box by tens of millions of spheres.
TEST(Pad, ADepthRatioThatWouldNeverEndIsRefused) {
  // Few balls as large as its box would do, but a thin wall around a hollow has no room for them.
  const Mesh hollow = joined(kCube, shapes::turned_over(shapes::box({.01, .01, .01}, {.99, .99, .99})));
  expect_refused(hollow, {.depth_ratio = 1e-4}, "a depth ratio of 0.0001 would need more than");
  try {
    pad(as_file(kCube), {.depth_ratio = 1e-6});
    FAIL() << "it came to an end";
  } catch (const Error& e) {
    EXPECT_TRUE(holds(e.what(), "a depth ratio of 1e-06 would need more than")) << e.what();
    EXPECT_TRUE(holds(e.what(), "use a larger --depth, or --tolerance")) << e.what();
  }
  EXPECT_GT(pad(as_file(shapes::square(1, 2)), {.depth_ratio = 1e-6}).cluster.size(), 0u) << "a flat sheet";
}

TEST(Pad, EdgesThatWouldMakeHundredsOfMillionsOfTrianglesAreRefused) {
  expect_refused(kCube, {.edge_length = Length::of(1e-4)}, " triangles: use a larger --edge-length");
}

Padded by_tolerance(const Mesh& mesh, double share, PadOptions options = {}) {
  options.tolerance = Length::share(share);
  return pad(as_file(mesh), options);
}

TEST(Pad, AToleranceIsKeptAndProved) {
  for (const auto& [name, mesh] : {std::pair<std::string, Mesh>{"cube", kCube},
                                   {"torus", shapes::torus(1, 0.3, 60, 20)},
                                   {"plate", shapes::box({0, 0, 0}, {1, 1, 0.02})}}) {
    SCOPED_TRACE(name);
    const Padded p = by_tolerance(mesh, 0.02);
    const Accuracy& a = p.cluster.accuracy;
    EXPECT_TRUE(a.certified);
    const double asked = 0.02 * p.report.diagonal * (1 + 1e-9);
    EXPECT_LE(a.protrusion_bound, asked);
    EXPECT_LE(a.gap_bound, asked);
    EXPECT_EQ(p.report.triangles_remeshed, 0u);
    PadOptions by_depth{.edge_length = Length::share(0.02)};
    EXPECT_LT(p.cluster.size(), pad(as_file(mesh), by_depth).cluster.size() / 4);
  }
}

TEST(Pad, ASphereIsOneSphere) { EXPECT_EQ(by_tolerance(shapes::sphere(4), 0.02).cluster.size(), 1u); }

TEST(Pad, ATighterToleranceOnDepthThinsLess) {
  const Mesh mesh = shapes::torus(1, 0.3, 60, 20);
  PadOptions options{.depth_ratio = 0.3, .edge_length = Length::share(0.03)};
  const std::size_t all = pad(as_file(mesh), options).cluster.size();
  options.effort = 0;
  const std::size_t loose = by_tolerance(mesh, 0.02, options).cluster.size();
  const Padded tight = by_tolerance(mesh, 0.004, options);
  EXPECT_LT(loose, tight.cluster.size());
  EXPECT_LE(tight.cluster.size(), all);
  EXPECT_GT(tight.report.triangles_remeshed, 0u);
}

TEST(Pad, ACountIsKept) {
  PadOptions options{.effort = 0};
  options.max_spheres = 12;
  const Padded few = pad(as_file(shapes::torus(1, 0.3, 60, 20)), options);
  options.max_spheres = 30;
  const Padded more = pad(as_file(shapes::torus(1, 0.3, 60, 20)), options);
  EXPECT_LE(few.cluster.size(), 12u);
  EXPECT_LE(more.cluster.size(), 30u);
  EXPECT_LT(more.cluster.accuracy.gap_bound + more.cluster.accuracy.protrusion_bound,
            few.cluster.accuracy.gap_bound + few.cluster.accuracy.protrusion_bound);
}

// In a grid as wide as the largest sphere, a sphere stands in (1 + r / R)^3 cells on the whole.
TEST(Pad, GridEntriesAreThoseOfTheSpheres) {
  const Padded p = by_tolerance(shapes::torus(1, 0.3, 60, 20), 0.02, {.effort = 0});
  const auto [smallest, largest] = std::ranges::minmax(p.cluster.radii);
  EXPECT_LT(smallest, largest);
  double entries = 0;
  for (const double r : p.cluster.radii) entries += std::pow(1 + r / largest, 3);
  EXPECT_NEAR(p.report.grid_entries, entries, 1e-9 * entries);
}

TEST(Pad, ALadderHasEachRungProvedAndIsReadBack) {
  PadOptions options{.lod = {Length::share(0.01), Length::share(0.04), Length::share(0.02)}};
  const Padded p = pad(as_file(shapes::torus(1, 0.3, 60, 20)), options);
  ASSERT_EQ(p.cluster.lods.size(), 2u);
  EXPECT_NEAR(p.cluster.lods[0].tolerance, 0.04 * p.report.diagonal, 1e-12);
  EXPECT_LT(p.cluster.lods[0].radii.size(), p.cluster.lods[1].radii.size());
  EXPECT_LT(p.cluster.lods[1].radii.size(), p.cluster.size());
  for (const Lod& lod : p.cluster.lods) {
    EXPECT_TRUE(lod.accuracy.certified);
    EXPECT_LE(lod.accuracy.gap_bound, lod.tolerance * (1 + 1e-9));
  }
  EXPECT_TRUE(p.cluster.accuracy.certified);
  const std::string text = to_json(p.cluster);
  EXPECT_EQ(to_json(cluster_from_json(text, "text")), text);
}

TEST(Pad, WhatAGrainCannotReachIsNotPadded) {
  // A block with a slot 0.1 wide and 0.8 deep.
  Mesh mesh = shapes::box({0, 0, 0}, {0.45, 1, 1}, 2);
  for (const Mesh& more :
       {shapes::box({0.55, 0, 0}, {1, 1, 1}, 2), shapes::box({0.3, 0.1, 0.05}, {0.7, 0.9, 0.2}, 2)})
    mesh.add(more);
  const auto in_slot = [](const Cluster& c) { return in_spheres(c, {0.5, 0.5, 0.6}); };
  PadOptions options{.effort = 0, .min_grain_radius = Length::of(0.02)};
  EXPECT_FALSE(in_slot(by_tolerance(mesh, 0.02, options).cluster));
  options.min_grain_radius = Length::of(0.15);
  const Padded closed = by_tolerance(mesh, 0.02, options);
  EXPECT_TRUE(in_slot(closed.cluster));
  EXPECT_GT(closed.report.buried, 0.2);
}

TEST(Pad, RadiusLimitsAreKept) {
  for (const double limit : {0.1, 0.07}) {  // to the last digit
    PadOptions options{.max_radius = Length::of(limit)};
    const Cluster c = by_tolerance(kCube, 0.02, options).cluster;
    for (const double r : c.radii) EXPECT_LE(r, limit);
    EXPECT_TRUE(c.accuracy.certified);
  }
}

// Checks what a certificate says on points of the union's surface, by solid angles and nearest points.
double largest_protrusion(const Mesh& mesh, const Cluster& c, int points) {
  const Surface surface(mesh);
  const std::vector<Ball> balls = balls_of(c);
  const BallSet set(balls);
  shapes::RandomInput random(11);
  double worst = 0;
  for (int k = 0; k < points; k++) {
    const Ball& ball = balls[static_cast<std::size_t>(k) % balls.size()];
    const Point x = ball.center + ball.radius * random.direction();
    if (set.gap(x).value < -1e-9) continue;
    if (const auto winding = surface.winding_number(x); winding && *winding <= 0)
      worst = std::max(worst, surface.nearest(x).distance);
  }
  return worst;
}

// With --repair never, only the certificate checks the surface.
TEST(Pad, WhatIsCertifiedWithoutRepairIsTrue) {
  const Mesh inverted = shapes::turned_over(shapes::box({0, 0, 0}, {1, 1, 1}, 2));
  const Mesh crossing = joined(kCube, shapes::box({0.5, 0.25, 0.25}, {1.5, 0.75, 0.75}));
  const Mesh half = joined(shapes::box({2, 0, 0}, {4, 1, 1}), inverted);
  for (const auto& [name, mesh] :
       {std::pair<std::string, Mesh>{"inverted", inverted}, {"crossing", crossing}, {"half", half}})
    for (const bool depth : {false, true}) {
      SCOPED_TRACE(name + (depth ? ", depth" : ", tolerance"));
      PadOptions options{.effort = 0, .repair = RepairMode::never};
      if (depth)
        options.edge_length = Length::share(0.06);
      else
        options.tolerance = Length::share(0.03);
      const Padded p = pad(as_file(mesh), options);
      const Accuracy& a = p.cluster.accuracy;
      EXPECT_EQ(a.proved_against, SurfaceKind::input);
      EXPECT_LE(largest_protrusion(mesh, p.cluster, 5000), a.protrusion_max * (1 + 1e-9));
      if (!depth) {
        EXPECT_EQ(a.certified, p.report.within);
      }
      EXPECT_EQ(a.certified, p.report.reason.empty()) << p.report.reason;
      EXPECT_GE(p.cluster.mass.volume, 0);
      EXPECT_EQ(p.report.warnings.empty(), name != "inverted");
    }
}

// A cube with a fin of one square on its top, which bounds nothing: in colours of its own, a sheet.
TEST(Pad, ASheetOfABodyIsMarked) {
  const Mesh mesh = joined(kCube, shapes::fin({0.2, 0.5, 1}, {0.8, 0.5, 1.4}));
  const Padded p = by_tolerance(mesh, 0.05, {.effort = 0});
  EXPECT_EQ(p.report.kind, BodyKind::solid);
  EXPECT_TRUE(p.cluster.accuracy.certified);
  ASSERT_EQ(p.marks.size(), 1u);
  EXPECT_EQ(p.marks[0].kind, MarkKind::sheet);
  EXPECT_NEAR(p.marks[0].mesh.area(), 0.6 * 0.4, 1e-9);
  for (const Point& x : p.marks[0].mesh.points) EXPECT_GE(x.z(), 1 - 1e-9);
}

// The unit cube with a fin, whose distances have closed forms.
struct FinnedCube {
  const Point from{1, 0.2, 0.2}, to{1.6, 0.2, 0.8};  // of the fin
  Mesh mesh = joined(kCube, shapes::fin(from, to));

  double to_cube(const Point& p) const { return (p - p.cwiseMax(0).cwiseMin(1)).norm(); }
  double to_fin(const Point& p) const { return (p - p.cwiseMax(from).cwiseMin(to)).norm(); }
  // How far is a point from the body, half of whose thickness lies on each side of the fin?
  double to_body(const Point& p, double thickness) const {
    return std::max(0.0, std::min(to_cube(p), to_fin(p) - 0.5 * thickness));
  }
};

// How far a random point of the spheres stands out of the body.
double sampled_protrusion(const FinnedCube& body, const Cluster& c, double thickness) {
  shapes::RandomInput random(3);
  double most = 0;
  for (std::size_t k = 0; k < c.size(); k++)
    for (int j = 0; j < 200; j++)
      most = std::max(most, body.to_body(c.centers[k] + c.radii[k] * random.direction(), thickness));
  return most;
}

// Larger spheres would do on a thick sheet. The tolerance is kept with more of those that are allowed.
TEST(Pad, SpheresOfAThickSheetKeepTheLimitsOfTheRadius) {
  const FinnedCube body;
  shapes::RandomInput random(4);
  for (const double gap : {0.05, 0.0}) {
    SCOPED_TRACE(gap);
    const Padded p = pad(as_file(body.mesh), {.protrusion = Length::of(0.05),
                                              .gap = Length::of(gap),
                                              .max_radius = Length::of(0.12),
                                              .effort = 0,
                                              .thickness = Length::of(0.3)});
    const Cluster& c = p.cluster;
    EXPECT_TRUE(c.accuracy.certified) << p.report.reason;
    EXPECT_LE(*std::max_element(c.radii.begin(), c.radii.end()), 0.12 * (1 + 1e-9));
    EXPECT_LE(sampled_protrusion(body, c, 0.3), 0.05 * (1 + 1e-6));
    for (int k = 0; k < 2000; k++) {
      const Point on_fin(random.uniform(1, 1.6), 0.2, random.uniform(0.2, 0.8));
      EXPECT_TRUE(in_spheres(c, on_fin, gap + 1e-9)) << on_fin.transpose();
      EXPECT_TRUE(in_spheres(c, {random.uniform(0, 1), random.uniform(0, 1), 1}, gap + 1e-9));
    }
  }
  PadOptions alone{.tolerance = Length::share(0.02), .effort = 0, .thickness = Length::of(0.1)};
  for (const double largest : {0.01, 0.03, 0.06, 0.2}) {
    alone.max_radius = Length::of(largest);
    const Padded p = pad(as_file(shapes::square(1)), alone);
    EXPECT_TRUE(p.cluster.accuracy.certified) << p.report.reason;
    for (const double r : p.cluster.radii) EXPECT_LE(r, largest * (1 + 1e-9));
  }
  alone.max_radius = {};
  for (const double smallest : {0.06, 0.078}) {  // the largest that keeps the tolerance has 0.0783
    alone.min_radius = Length::of(smallest);
    const Padded p = pad(as_file(shapes::square(1)), alone);
    EXPECT_TRUE(p.cluster.accuracy.certified) << p.report.reason;
    for (const double r : p.cluster.radii) EXPECT_GE(r, smallest);
  }
  alone.min_radius = Length::of(0.08);
  expect_refused(shapes::square(1), alone, "--min-radius");
}

// What lies half of the thickness beside the fin need not lie in spheres that cover the fin.
TEST(Pad, ABodyIsSaidToBeCoveredOnlyIfItIs) {
  const FinnedCube body;
  shapes::RandomInput random(5);
  for (const double thickness : {0.0, 0.004, 0.2}) {
    SCOPED_TRACE(thickness);
    const Padded p = pad(as_file(body.mesh), {.protrusion = Length::of(0.05),
                                              .gap = Length::of(0),
                                              .effort = 0,
                                              .thickness = Length::of(thickness)});
    EXPECT_TRUE(p.cluster.accuracy.certified) << p.report.reason;
    bool covered = true;
    for (int k = 0; k < 4000; k++) {
      covered = covered &&
                in_spheres(p.cluster, {random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)});
      const Vector across(0, random.uniform(-0.5, 0.5) * thickness, 0);
      covered = covered &&
                in_spheres(p.cluster, Point(random.uniform(1, 1.6), 0.2, random.uniform(0.2, 0.8)) + across);
    }
    EXPECT_TRUE(covered || !p.report.filled_body);
    if (thickness == 0.2) EXPECT_FALSE(covered);
    EXPECT_FALSE(p.report.filled_body) << "the fin has no inside";
    ASSERT_EQ(p.report.warnings.size(), 1u);
    EXPECT_TRUE(holds(p.report.warnings[0], "--repair fill"));
    EXPECT_EQ(p.report.warnings[0].find("not its thickness") != std::string::npos, thickness > 0);
  }
}

// Beside the root of the fin the cube is nearer, but for half of the thickness.
TEST(Pad, NoSampleOfAThickSheetIsAboveTheBound) {
  const FinnedCube body;
  for (const bool by_depth : {false, true}) {
    PadOptions options{.effort = 0, .thickness = Length::of(0.2)};
    (by_depth ? options.edge_length : options.tolerance) = Length::of(by_depth ? 0.1 : 0.05);
    const Padded p = pad(as_file(body.mesh), options);
    const Accuracy& a = p.cluster.accuracy;
    EXPECT_TRUE(a.certified) << p.report.reason;
    EXPECT_NEAR(a.protrusion_max, a.protrusion_bound, 1e-12);
    EXPECT_LE(sampled_protrusion(body, p.cluster, 0.2), a.protrusion_bound + 1e-12);
  }
}

// Below the normals of a sheet each sphere is as deep as its triangle asks for.
TEST(Pad, AThicknessThatDoesNothingIsRefused) {
  PadOptions by_depth{.edge_length = Length::of(0.1), .thickness = Length::of(0.1)};
  expect_refused(shapes::square(1), by_depth, "a thickness has no effect");
  PadOptions as_it_is{.tolerance = Length::of(0.05), .repair = RepairMode::never};
  as_it_is.thickness = Length::of(0.1);
  expect_refused(shapes::square(1), as_it_is, "leave out --repair never");
}

// By depth ratio, a body of pieces that cross is remeshed as evenly as one that was whole.
TEST(Pad, CrossingPiecesMakeNoMoreSpheresByDepthThanTheirAreaAsksFor) {
  const Mesh mesh = joined(kCube, shapes::box({1e-6, 1e-5, 0.3}, {1.5, 0.7, 0.8}));
  const Padded p = pad(as_file(mesh), {.depth_ratio = 0.2, .edge_length = Length::of(0.05)});
  EXPECT_TRUE(p.cluster.accuracy.certified);
  EXPECT_LT(p.report.quality.share_under_20_deg, 0.02);
  EXPECT_GT(p.report.quality.min_angle_deg, 10);
  const double area = 6 + 2 * (0.5 * 0.7 + 0.5 * 0.5);  // and a triangle of edge L has 0.43 L^2
  EXPECT_LT(double(p.cluster.size()), 1.5 * area / (0.43 * 0.05 * 0.05));
}

TEST(Pad, EachFigureSaysWhatItWasProvedAgainst) {
  const auto basis = [](const Padded& p) { return p.cluster.accuracy.proved_against; };
  const Mesh box = shapes::box({0, 0, 0}, {1, 1, 1}, 24);
  PadOptions quick{.effort = 0};
  const Padded whole = by_tolerance(box, 0.05, quick);
  EXPECT_EQ(basis(whole), SurfaceKind::input);
  EXPECT_EQ(whole.report.reason, "");
  EXPECT_EQ(whole.cluster.mass_of, SurfaceKind::input);

  Mesh hole = box;
  hole.triangles.erase(hole.triangles.begin(), hole.triangles.begin() + 2);  // a square of 1/24
  const Padded filled = by_tolerance(hole, 0.05, quick);
  EXPECT_EQ(basis(filled), SurfaceKind::filled);
  EXPECT_EQ(filled.report.filled, 1u);
  EXPECT_NEAR(filled.report.filled_area, 1 / 576., 1e-9);
  EXPECT_TRUE(filled.report.within);
  EXPECT_TRUE(filled.cluster.accuracy.certified);  // the patch is named, and is no reason against it
  EXPECT_EQ(filled.cluster.mass_of, SurfaceKind::filled);

  const Padded wrap = by_tolerance(kCube, 0.05, {.effort = 0, .repair = RepairMode::wrap});
  EXPECT_EQ(basis(wrap), SurfaceKind::wrap);
  EXPECT_TRUE(wrap.cluster.accuracy.certified);
  EXPECT_EQ(wrap.cluster.mass_of, SurfaceKind::wrap);

  const Padded sheet = by_tolerance(shapes::square(1, 8), 0.01, {.effort = 0, .repair = RepairMode::never});
  EXPECT_EQ(basis(sheet), SurfaceKind::none);
  EXPECT_FALSE(sheet.cluster.accuracy.certified);
  for (const Padded* p : {&whole, &filled, &wrap, &sheet}) {
    const Accuracy& a = p->cluster.accuracy;
    const double asked = p->report.tolerance * (1 + 1e-9);
    EXPECT_EQ(p->report.within, a.protrusion_max <= asked && a.gap_max <= asked);
    EXPECT_EQ(p->report.reason.empty(), a.certified);
  }
}

// The wall inside of a wrap has room on both sides, more than the ball that touches it.
TEST(Pad, NoSphereInAWrapIsLargerThanAsked) {
  const Mesh hollow = joined(shapes::box({0, 0, 0}, {1, 1, 1}),
                             shapes::turned_over(shapes::box({0.2, 0.2, 0.2}, {0.8, 0.8, 0.8})));
  PadOptions options{.effort = 0, .repair = RepairMode::wrap};
  options.max_radius = Length::share(0.05);
  const Padded p = by_tolerance(hollow, 0.1, options);
  EXPECT_TRUE(p.cluster.accuracy.certified) << p.report.reason;
  EXPECT_LE(*std::ranges::max_element(p.cluster.radii), 0.05 * std::sqrt(3));
}

// Spheres may close a slit that is narrower than twice the tolerance: they stand out of its walls by no more.
// A wider one must stay open, unless --reach says that no grain enters it.
TEST(Pad, AWrapKeepsTheToleranceAgainstTheInput) {
  const double side = 0.5, tolerance = 0.0225, within = tolerance * std::hypot(side, side, 0.8) * (1 + 1e-9);
  for (const double width : {0.01, 0.06, 0.12}) {
    SCOPED_TRACE("slit of " + std::to_string(width));
    const Mesh slit = joined(shapes::box({0, 0, 0}, {side, side, 0.4 - 0.5 * width}, 2),
                             shapes::box({0, 0, 0.4 + 0.5 * width}, {side, side, 0.8}, 2));
    PadOptions options{.effort = 0, .repair = RepairMode::wrap};
    const Padded p = by_tolerance(slit, tolerance, options);
    EXPECT_EQ(p.report.kind, BodyKind::wrap);
    EXPECT_TRUE(p.cluster.accuracy.certified) << p.report.reason;
    EXPECT_LE(p.cluster.accuracy.protrusion_max, within);
    EXPECT_LE(largest_protrusion(slit, p.cluster, 5000), within);
    EXPECT_TRUE(p.report.slots.empty());
    options.min_grain_radius = Length::of(0.05);
    const Padded closed = by_tolerance(slit, tolerance, options);
    EXPECT_EQ(closed.cluster.accuracy.certified, width < 0.04 || width > 0.1) << closed.report.reason;
    EXPECT_EQ(closed.report.within, closed.cluster.accuracy.certified);
    if (width < 0.1) {
      EXPECT_GT(closed.report.buried, 0.1);
    }
    if (closed.report.within) continue;
    ASSERT_FALSE(closed.report.slots.empty());
    EXPECT_GE(closed.report.slots[0].width, width);
    EXPECT_NEAR(closed.report.slots[0].place.z(), 0.4, 0.05);
    EXPECT_TRUE(holds(closed.report.reason, "--reach"));
  }
}

// Each triangle has corners of its own, a hair off those of its neighbours, and every third one is turned.
// With a gap of 0 the body must be covered all the same, and not as if it were a sheet.
TEST(Pad, AGapOf0CoversTheInsideOfABodyWithHairCracks) {
  Mesh cracked = shapes::with_corners_off(kCube, 1e-8);
  for (std::size_t t = 0; t < cracked.triangles.size(); t += 3)
    std::swap(cracked.triangles[t][1], cracked.triangles[t][2]);
  shapes::RandomInput random(1);
  const PadOptions options{.protrusion = Length::share(0.05), .gap = Length::of(0), .effort = 0};
  const Padded p = pad(as_file(cracked), options);
  EXPECT_EQ(p.report.kind, BodyKind::solid);
  EXPECT_TRUE(p.report.filled_body && p.cluster.accuracy.certified) << p.report.reason;
  for (int k = 0; k < 2000; k++) {
    const Point at(random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1));
    EXPECT_TRUE(in_spheres(p.cluster, at, 1e-7)) << at.transpose();
  }
  const Padded sheet = pad(as_file(shapes::square(1, 3)), options);
  EXPECT_EQ(sheet.report.kind, BodyKind::sheet);
  EXPECT_FALSE(sheet.report.filled_body) << "it has no inside";
  ASSERT_EQ(sheet.report.warnings.size(), 1u);
  EXPECT_TRUE(holds(sheet.report.warnings[0], "--repair fill"));
}

// A wrap lies outside of the input, so that no sphere is proved to stay inside of it: the reason says so.
TEST(Pad, NoWrapKeepsAProtrusionOf0) {
  for (const double gap : {0.05, 0.2}) {
    PadOptions options{.protrusion = Length::of(0), .gap = Length::share(gap), .effort = 0};
    options.repair = RepairMode::wrap;
    const Padded p = pad(as_file(kCube), options);
    EXPECT_FALSE(p.report.within);
    EXPECT_TRUE(holds(p.report.reason, "because the wrap stands off the input by up to")) << p.report.reason;
    EXPECT_TRUE(holds(p.report.reason, "use a --protrusion above 0")) << p.report.reason;
  }
}

TEST(Pad, AWrapOfLooseTrianglesIsCertified) {
  for (std::uint64_t seed = 1; seed <= 2; seed++) {
    shapes::RandomInput random(seed);
    const Mesh soup = shapes::random_soup(random, 12, 0.3, 0.25);
    const Padded p = by_tolerance(soup, 0.03, {.effort = 0, .repair = RepairMode::wrap});
    EXPECT_TRUE(p.cluster.accuracy.certified) << p.report.reason;
    EXPECT_TRUE(p.report.slots.empty());
    EXPECT_LE(p.cluster.accuracy.wrap_distance, p.report.tolerance);
    EXPECT_EQ(p.report.buried, 0);
  }
}

// A box whose lid lies a little above the rim. What closes the crack is no part of the input, so the spheres
// may stand out of the closed box by no more than the tolerance less the crack.
TEST(Pad, TheWidthOfAClosedCrackIsTakenOffTheTolerance) {
  const double crack = 1.5e-4, tolerance = 0.02;
  const Mesh mesh = joined(shapes::without(kCube, [](auto p) { return p.z() == 1; }),
                           moved(shapes::square(1, 3), {0, 0, 1 + crack}));
  PadOptions whole, each, inner, few;
  whole.tolerance = each.tolerance = inner.tolerance = few.tolerance = Length::of(tolerance);
  each.gap = Length::of(0.03), inner.protrusion = Length::of(0), few.max_spheres = 1000;
  for (PadOptions* options : {&whole, &each, &inner, &few}) {
    options->effort = 0;
    const Padded p = pad(as_file(mesh), *options);
    const double allowed = options == &inner ? 0 : tolerance;
    EXPECT_NEAR(p.report.steps.crack_width, crack, 1e-9);
    EXPECT_TRUE(p.cluster.accuracy.certified) << p.report.reason;
    EXPECT_LE(p.cluster.accuracy.protrusion_bound, allowed + 1e-9);
    for (std::size_t k = 0; k < p.cluster.size(); k++) {
      const Point &c = p.cluster.centers[k], far = Point(1, 1, 1 + crack) - c;
      const double inside = std::min(c.minCoeff(), far.minCoeff());
      EXPECT_LE(p.cluster.radii[k], inside + allowed - crack + 1e-9);
    }
  }
}

// The same box: the spheres get the body's volume although a crack was closed.
TEST(Pad, SpheresAreBalancedAlsoWhereACrackWasClosed) {
  const Mesh mesh = joined(shapes::without(kCube, [](auto p) { return p.z() == 1; }),
                           moved(shapes::square(1, 3), {0, 0, 1 + 1.5e-4}));
  PadOptions options;
  options.tolerance = Length::of(0.02), options.balance = Balance::volume, options.effort = 0;
  const Padded p = pad(as_file(mesh), options);
  EXPECT_TRUE(p.cluster.accuracy.certified) << p.report.reason;
  EXPECT_NEAR(p.cluster.volume_union, 1, 0.01);
  options.balance = Balance::none;
  EXPECT_GT(pad(as_file(mesh), options).cluster.volume_union, 1.02);
}

// Two halves of a box that nearly meet. Joining their corners moves one of them, and the errors are against
// the input.
TEST(Pad, JoinedCornersAreTakenOffBothErrors) {
  const double crack = 1.5e-4, tolerance = 0.02;
  const Mesh half =
      shapes::without(shapes::box({0, 0, 0}, {1, 1, 0.5}, 2), [](auto p) { return p.z() == 0; });
  const Mesh mesh = joined(half, mapped(half, [&](auto p) { return Point(p.x(), p.y(), -crack - p.z()); }));
  PadOptions whole, each, full, inner;
  whole.tolerance = each.tolerance = Length::of(tolerance);
  each.gap = Length::of(0.03), full.protrusion = Length::of(tolerance), full.gap = Length::of(0);
  inner.protrusion = Length::of(0), inner.gap = Length::of(0.05);
  for (PadOptions* options : {&whole, &each, &full, &inner}) {
    options->effort = 0;
    const Padded p = pad(as_file(mesh), *options);
    EXPECT_TRUE(p.cluster.accuracy.certified) << p.report.reason;
    const double protrusion = options == &inner ? 0 : tolerance;
    EXPECT_LE(p.cluster.accuracy.protrusion_bound, protrusion + 1e-9);
    const double gap = options == &each ? 0.03 : options == &full ? 0 : options == &inner ? 0.05 : tolerance;
    EXPECT_LE(p.cluster.accuracy.gap_bound, gap + 1e-9);
    EXPECT_GT(p.report.steps.joined, 0);
    EXPECT_EQ(p.report.filled_body, options == &full);
    EXPECT_NEAR(p.report.steps.joined_width, 0.5 * crack, 1e-9);  // both move half of the way
    for (std::size_t k = 0; k < p.cluster.size(); k++) {
      const Point &c = p.cluster.centers[k], low(0, 0, -0.5 - crack), high(1, 1, 0.5);
      const double inside = std::min((c - low).minCoeff(), (high - c).minCoeff());
      EXPECT_LE(p.cluster.radii[k], inside + protrusion + 1e-9);
    }
    for (const Point& corner : mesh.points) EXPECT_LE(gap_to(balls_of(p.cluster), corner), gap);
  }
}

TEST(Pad, ASpikeWithoutAreaIsSurfaceToo) {
  Mesh mesh = shapes::box({0, 0, 0}, {1, 1, 1}, 2);
  mesh.add({Point(1, 0.5, 0.5), Point(1.5, 0.5, 0.5), Point(1.2, 0.5, 0.5)});
  const Padded p = by_tolerance(mesh, 0.03);
  EXPECT_NEAR(p.cluster.accuracy.gap_max, 0.5, 0.1);
  EXPECT_FALSE(p.cluster.accuracy.certified);
  EXPECT_FALSE(p.report.within);
  EXPECT_TRUE(holds(p.report.reason, "triangles without area lie apart"));
}

// Points and lines that a file writes as triangles, mostly at the origin, are neither padded nor measured.
TEST(Pad, TrianglesOfFewerThanThreePointsAreLeftOut) {
  const Mesh box = shapes::box({10, 10, 10}, {11, 11, 11}, 2);
  Mesh mesh = box;
  const auto n = static_cast<std::uint32_t>(mesh.points.size());
  mesh.points.insert(mesh.points.end(), {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}, {50, 0, 0}});
  mesh.triangles.insert(mesh.triangles.end(), {{n, n + 1, n + 2}, {0, n + 3, n + 3}});
  const Padded p = by_tolerance(mesh, 0.03), alone = by_tolerance(box, 0.03);
  EXPECT_TRUE(p.cluster.accuracy.certified);
  EXPECT_EQ(p.cluster.radii, alone.cluster.radii);
  EXPECT_EQ(p.cluster.bounds.low, box.bounds().low);
  EXPECT_EQ(p.report.triangles_in, mesh.triangles.size());
  EXPECT_EQ(p.cluster.source.repair, "dropped 2 triangles with two corners at one point");
}

// spheres.triangle counts the triangles of Padded::mesh.
TEST(Pad, EachSphereTouchesItsTriangleOfTheMesh) {
  const Mesh torus = moved(scaled(shapes::torus(1, 0.3, 60, 20), 20), {300, -50, 7});
  PadOptions by_depth{.edge_length = Length::share(0.04)};
  PadOptions thinned = by_depth;
  thinned.depth_ratio = 0.2, thinned.tolerance = Length::share(0.01);
  PadOptions by_tolerance{.tolerance = Length::share(0.02)};
  for (const PadOptions& options : {by_depth, thinned, by_tolerance}) {
    const Padded p = pad(as_file(torus), options);
    if (options.by_depth())
      EXPECT_EQ(p.mesh.triangles.size(), p.report.triangles_remeshed);
    else
      EXPECT_EQ(p.mesh.triangles.size(), torus.triangles.size());
    const double slack = 1e-9 * p.report.diagonal;
    for (std::size_t k = 0; k < p.cluster.size(); k++) {
      const auto t = static_cast<std::size_t>(p.cluster.triangle[k]);
      ASSERT_LT(t, p.mesh.triangles.size());
      Mesh one;
      one.add(p.mesh.corners(t));
      EXPECT_LE(Surface(one).nearest(p.cluster.centers[k]).distance, p.cluster.radii[k] + slack) << k;
    }
  }
}

TEST(Pad, RefusesWhatCannotBeDone) {
  EXPECT_THROW(pad(as_file({{{1, 1, 1}}, {{0, 0, 0}}}), {}), Error);
  EXPECT_THROW(pad_file("no_such_file.obj", {}, {}), Error);
  PadOptions too_deep{.depth_ratio = 2}, negative{.tolerance = Length::of(-1)},
      beyond{.tolerance = Length::share(2)}, both{.lod = {Length::share(0.01)}};
  both.tolerance = Length::share(0.01);
  for (const PadOptions& options : {too_deep, negative, beyond, both})
    EXPECT_THROW(pad(as_file(shapes::sphere(2)), options), Error);
  beyond.force = true;
  EXPECT_EQ(pad(as_file(shapes::sphere(2)), beyond).cluster.size(), 1u);
}

}  // namespace
}  // namespace padder
