// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/meshing/remesh.h"

#include <gtest/gtest.h>

#include "padding/asset/error.h"
#include "padding/geometry/surface.h"
#include "padding/meshing/repair.h"
#include "tests/padding/random_input.h"

namespace padder {
namespace {

using shapes::closed_manifold, shapes::volume;

long euler(const Mesh& mesh) { return long(mesh.points.size()) - long(mesh.triangles.size()) / 2; }

TEST(Remesh, CubeKeepsItsEdgesItsVolumeAndIsDelaunay) {
  const Mesh cube = shapes::box({0, 0, 0}, {1, 1, 1});
  const Remeshed r = remesh(cube, {.edge_length = 0.1});
  EXPECT_TRUE(closed_manifold(r.mesh));
  EXPECT_NEAR(mass_properties(r.mesh).volume, 1, 1e-9);  // nothing cut off at edges and corners
  EXPECT_EQ(r.quality.share_non_delaunay, 0);
  EXPECT_GT(r.quality.min_angle_deg, 20);
  EXPECT_GT(r.quality.sharp_edges, 80u);
  EXPECT_LE(r.quality.circumradius_max, 0.1);
}

TEST(Remesh, SphereAndTorusKeepTheirTopologyAndShape) {
  for (const auto& [mesh, genus_euler] :
       {std::pair{shapes::sphere(5), 2l}, {shapes::torus(1, 0.3, 60, 20), 0l}}) {
    const Remeshed r = remesh(mesh, {.edge_length = 0.12});
    EXPECT_TRUE(closed_manifold(r.mesh));
    EXPECT_EQ(euler(r.mesh), genus_euler);
    EXPECT_NEAR(volume(r.mesh), volume(mesh), 0.02 * volume(mesh));
    EXPECT_LT(r.quality.share_non_delaunay, 1e-3);
    EXPECT_LT(r.quality.share_under_20_deg, 1e-3);
    const Surface surface(mesh);
    for (const Point& p : r.mesh.points) EXPECT_LT(surface.nearest(p).distance, 1e-3);
  }
}

TEST(Remesh, APlateOfOneInAThousandYieldsNoRunawayCircle) {
  const Mesh plate = shapes::box({0, 0, 0}, {1, 1, 0.001});
  const Remeshed r = remesh(plate, {.edge_length = 0.03});
  EXPECT_TRUE(closed_manifold(r.mesh));
  EXPECT_LE(r.quality.circumradius_max, 0.03);
  EXPECT_NEAR(mass_properties(r.mesh).volume, 0.001, 1e-9);
}

// A remesher that splits all of these strips takes minutes.
TEST(Remesh, APlateOfThousandsOfStripsIsAPlate) {
  const Remeshed r = remesh(shapes::strips(4000, 1e-4, 0.02), {.edge_length = 0.02});
  EXPECT_TRUE(closed_manifold(r.mesh));
  EXPECT_NEAR(mass_properties(r.mesh).volume, 0.008, 1e-9);
  EXPECT_LE(r.quality.circumradius_max, 0.02);
  EXPECT_LT(r.quality.share_under_20_deg, 0.01);
}

TEST(Remesh, BorderIsKept) {
  const Remeshed r = remesh(shapes::square(1), {.edge_length = 0.1});
  EXPECT_NEAR(r.mesh.area(), 1, 1e-9);
}

TEST(Remesh, RandomBlobsStayClosedAndDelaunay) {
  for (std::uint64_t seed = 1; seed <= 5; seed++) {
    shapes::RandomInput random(seed);
    const Mesh mesh = shapes::blob(random);
    const Remeshed r = remesh(mesh, {.edge_length = random.uniform(0.05, 0.3)});
    EXPECT_TRUE(closed_manifold(r.mesh));
    EXPECT_LT(r.quality.share_non_delaunay, 0.005);
    EXPECT_LT(r.quality.share_under_20_deg, 0.02);
  }
}

TEST(Remesh, CrossingBoxesThatWereCutBesideTheirEdgesHaveNoSlivers) {
  for (std::uint64_t seed = 1; seed <= 5; seed++) {
    shapes::RandomInput random(seed);
    Mesh soup = shapes::box({0, 0, 0}, {1, 1, 1});
    const auto noise = [&] { return random.uniform(-1e-4, 1e-4); };
    for (int n = 1; n <= 3; n++) {  // walls that all but coincide
      const Point low(noise(), 0.15 * n + noise(), noise());
      soup.add(shapes::box(low, low + Vector(1 + 0.15 * n, 0.7, 1 + noise())));
    }
    const Repaired body = repair(soup, {}, "boxes");
    ASSERT_TRUE(body.solid);
    const Remeshed r = remesh(body.mesh, {.edge_length = 0.1, .slivers = 0.02});
    EXPECT_LT(r.quality.share_under_20_deg, 0.02);
    EXPECT_LT(r.quality.circumradius_max, 0.2);
    EXPECT_LT(r.mesh.triangles.size(), 2400u);
    EXPECT_NEAR(mass_properties(r.mesh).volume, mass_properties(body.mesh).volume, 0.01);
  }
}

TEST(Remesh, ShortEdgesOfAFeatureDoNotMakeThinTriangles) {
  // A plate whose rim has far more points than the edge length asks for.
  Mesh plate;
  constexpr std::uint32_t n = 48;
  for (std::uint32_t k = 0; k < 2 * n; k++)
    plate.points.push_back(shapes::on_circle(k, n, 1, k < n ? 0.0 : 0.3));
  plate.points.push_back({0, 0, 0}), plate.points.push_back({0, 0, 0.3});
  for (std::uint32_t k = 0; k < n; k++) {
    const std::uint32_t l = (k + 1) % n;
    plate.triangles.insert(plate.triangles.end(),
                           {{k, l, l + n}, {k, l + n, k + n}, {l, k, 2 * n}, {k + n, l + n, 2 * n + 1}});
  }
  const Remeshed r = remesh(plate, {.edge_length = 0.3});
  EXPECT_TRUE(closed_manifold(r.mesh));
  EXPECT_LT(r.quality.share_under_20_deg, 0.02);
  EXPECT_NEAR(mass_properties(r.mesh).volume, mass_properties(plate).volume, 0.03);
}

// A square plate with a hole of 64 corners. Edges of half of its thickness are a little shorter than 4/3 of
// the length, so that CGAL does not split them.
TEST(Remesh, TheWallOfAHoleHasNoThinTriangles) {
  Mesh plate;
  constexpr std::uint32_t n = 64;
  for (const double z : {0.0, 0.53}) {
    for (std::uint32_t k = 0; k < n; k++) plate.points.push_back(shapes::on_circle(k + 0.5, n, 0.5, z));
    plate.points.insert(plate.points.end(), {{1, 1, z}, {-1, 1, z}, {-1, -1, z}, {1, -1, z}});
  }
  constexpr std::uint32_t top = n + 4;
  const auto both_sides = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    plate.triangles.push_back({a + top, b + top, c + top}), plate.triangles.push_back({a, c, b});
  };
  const auto wall = [&](std::uint32_t a, std::uint32_t b) {
    shapes::add_quad(plate, a, b, b + top, a + top);
  };
  for (std::uint32_t k = 0; k < n; k++) {
    const std::uint32_t next = (k + 1) % n, corner = n + 4 * k / n, next_corner = n + 4 * next / n;
    both_sides(k, corner, next), wall(next, k);
    if (corner != next_corner) both_sides(next, corner, next_corner), wall(corner, next_corner);
  }
  const Remeshed r = remesh(plate, {.edge_length = 0.2});
  EXPECT_TRUE(closed_manifold(r.mesh));
  EXPECT_LT(r.quality.angles_under_20_deg, 0.002);
  EXPECT_NEAR(mass_properties(r.mesh).volume, mass_properties(plate).volume, 0.01);
}

// Of the strip between the sharp lines of a thin plate, no triangle is free; of a plate without sharp edges,
// all.
TEST(Remesh, SmallAnglesBetweenFeaturesAreNotFree) {
  Mesh box = shapes::box({0, 0, 0}, {1, 1, 0.1});
  const RemeshQuality sharp = measure_quality(box, 40), smooth = measure_quality(box, 180);
  EXPECT_NEAR(sharp.angles_under_20_deg, 8.0 / 36, 1e-12);
  EXPECT_EQ(sharp.free_angles_under_20_deg, 0);
  EXPECT_EQ(smooth.free_angles_under_20_deg, smooth.angles_under_20_deg);
}

TEST(Remesh, QualityOfOneKnownMesh) {
  // Two triangles on a flat rhombus, cut along its long diagonal. The Delaunay edge would be the short one.
  const Mesh mesh{{{-2, 0, 0}, {2, 0, 0}, {0, 1, 0}, {0, -1, 0}}, {{0, 1, 2}, {1, 0, 3}}};
  const RemeshQuality q = measure_quality(mesh, 40);
  EXPECT_EQ(q.share_non_delaunay, 1);
  EXPECT_NEAR(q.min_angle_deg, std::atan(0.5) * 180 / std::numbers::pi, 1e-9);
  EXPECT_EQ(q.sharp_edges, 0u);
}

TEST(Remesh, RefusesAnEdgeLengthThatIsNotPositiveOrTooShort) {
  EXPECT_THROW(remesh(shapes::sphere(1), {.edge_length = 0}), Error);
  EXPECT_THROW(remesh(shapes::sphere(1), {.edge_length = 1e-6}), Error);
}

// In a terrain, a triangle whose side is cut by its neighbour's corner, and the triangle without area between
// the two, which only sharp edges join to others: CGAL's remesher does not know such a part.
TEST(Remesh, APartWithoutAreaBetweenSharpEdges) {
  for (std::uint64_t seed = 1; seed <= 20; seed++) {
    shapes::RandomInput random(seed);
    Mesh terrain = shapes::square(1, 20);
    for (Point& p : terrain.points) p.z() = seed % 2 * random.uniform(0, 0.01);
    for (int cuts = 0; cuts < 12; cuts++) {
      const auto t = static_cast<std::size_t>(random.uniform(100, 700));
      const auto [a, b, c] = terrain.triangles[t];
      const auto middle = static_cast<std::uint32_t>(terrain.points.size());
      terrain.points.push_back(0.5 * (terrain.points[a] + terrain.points[b]));
      terrain.triangles[t] = {a, middle, c};
      terrain.triangles.insert(terrain.triangles.end(), {{middle, b, c}, {a, b, middle}});
    }
    EXPECT_NEAR(remesh(terrain, {.edge_length = random.uniform(0.1, 0.4)}).mesh.area(), 1, 0.3);
  }
}

TEST(Remesh, AboutAsManyTrianglesAsExpected) {
  for (const double edge : {0.05, 0.1}) {
    const Mesh cube = shapes::box({0, 0, 0}, {1, 1, 1});
    const auto made = static_cast<double>(remesh(cube, {.edge_length = edge}).mesh.triangles.size());
    const auto expected = static_cast<double>(expected_triangles(cube, edge));
    EXPECT_GT(made, expected / 1.5) << edge;
    EXPECT_LT(made, expected * 1.5) << edge;
  }
}

}  // namespace
}  // namespace padder
