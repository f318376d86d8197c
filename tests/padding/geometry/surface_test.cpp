// SPDX-License-Identifier: MIT
#include "padding/geometry/surface.h"

#include <gtest/gtest.h>

#include <set>
#include <thread>

#include "tests/padding/random_input.h"

namespace padder {
namespace {

using shapes::RandomInput, shapes::joined, shapes::turned_over, shapes::winding;

// The oracle has no hierarchy and finds the nearest point of a triangle in another way than the library: the
// foot of the perpendicular if it lies inside, otherwise the nearest point of the three edges.
Point on_segment(const Point& p, const Point& a, const Point& b) {
  const Vector ab = b - a;
  const double length = ab.squaredNorm();
  if (length == 0) return a;
  return a + std::clamp((p - a).dot(ab) / length, 0.0, 1.0) * ab;
}

Point on_triangle(const Point& p, const std::array<Point, 3>& corners) {
  const auto& [a, b, c] = corners;
  const Vector n = (b - a).cross(c - a);
  if (n.squaredNorm() > 0) {
    const Point foot = p - n.dot(p - a) / n.squaredNorm() * n;
    if (n.dot((b - a).cross(foot - a)) >= 0 && n.dot((c - b).cross(foot - b)) >= 0 &&
        n.dot((a - c).cross(foot - c)) >= 0)
      return foot;
  }
  Point best = on_segment(p, a, b);
  for (const Point& q : {on_segment(p, b, c), on_segment(p, c, a)})
    if ((q - p).squaredNorm() < (best - p).squaredNorm()) best = q;
  return best;
}

double brute_force(const Mesh& mesh, const Point& p) {
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t t = 0; t < mesh.triangles.size(); t++)
    nearest = std::min(nearest, (on_triangle(p, mesh.corners(t)) - p).norm());
  return nearest;
}

TEST(Surface, ClearanceIsThatOfBruteForceWithEachTrianglesStandoff) {
  for (std::uint64_t seed = 1; seed <= 20; seed++) {
    RandomInput random(seed);
    const int n = seed < 4 ? static_cast<int>(seed) : 300;
    const Mesh mesh = shapes::random_soup(random, n, 1, seed % 2 ? 0.1 : 0.5);
    std::vector<double> standoff;
    for (int k = 0; k < n; k++) standoff.push_back(std::pow(random.uniform(0, 0.7), 1 + double(seed % 4)));
    const Surface surface(mesh, SideBy::winding, standoff);
    for (int k = 0; k < 300; k++) {
      const Point p = random.point(1.5);
      double least = std::numeric_limits<double>::infinity();
      for (std::size_t t = 0; t < mesh.triangles.size(); t++)
        least = std::min(least, (on_triangle(p, mesh.corners(t)) - p).norm() - standoff[t]);
      const Nearest clear = surface.clearance(p);
      EXPECT_NEAR(clear.distance, least, 1e-12);
      EXPECT_NEAR((clear.point - p).norm(), std::max(0.0, least), 1e-12);
      const double distance = surface.distance_to(clear.triangle, p);
      EXPECT_NEAR(distance - standoff[clear.triangle], least, 1e-12);
      EXPECT_EQ(surface.clearance(p, least - 1e-9).distance, std::numeric_limits<double>::infinity());
      EXPECT_EQ(surface.clearance(p, least + 1e-9).distance, clear.distance);
    }
  }
}

TEST(Surface, AHullSaysWhatIsInsideAndItsStandoffComesOff) {
  const Mesh ball = shapes::sphere(4);
  const Mesh around = shapes::scaled(ball, 1.1);
  const auto hull = std::make_shared<const Surface>(around, SideBy::pseudonormal,
                                                    std::vector<double>(around.triangles.size(), 0.1));
  Mesh turned = ball;  // every second triangle
  for (std::size_t t = 0; t < turned.triangles.size(); t += 2)
    std::swap(turned.triangles[t][0], turned.triangles[t][1]);
  const Surface surface(Surface(turned), hull);
  EXPECT_TRUE(surface.closed());
  EXPECT_EQ(&surface.boundary(), &hull->mesh());
  RandomInput random(1);
  for (int k = 0; k < 500; k++) {
    const Point p = random.point(1.3);
    const double truth = p.norm() - 1, slack = 0.006;  // of the faces below the spheres
    EXPECT_NEAR(surface.certified_distance(p), truth, slack);
    const Nearest at = surface.signed_nearest(p);
    EXPECT_NEAR(at.distance, truth, slack);
    EXPECT_GT(at.normal.dot(p), 0);
    if (std::abs(p.norm() - 1.1) < 0.01) continue;
    EXPECT_EQ(surface.winding_number(p), std::optional<int>(p.norm() < 1.1));
  }
}

void compare(const Mesh& mesh, RandomInput& random, int questions) {
  const Surface surface(mesh);
  const double diagonal = mesh.bounds().diagonal();
  for (int k = 0; k < questions; k++) {
    Point p = mesh.bounds().center() + random.point(diagonal);
    if (k % 4 == 0) p = mesh.points[random.below(mesh.points.size())];
    const double distance = brute_force(mesh, p), slack = 1e-12 * (diagonal + p.norm());
    const Nearest n = surface.nearest(p);
    ASSERT_NEAR(n.distance, distance, slack);
    ASSERT_NEAR((n.point - p).norm(), n.distance, slack);
    ASSERT_LT(n.triangle, mesh.triangles.size());
    const Point on = on_triangle(n.point, mesh.corners(n.triangle));
    ASSERT_NEAR((on - n.point).norm(), 0, slack);  // it is a point of the triangle it names
    ASSERT_NEAR(std::abs(surface.signed_nearest(p).distance), distance, slack);
    if (distance <= 10 * slack) continue;
    ASSERT_FALSE(std::isfinite(surface.nearest(p, 0.99 * distance).distance));
    ASSERT_NEAR(surface.nearest(p, 1.01 * distance).distance, distance, slack);
    ASSERT_FALSE(surface.any_within(p, 0.99 * distance));
    ASSERT_TRUE(surface.any_within(p, 1.01 * distance));
    ASSERT_FALSE(surface.any_within(p, -1.01 * distance));
  }
}

TEST(Surface, AgreesWithBruteForceOnSoups) {
  for (std::uint64_t seed = 1; seed <= 12; seed++) {
    RandomInput random(seed);
    const int sizes[] = {1, 2, 3, 5, 17, 60, 200, 400};
    compare(shapes::random_soup(random, sizes[seed % 8], 1, seed % 3 ? 0.3 : 0.01), random, 60);
  }
}

TEST(Surface, AgreesWithBruteForceOnBodiesFarFromTheOrigin) {
  for (std::uint64_t seed = 21; seed <= 23; seed++) {
    RandomInput random(seed);
    const Mesh mesh = shapes::moved(shapes::scaled(shapes::blob(random, 3), 0.01), {1000, -2000, 500});
    compare(mesh, random, 60);
  }
}

TEST(Surface, AllOnePointOrLineOrPlane) {
  RandomInput random(31);
  Mesh flat = shapes::square(1, 8);
  compare(flat, random, 60);
  Mesh same{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {}};
  same.triangles.assign(100, {0, 1, 2});
  compare(same, random, 60);
}

TEST(Surface, TrianglesWithoutAreaAreTheirSegmentOrPoint) {
  RandomInput random(41);
  const Mesh mesh{{{0, 0, 0}, {1, 0, 0}, {3, 0, 0}, {0, 5, 0}}, {{0, 1, 2}, {3, 3, 3}, {0, 0, 1}, {2, 0, 1}}};
  compare(mesh, random, 200);
  const Surface surface(mesh);
  EXPECT_DOUBLE_EQ(surface.nearest({2, 0, 1}).distance, 1);
  EXPECT_DOUBLE_EQ(surface.nearest({0, 5, 2}).distance, 2);
  EXPECT_FALSE(std::isnan(surface.signed_nearest({2, 0, 1}).distance));
}

// In extended precision: there the products that cancel in a needle keep enough digits.
long double distance_in_long_double(const Point& p, const Mesh& mesh) {
  using Wide = Eigen::Matrix<long double, 3, 1>;
  const Wide x = p.cast<long double>();
  Wide corner[3];
  for (int k = 0; k < 3; k++) corner[k] = mesh.corner(0, k).cast<long double>();
  const Wide n = (corner[1] - corner[0]).cross(corner[2] - corner[0]);
  bool inside = n.squaredNorm() > 0;
  long double nearest = std::numeric_limits<long double>::infinity();
  for (int k = 0; k < 3; k++) {
    const Wide from = x - corner[k], edge = corner[(k + 1) % 3] - corner[k];
    inside = inside && n.dot(edge.cross(from)) >= 0;
    const long double along = std::clamp(edge.dot(from) / edge.squaredNorm(), 0.0L, 1.0L);
    nearest = std::min(nearest, (from - along * edge).norm());
  }
  return inside ? std::abs(n.dot(x - corner[0])) / n.norm() : nearest;
}

TEST(Surface, DistancesToNeedlesAreRight) {
  for (std::uint64_t seed = 1; seed <= 2000; seed++) {
    RandomInput random(seed);
    const double width = std::pow(10, -random.uniform(1, 8));
    const Vector along = random.direction(), across = along.unitOrthogonal(), up = along.cross(across);
    Mesh mesh{{random.point(0.5), {}, {}}, {{0, 1, 2}}};
    const double third =
        seed % 5 == 0 ? width * random.uniform(-1, 1) : random.uniform(0, 1);  // a short side
    mesh.points[1] = mesh.points[0] + along, mesh.points[2] = mesh.points[0] + third * along;
    mesh.points[1 + seed % 2] += width * across;
    std::swap(mesh.points[0], mesh.points[seed % 3]);  // the sharp angle at each corner in turn
    const Surface surface(mesh);
    for (int k = 0; k < 20; k++) {
      const Point p = mesh.points[0] + random.uniform(-1.2, 1.2) * along +
                      width * (random.uniform(-2, 2) * across + random.uniform(-2, 2) * up);
      ASSERT_NEAR(surface.nearest(p).distance, static_cast<double>(distance_in_long_double(p, mesh)), 1e-11);
      ASSERT_NEAR((surface.nearest(p).point - p).norm(), surface.nearest(p).distance, 1e-11);
    }
  }
}

// Both faces of a star of n points, with its centre in the boxes of half of all triangles.
Mesh star(std::uint32_t n) {
  Mesh mesh;
  for (const double z : {0.0, 0.1}) {
    for (std::uint32_t k = 0; k < 2 * n; k++)
      mesh.points.push_back(shapes::on_circle(k, 2 * n, k % 2 ? 1 : 0.5, z));
    mesh.points.push_back({0, 0, z});
    const auto center = static_cast<std::uint32_t>(mesh.points.size() - 1), first = center - 2 * n;
    for (std::uint32_t k = 0; k < 2 * n; k++)
      mesh.triangles.push_back({first + k, first + (k + 1) % (2 * n), center});
  }
  return mesh;
}

TEST(Surface, AgreesWithBruteForceOnAStarOfNeedles) {
  const Mesh mesh = star(500);
  const Surface surface(mesh);
  RandomInput random(11);
  for (int k = 0; k < 200; k++) {
    const Point p(random.uniform(-1.1, 1.1), random.uniform(-1.1, 1.1), random.uniform(-0.1, 0.2));
    const Nearest at = surface.nearest(p);
    EXPECT_NEAR(at.distance, brute_force(mesh, p), 1e-15);
    EXPECT_NEAR(surface.distance_to(at.triangle, p), at.distance, 1e-15);
    EXPECT_TRUE(surface.any_within(p, at.distance * (1 + 1e-9) + 1e-12));
    EXPECT_FALSE(surface.any_within(p, at.distance * (1 - 1e-9) - 1e-12));
  }
}

// A rod of long triangles across the axes: each lies in many boxes of the tree, and counts once.
TEST(Surface, RaysCountEachNeedleOnce) {
  Mesh rods;
  RandomInput random(4);
  for (int k = 0; k < 8; k++) {
    Eigen::Matrix3d axes;
    axes.col(0) = random.direction(), axes.col(1) = axes.col(0).unitOrthogonal();
    axes.col(2) = axes.col(0).cross(axes.col(1));
    rods.add(shapes::moved(shapes::box({-10, -0.1, -0.1}, {10, 0.1, 0.1}), axes, Vector::Zero()));
  }
  const Surface surface(rods, SideBy::winding);
  ASSERT_GT(surface.needle_parts(), 4 * rods.triangles.size());
  for (int k = 0; k < 2000; k++) {
    const Point p = random.uniform(0, k % 2 ? 0.2 : 10) * random.direction();
    EXPECT_EQ(surface.winding_number(p).value(), std::lround(winding(rods, p)));
  }
}

TEST(Surface, NeedlesAcrossTheAxesAreCutForTheirBoxesAndNothingElseIs) {
  for (const int points : {50, 500}) {
    const Mesh mesh = star(points);
    const std::size_t parts = Surface(mesh).needle_parts(), needles = mesh.triangles.size();
    EXPECT_GT(parts, 4 * needles);
    // Across their length. Halves of halves lie beside each other, and need many more for boxes as small.
    EXPECT_LT(parts, (points == 50 ? 16 : 64) * needles);
  }
  for (const Mesh& even : {shapes::box({0, 0, 0}, {1, 2, 3}), shapes::sphere(3), shapes::square(1, 20)})
    EXPECT_EQ(Surface(even).needle_parts(), 0u);
}

TEST(Surface, NothingIsNearWhereThereIsNothing) {
  const Surface surface{Mesh()};
  EXPECT_FALSE(std::isfinite(surface.nearest({0, 0, 0}).distance));
  EXPECT_FALSE(std::isfinite(surface.signed_nearest({0, 0, 0}).distance));
  EXPECT_FALSE(surface.any_within({0, 0, 0}, 1e300));
  EXPECT_TRUE(surface.bounds().empty());
}

// A body full of acute edges, where the normal of the nearest face alone would give the wrong side.
Mesh hedgehog(RandomInput& random) {
  Mesh mesh = shapes::sphere(3);
  for (Point& p : mesh.points) p *= random.uniform(0, 1) < 0.3 ? 1 : random.uniform(0.25, 0.4);
  return mesh;
}

TEST(Surface, TheSignIsThatOfTheWindingNumber) {
  for (std::uint64_t seed = 51; seed <= 58; seed++) {
    RandomInput random(seed);
    Mesh body = seed % 4 == 0   ? shapes::box({-0.5, -0.1, -0.9}, {0.5, 0.1, 0.9}, 2)
                : seed % 4 == 1 ? shapes::torus(0.7, 0.25, 24, 12)
                : seed % 4 == 2 ? shapes::blob(random, 3)
                                : hedgehog(random);
    const Mesh mesh = shapes::moved(body, random.rotation(), Vector::Zero());
    const Surface surface(mesh);
    int inside = 0;
    for (int k = 0; k < 400; k++) {
      Point p = random.point(1.2);
      if (k % 2) {  // close to a corner or an edge, where the sign is decided by the pseudonormal
        const std::size_t t = random.below(mesh.triangles.size());
        const double s = k % 4 == 1 ? 0 : random.uniform(0, 1);
        p = (1 - s) * mesh.corner(t, 0) + s * mesh.corner(t, 1) +
            random.uniform(1e-6, 0.02) * random.direction();
      }
      const double distance = surface.signed_nearest(p).distance;
      const double turns = winding(mesh, p);
      ASSERT_NEAR(turns, std::round(turns), 1e-6);
      ASSERT_EQ(distance<0, turns> 0.5) << p.transpose() << " at " << distance;
      inside += distance < 0;
    }
    EXPECT_GT(inside, 20);
    EXPECT_LT(inside, 380);
  }
}

TEST(Surface, PseudonormalsOfABox) {
  const Surface surface(shapes::box({0, 0, 0}, {1, 1, 1}));
  const auto expect = [&](const Point& p, const Vector& normal, double distance) {
    const Nearest n = surface.signed_nearest(p);
    EXPECT_NEAR((n.normal - normal.normalized()).norm(), 0, 1e-12) << p.transpose();
    EXPECT_NEAR(n.distance, distance, 1e-12) << p.transpose();
  };
  expect({0.5, 0.3, 2}, {0, 0, 1}, 1);
  expect({2, 0.3, 2}, {1, 0, 1}, std::sqrt(2.0));
  expect({-1, -1, -1}, {-1, -1, -1}, std::sqrt(3.0));  // whatever diagonal its faces have
  expect({2, -1, 2}, {1, -1, 1}, std::sqrt(3.0));
  expect({0.5, 0.3, 0.9}, {0, 0, 1}, -0.1);
}

TEST(Surface, BelowASheetIsInside) {
  const Surface sheet(shapes::square(1, 4));
  EXPECT_NEAR(sheet.signed_nearest({0.4, 0.3, 0.25}).distance, 0.25, 1e-15);
  EXPECT_NEAR(sheet.signed_nearest({0.4, 0.3, -0.25}).distance, -0.25, 1e-15);
}

// A cube, and a fin beside it that has a thickness: the body is both together.
TEST(Surface, ABodyIsAsFarAsItsThickSheetIs) {
  const Mesh cube = shapes::box({-0.5, -0.5, -0.5}, {0.5, 0.5, 0.5});
  const Mesh fin = shapes::fin({0.5, 0.1, -0.3}, {0.9, 0.1, 0.3});
  constexpr double half = 0.15;
  Surface surface(joined(cube, fin), SideBy::winding, std::make_shared<const Surface>(cube));
  surface.set_sheet(cube.triangles.size(), 2 * half);
  RandomInput random(62);
  int nearer = 0;
  for (int k = 0; k < 20000; k++) {
    const Point p = random.point(1.2);
    const double to_cube = brute_force(cube, p), to_fin = brute_force(fin, p) - half;
    const bool in_cube = p.cwiseAbs().maxCoeff() < 0.5;
    const Nearest at = surface.signed_nearest(p);
    EXPECT_EQ(at.inside, in_cube);
    if (in_cube) {
      EXPECT_NEAR(at.distance, -std::min(to_cube, to_fin + half), 1e-12);
      // A point in both is as deep as it is in one of them.
      EXPECT_NEAR(surface.certified_distance(p), std::min(at.distance, to_fin), 1e-12);
      continue;
    }
    EXPECT_NEAR(at.distance, std::min(to_cube, to_fin), 1e-12);
    EXPECT_NEAR(surface.certified_distance(p), at.distance, 1e-15);
    const bool of_fin = to_fin < to_cube;
    EXPECT_EQ(at.triangle >= cube.triangles.size(), of_fin);
    EXPECT_NEAR((at.point - p).norm(), of_fin ? to_fin + half : to_cube, 1e-12);
    EXPECT_NEAR(at.normal.norm(), 1, 1e-12);
    nearer += of_fin && to_cube < to_fin + half;
  }
  EXPECT_GT(nearer, 100) << "where the cube is nearer than the fin's middle";
}

TEST(Surface, ManyThreadsGetTheSameAnswers) {
  RandomInput random(61);
  const Surface surface(shapes::blob(random, 4));
  std::vector<Point> points;
  for (int k = 0; k < 2000; k++) points.push_back(random.point(1.5));
  std::vector<std::vector<double>> answers(4);
  std::vector<std::thread> threads;
  for (auto& answer : answers)
    threads.emplace_back([&] {
      for (const Point& p : points) answer.push_back(surface.signed_nearest(p).distance);
    });
  for (std::thread& thread : threads) thread.join();
  for (const auto& answer : answers) EXPECT_EQ(answer, answers[0]);
}

TEST(Surface, WindingNumberIsThatOfSolidAnglesWhateverIntersects) {
  const Mesh overlapping = joined(shapes::box({0, 0, 0}, {1, 1, 1}, 3),
                                  shapes::box({0.5, 0.25, 0.25}, {1.5, 0.75, 0.75}, 2)),
             turned = turned_over(shapes::torus(1, 0.4, 12, 8)),
             nested =
                 joined(shapes::sphere(3), shapes::box({-0.2, -0.2, -0.2}, {0.3, 0.3, 0.3})),  // both outward
      mixed = joined(shapes::sphere(2), turned_over(shapes::box({0, 0, 0}, {2, 2, 2})));
  for (const Mesh& mesh : {overlapping, turned, nested, mixed}) {
    const Surface surface(mesh);
    ASSERT_TRUE(surface.closed());
    shapes::RandomInput random(3);
    std::set<int> seen;
    for (int k = 0; k < 2000; k++) {
      const Point p = random.point(2);
      const auto number = surface.winding_number(p);
      ASSERT_TRUE(number) << k;
      ASSERT_EQ(*number, std::lround(winding(mesh, p))) << k;
      seen.insert(*number);
    }
    EXPECT_GE(seen.size(), 2u);
  }
}

// Rays from points in line with edges and corners graze them. Points on a lattice of the mesh's own
// coordinates are the worst case.
TEST(Surface, TheShortestRayLeavesToTheFrontAndIsShorterThanMost) {
  const Surface surface(shapes::torus(1, 0.4, 24, 12));
  const Box& box = surface.bounds();
  RandomInput random(31);
  double shortest = 0, longest = 0;
  for (int k = 0; k < 300; k++) {
    const Vector n = 5 * random.direction(), away = random.direction().cwiseProduct(box.high - box.low);
    const Point p = 0.5 * (box.low + box.high) + random.uniform(0, 0.5) * away;
    const auto length = [&](const Vector& d) {
      double steps = std::numeric_limits<double>::infinity();
      for (int axis = 0; axis < 3; axis++)
        steps = std::min(steps, ((d[axis] > 0 ? box.high : box.low)[axis] - p[axis]) / d[axis]);
      return steps * d.norm();
    };
    const auto d = surface.shortest_ray(p, n);
    ASSERT_TRUE(d.has_value());
    EXPECT_GE(d->dot(n), Surface::kGrazing * n.norm());
    EXPECT_EQ(surface.crossings(p, *d), surface.winding_number(p));
    const double least = length(*surface.shortest_ray(p, Vector::Zero())),
                 first = length(Surface::ray_directions()[0]);
    EXPECT_LE(least, first);
    shortest += least, longest += first;
  }
  EXPECT_LT(shortest, 0.75 * longest);
}

TEST(Surface, WindingNumberOfALatticeOnTheMeshsOwnCoordinates) {
  const Surface surface(shapes::box({0, 0, 0}, {4, 4, 4}, 4));
  for (int x = -1; x <= 5; x++)
    for (int y = -1; y <= 5; y++)
      for (int z = -1; z <= 5; z++) {
        const auto in = [](int c) { return c > 0 && c < 4; };
        const auto out = [](int c) { return c < 0 || c > 4; };
        const auto winding = surface.winding_number({double(x), double(y), double(z)});
        if (out(x) || out(y) || out(z))
          EXPECT_EQ(winding, 0) << x << y << z;
        else if (in(x) && in(y) && in(z))
          EXPECT_EQ(winding, 1) << x << y << z;
        else
          EXPECT_FALSE(winding) << x << y << z;  // on the surface
      }
}

TEST(Surface, OnlyAClosedSurfaceHasAWindingNumber) {
  EXPECT_FALSE(Surface(Mesh()).winding_number({0, 0, 0}));
  const Surface sheet(shapes::square(1, 2));
  EXPECT_EQ(sheet.open_edges(), 8u);
  EXPECT_FALSE(sheet.winding_number({0.5, 0.5, 0.5}));
  Mesh box = shapes::box({0, 0, 0}, {1, 1, 1});
  std::swap(box.triangles[0][0], box.triangles[0][1]);  // one faces inward
  EXPECT_FALSE(Surface(box).closed());
}

TEST(Surface, SidesByWindingNumberAreRightWhereNormalsMislead) {
  Mesh mesh = shapes::box({0, 0, 0}, {1, 1, 1});
  mesh = joined(mesh, shapes::box({0.4, 0.4, 0.4}, {1.6, 0.6, 0.6}));
  // Inside the cube, above a face of the other solid that lies inside the cube.
  const Point p(0.7, 0.5, 0.62);
  EXPECT_GT(Surface(mesh).signed_nearest(p).distance, 0);
  EXPECT_LT(Surface(mesh, SideBy::winding).signed_nearest(p).distance, 0);
}

}  // namespace
}  // namespace padder
