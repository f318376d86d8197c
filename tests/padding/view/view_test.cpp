// SPDX-License-Identifier: MIT
#include "padding/view/view.h"

#include <gtest/gtest.h>

#include <fstream>

#include "padding/asset/error.h"
#include "padding/input/read.h"
#include "tests/padding/balls.h"
#include "tests/padding/shapes.h"
#include "tests/temporary_folder.h"

namespace padder {
namespace {

namespace fs = std::filesystem;

Cluster three_spheres() {
  Cluster c;
  c.name = "part";
  c.family = 3;
  c.centers = {{0.5, 0.5, 0.5}, {0.2, 0.5, 0.5}, {0.5, 0.5, 0.9}};
  c.radii = {0.4, 0.3, 0.15};
  c.triangle = {7, 8, 9};
  return c;
}

class Folder : public ::testing::Test, protected TemporaryFolder {
 protected:
  Folder() { fs::create_directories(folder_ / "assets"); }

  fs::path write_box(const fs::path& name, double size) {
    std::ofstream out(folder_ / name);
    const Mesh box = shapes::box({0, 0, 0}, {size, size, size});
    for (const Point& p : box.points) out << "v " << p.x() << " " << p.y() << " " << p.z() << "\n";
    for (const auto& t : box.triangles) out << "f " << t[0] + 1 << " " << t[1] + 1 << " " << t[2] + 1 << "\n";
    return folder_ / name;
  }
  // As pad records it, with every length `scale` times that of the file.
  Cluster made_from(const fs::path& file, double scale = 1) {
    const ReadResult read = read_mesh(file);
    Cluster c = three_spheres();
    c.source = read.source;
    c.bounds = read.mesh.bounds();
    c.bounds.low *= scale, c.bounds.high *= scale;
    return c;
  }
};

TEST(View, ProtrusionIsRadiusLessTheDistanceToTheMesh) {
  const View v = view_of(three_spheres(), shapes::box({0, 0, 0}, {1, 1, 1}, 4));
  ASSERT_EQ(v.protrusion.size(), 3u);
  EXPECT_EQ(v.protrusion[0], 0);  // it stays below the surface
  EXPECT_NEAR(v.protrusion[1], 0.1, 1e-6);
  EXPECT_NEAR(v.protrusion[2], 0.05, 1e-6);
  EXPECT_EQ(v.family, std::vector<std::uint32_t>(3, 3));
}

TEST(View, ProtrusionIsNeverMoreThanTheClusterReports) {
  Cluster c = three_spheres();
  c.accuracy.protrusion_max = 0.06, c.accuracy.coverage = 1;
  const View v = view_of(c, shapes::box({0, 0, 0}, {1, 1, 1}));
  EXPECT_FLOAT_EQ(v.protrusion[1], 0.06f);
  EXPECT_NEAR(v.protrusion[2], 0.05, 1e-6);
  EXPECT_EQ(v.accuracy.size(), 1u);
}

TEST(View, TheErrorMapTellsTheGapAtEveryPointOfTheMesh) {
  Cluster c = three_spheres();
  c.centers.emplace_back(0.5, 0.5, 0.5), c.radii.push_back(0.8), c.triangle.push_back(10);
  const Mesh box = shapes::box({0, 0, 0}, {1, 1, 1});
  const View v = view_of(c, box);
  ASSERT_EQ(v.errors.gap.size(), 1u);
  const Mesh& fine = v.errors.mesh;
  ASSERT_EQ(v.errors.gap[0].size(), fine.points.size());
  const auto gap = [balls = balls_of(c)](const Point& p) { return gap_to(balls, p); };
  double area = 0, worst = 0, largest = 0;
  for (const auto& t : fine.triangles) {
    Point middle = Point::Zero();
    double between = 0;
    for (int k = 0; k < 3; k++) {
      EXPECT_NEAR(v.errors.gap[0][t[k]], gap(fine.points[t[k]]), 1e-6);
      middle += fine.points[t[k]] / 3, between += v.errors.gap[0][t[k]] / 3;
    }
    worst = std::max(worst, std::abs(between - gap(middle)));
    largest = std::max(largest, gap(middle));
    area += (fine.points[t[1]] - fine.points[t[0]]).cross(fine.points[t[2]] - fine.points[t[0]]).norm() / 2;
  }
  EXPECT_NEAR(area, 6, 1e-9);  // the same surface
  EXPECT_GT(fine.triangles.size(), 1000u);
  EXPECT_LT(worst, 0.05 * 0.3);  // of the protrusion of the large sphere
  // The corners are the points that lie farthest outside, and the large sphere is the nearest to them.
  EXPECT_NEAR(*std::max_element(v.gap.begin(), v.gap.end()), std::sqrt(0.75) - 0.8, 1e-6);
  EXPECT_EQ(v.gap[3], *std::max_element(v.gap.begin(), v.gap.end()));
  EXPECT_NEAR(range_of(v, ColourBy::gap)->high, std::sqrt(0.75) - 0.8, 1e-6);
  EXPECT_NEAR(range_of(v, ColourBy::protrusion)->high, 0.3, 1e-6);
  EXPECT_GT(largest, 0);
  EXPECT_TRUE(mesh_errors(v, ColourBy::family).empty());
}

TEST(View, EachLevelHasItsErrorMap) {
  Cluster c = three_spheres();
  c.lods.emplace_back();
  c.lods[0].centers = {{0.5, 0.5, 0.5}}, c.lods[0].radii = {0.6}, c.lods[0].triangle = {0};
  const View v = view_of(c, shapes::box({0, 0, 0}, {1, 1, 1}));
  ASSERT_EQ(v.errors.gap.size(), 2u);
  EXPECT_NEAR(v.gap[3], std::sqrt(0.75) - 0.6, 1e-6);
  const View coarse = one_rung(v, 1);
  ASSERT_EQ(coarse.errors.gap.size(), 1u);
  EXPECT_EQ(coarse.gap, std::vector<float>{v.gap[3]});
}

TEST(View, ALadderBecomesRungsFromFineToCoarse) {
  Cluster c = three_spheres();
  c.bounds = shapes::box({0, 0, 0}, {1, 1, 1}).bounds();
  const double diagonal = c.bounds.diagonal();
  c.settings =
      "{\"lod\": [" + std::to_string(0.02 * diagonal) + ", " + std::to_string(0.005 * diagonal) + "]}";
  c.lods.resize(2);  // coarsest first
  c.lods[0] = {0.02 * diagonal, 0, {}, {{0.5, 0.5, 0.5}}, {0.6}, {1}};
  c.lods[1] = {0.01 * diagonal, 0, {}, {{0.4, 0.5, 0.5}, {0.6, 0.5, 0.5}}, {0.5, 0.45}, {2, 3}};
  c.lods[0].accuracy.gap_max = 0.02, c.lods[0].accuracy.protrusion_max = 0.07;
  const View v = view_of(c, shapes::box({0, 0, 0}, {1, 1, 1}));
  ASSERT_EQ(v.rungs.size(), 3u);
  EXPECT_EQ(v.size(), 6u);
  const std::vector<std::string> names{"within 0.5 %", "within 1 %", "within 2 %"};
  for (std::size_t k = 0; k < 3; k++) EXPECT_EQ(v.rungs[k].name, names[k]);
  EXPECT_EQ(v.rungs[1].first, 3u);
  EXPECT_EQ(v.rungs[1].count, 2u);
  EXPECT_EQ(v.triangle, (std::vector<std::int64_t>{7, 8, 9, 2, 3, 1}));
  EXPECT_NEAR(v.protrusion[3], 0.1, 1e-6);
  EXPECT_FLOAT_EQ(v.protrusion[5], 0.07f);  // 0.1, but its rung reports less

  const View coarse = one_rung(v, 2);
  EXPECT_EQ(coarse.radii, std::vector<double>{0.6});
  EXPECT_EQ(coarse.family, std::vector<std::uint32_t>{3});
  EXPECT_EQ(coarse.triangle, std::vector<std::int64_t>{1});
  EXPECT_EQ(coarse.protrusion.size(), 1u);
  ASSERT_EQ(coarse.accuracy.size(), 1u);
  EXPECT_EQ(coarse.accuracy[0].gap_max, 0.02);
  EXPECT_TRUE(coarse.rungs.empty());
  EXPECT_EQ(one_rung(v, 1).radii, (std::vector<double>{0.5, 0.45}));
  EXPECT_EQ(one_rung(v, 0).radii, three_spheres().radii);
  EXPECT_THROW(one_rung(v, 3), Error);
}

TEST(View, WithoutALadderThereIsOneLevel) {
  const View v = view_of(three_spheres());
  EXPECT_TRUE(v.rungs.empty());
  EXPECT_EQ(one_rung(v, 0).radii, v.radii);
  EXPECT_THROW(one_rung(v, 1), Error);
}

TEST(View, WhatAClusterByHandLacksIsLeftOut) {
  Cluster c = three_spheres();
  c.triangle.assign(3, -1);
  const View v = view_of(c);
  EXPECT_TRUE(v.triangle.empty());
  EXPECT_TRUE(v.protrusion.empty());
  EXPECT_TRUE(v.accuracy.empty());
  EXPECT_FALSE(v.has_mesh());
  EXPECT_THROW(colours_of(v, ColourBy::triangle), Error);
  EXPECT_THROW(colours_of(v, ColourBy::protrusion), Error);
  EXPECT_THROW(colours_of(v, ColourBy::body), Error);
}

TEST(View, BoundsHoldMeshAndSpheres) {
  const View v = view_of(three_spheres(), shapes::box({0, 0, 0}, {1, 1, 1}));
  EXPECT_DOUBLE_EQ(v.bounds().low.x(), -0.1);
  EXPECT_DOUBLE_EQ(v.bounds().high.z(), 1.05);
  EXPECT_DOUBLE_EQ(v.bounds().high.y(), 1);
}

TEST(View, ColoursFollowThePalette) {
  View v = view_of(three_spheres());
  const Palette& p = palette();
  v.family = {0, 1, std::uint32_t(p.kinds.size()) + 1};
  const auto family = colours_of(v, ColourBy::family);
  EXPECT_EQ(family[0], p.none);
  EXPECT_EQ(family[1], p.kinds[0]);
  EXPECT_EQ(family[2], p.kinds[0]);
  const auto radius = colours_of(v, ColourBy::radius);
  EXPECT_EQ(radius[0], p.ramp.back());   // the largest
  EXPECT_EQ(radius[2], p.ramp.front());  // the smallest
  v.bodies = {{"a", 0, 2, 5, 0}};
  v.body = {0, 0, 1};
  const auto body = colours_of(v, ColourBy::body);
  EXPECT_EQ(body[0], p.kinds[0]);
  EXPECT_EQ(body[2], p.none);  // loose
  const auto triangle = colours_of(v, ColourBy::triangle);
  EXPECT_NE(triangle[0], triangle[1]);
}

TEST_F(Folder, TheMeshIsFoundByNameAndBytes) {
  const Cluster c = made_from(write_box("part.obj", 2));
  EXPECT_EQ(mesh_of(c, folder_ / "part.spheres.json").triangles.size(), 12u);
  EXPECT_TRUE(mesh_of(c, folder_ / "assets" / "elsewhere" / "part.spheres.json").triangles.empty());
  fs::rename(folder_ / "part.obj", folder_ / "assets" / "part.obj");
  EXPECT_EQ(mesh_of(c, folder_ / "part.spheres.json").triangles.size(), 12u);
  write_box("assets/part.obj", 2.5);
  EXPECT_TRUE(mesh_of(c, folder_ / "part.spheres.json").triangles.empty());  // another part of that name
}

TEST_F(Folder, TheMeshComesAtTheScaleOfTheCluster) {
  const fs::path file = write_box("part.obj", 2);
  const Mesh mesh = mesh_of(made_from(file, 0.001), folder_ / "part.spheres.json");
  EXPECT_NEAR(mesh.bounds().high.x(), 0.002, 1e-12);
}

TEST_F(Folder, AnotherMeshIsRefused) {
  const Cluster c = made_from(write_box("part.obj", 2));
  std::ofstream(folder_ / "other.obj") << "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  EXPECT_THROW(mesh_of(c, folder_ / "part.spheres.json", folder_ / "other.obj"), Error);
  EXPECT_THROW(mesh_of(c, folder_ / "part.spheres.json", folder_ / "absent.obj"), Error);
}

}  // namespace
}  // namespace padder
