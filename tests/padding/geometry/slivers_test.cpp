// SPDX-License-Identifier: MIT
#include "padding/geometry/slivers.h"

#include <gtest/gtest.h>

#include <map>

#include "padding/geometry/surface.h"
#include "tests/padding/random_input.h"

namespace padder {
namespace {

using shapes::closed_manifold;

// Each edge runs as often from the smaller index to the larger as back.
bool closes(const Mesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> sum;
  for (const auto& t : mesh.triangles)
    for (int k = 0; k < 3; k++) {
      const auto u = t[k], v = t[(k + 1) % 3];
      sum[std::minmax(u, v)] += u < v ? 1 : -1;
    }
  return std::all_of(sum.begin(), sum.end(), [](const auto& e) { return e.second == 0; });
}

// The number of triangles whose height is less.
std::size_t flatter_than(const Mesh& mesh, double height) {
  std::size_t flat = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); t++) {
    double longest = 0;
    for (int k = 0; k < 3; k++)
      longest = std::max(longest, (mesh.corner(t, k) - mesh.corner(t, (k + 1) % 3)).norm());
    flat += 2 * mesh.area_normal(t).norm() < height * longest;
  }
  return flat;
}

// Splits a triangle at the point into three.
void split(Mesh& mesh, std::size_t t, const Point& p) {
  const auto [a, b, c] = mesh.triangles[t];
  const auto v = static_cast<std::uint32_t>(mesh.points.size());
  mesh.points.push_back(p);
  mesh.triangles[t] = {a, b, v};
  mesh.triangles.push_back({b, c, v}), mesh.triangles.push_back({c, a, v});
}

TEST(Slivers, PointsThatWereSetCloseBesideEdgesAndCornersGoAway) {
  for (std::uint64_t seed = 1; seed <= 10; seed++) {
    shapes::RandomInput random(seed);
    const Mesh before = shapes::blob(random, 3);
    Mesh cut = before;
    constexpr double near = 1e-3;
    for (int n = 0; n < 400; n++) {
      const auto t = static_cast<std::size_t>(random.uniform(0, double(cut.triangles.size())));
      const int k = static_cast<int>(random.uniform(0, 3));
      const Point a = cut.corner(t, k), b = cut.corner(t, (k + 1) % 3), c = cut.corner(t, (k + 2) % 3);
      const double inward = std::pow(10, random.uniform(-14, -3.5));
      const double along = random.uniform(0, 1) < 0.3 ? inward : random.uniform(0.1, 0.9);
      split(cut, t, a + along * (b - a) + inward * (c - a));
    }
    ASSERT_GT(flatter_than(cut, near), 200u);
    ASSERT_TRUE(closes(cut));
    const Mesh after = without_slivers(cut, near);
    EXPECT_TRUE(closes(after));
    EXPECT_LE(flatter_than(after, near), 2u);
    EXPECT_NEAR(mass_properties(after).volume, mass_properties(before).volume, 1e-3);
    const Surface surface(before), back(after);
    for (const Point& p : after.points) EXPECT_LT(surface.nearest(p).distance, 4 * near);
    for (const Point& p : before.points) EXPECT_LT(back.nearest(p).distance, 4 * near);
  }
}

TEST(Slivers, WhatIsThickEnoughStaysAsItIs) {
  const Mesh mesh = shapes::sphere(3), after = without_slivers(mesh, 1e-3);
  ASSERT_EQ(after.triangles.size(), mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); t++)
    for (int k = 0; k < 3; k++) EXPECT_EQ(after.corner(t, k), mesh.corner(t, k));
}

TEST(Slivers, TwoLayersThatFaceApartCancel) {
  // A tetrahedron with a fin of two layers whose apexes are nearly one point.
  Mesh mesh = shapes::box({0, 0, 0}, {1, 1, 1});
  const auto n = static_cast<std::uint32_t>(mesh.points.size());
  mesh.points.insert(mesh.points.end(), {{2, 0, 0}, {3, 0, 0}, {2.5, 1, 0}, {2.5, 1, 1e-6}});
  mesh.triangles.insert(mesh.triangles.end(),
                        {{n, n + 1, n + 3}, {n + 1, n, n + 2}, {n + 1, n + 2, n + 3}, {n + 2, n, n + 3}});
  ASSERT_TRUE(closes(mesh));
  const Mesh after = without_slivers(mesh, 1e-3);
  EXPECT_EQ(after.triangles.size(), 12u);
  EXPECT_TRUE(closed_manifold(after));
}

// A box with the points of `mesh` used again where they are the same.
void add_box(Mesh& mesh, const Point& low, const Point& high) {
  const Mesh box = shapes::box(low, high);
  std::vector<std::uint32_t> index;
  for (const Point& p : box.points) {
    const auto found = std::find(mesh.points.begin(), mesh.points.end(), p);
    index.push_back(static_cast<std::uint32_t>(found - mesh.points.begin()));
    if (found == mesh.points.end()) mesh.points.push_back(p);
  }
  for (const auto& [a, b, c] : box.triangles) mesh.triangles.push_back({index[a], index[b], index[c]});
}

TEST(Slivers, CubesThatShareAnEdgeOrACornerAreTakenApart) {
  for (const Point& low : {Point(1, 1, 0), Point(1, 1, 1)}) {
    Mesh mesh;
    add_box(mesh, {0, 0, 0}, {1, 1, 1});
    add_box(mesh, low, low + Vector(1, 1, 1));
    EXPECT_LT(mesh.points.size(), 16u);
    const Mesh apart = taken_apart(mesh);
    EXPECT_EQ(apart.points.size(), 16u);
    EXPECT_TRUE(closed_manifold(apart));
    for (std::size_t t = 0; t < mesh.triangles.size(); t++)  // the cubes share no point any more
      for (const auto v : apart.triangles[t]) EXPECT_EQ(v < 8, t < 12);
  }
}

TEST(Slivers, ASheetOnACubeGetsABorderAndTheCubeStaysClosed) {
  Mesh mesh;
  add_box(mesh, {0, 0, 0}, {1, 1, 1});
  const auto at = [&](const Point& p) {
    return static_cast<std::uint32_t>(std::find(mesh.points.begin(), mesh.points.end(), p) -
                                      mesh.points.begin());
  };
  mesh.points.push_back({2, 0.5, 2});
  mesh.triangles.push_back({at({1, 0, 1}), 8, at({1, 1, 1})});
  Mesh apart = taken_apart(mesh);
  EXPECT_EQ(apart.points.size(), 11u);
  apart.triangles.pop_back();
  EXPECT_TRUE(closed_manifold(apart));
}

TEST(Slivers, AFanIsThinnedWhereNoPlaneMoves) {
  const Mesh fan = shapes::cone(5000), thin = with_thinned_fans(fan, 0.02, 1e-4);
  EXPECT_TRUE(closed_manifold(thin));
  EXPECT_LT(thin.triangles.size(), 2000u);  // edges of 0.01 would leave 1,257
  EXPECT_NEAR(mass_properties(thin).volume, mass_properties(fan).volume, 1e-3);
  const Surface surface(thin);
  for (const Point& p : fan.points) EXPECT_LT(surface.nearest(p).distance, 2e-4);
}

TEST(Slivers, AFanStaysWherePlanesWouldMoveOrTrianglesAreFew) {
  const Mesh bent = shapes::cone(5000, 0.01);
  EXPECT_GT(with_thinned_fans(bent, 0.02, 1e-4).triangles.size(), 4900u);
  const Mesh few = shapes::cone(400);
  EXPECT_EQ(with_thinned_fans(few, 1, 1).triangles, few.triangles);
}

TEST(Slivers, StripsOfAPlateAreMergedWhereNoPlaneMoves) {
  const Mesh plate = shapes::strips(1000, 1e-4, 0.02), thin = with_short_edges_merged(plate, 0.005, 1e-4);
  EXPECT_TRUE(closed_manifold(thin));
  EXPECT_LT(thin.triangles.size(), 500u);  // of 8,004; edges of 0.0025 would leave 324
  EXPECT_NEAR(mass_properties(thin).volume, 0.002, 1e-12);
}

TEST(Slivers, ANeedleThatIsThinnerThanAllPlanesMayMoveStays) {
  const Mesh needle{{{0, 0, 0}, {1, 0, 0}, {0, 1e-4, 0}, {0, 0, 1e-4}},
                    {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}};
  const Mesh thin = with_short_edges_merged(needle, 0.005, 4e-4);
  EXPECT_TRUE(closed_manifold(thin));
  EXPECT_EQ(thin.triangles.size(), 4u);
}

}  // namespace
}  // namespace padder
