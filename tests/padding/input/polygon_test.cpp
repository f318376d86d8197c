// SPDX-License-Identifier: MIT
#include "padding/input/polygon.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <ctime>
#include <map>
#include <random>
#include "tests/padding/shapes.h"

namespace padder {
namespace {

using Triangles = std::vector<std::array<std::uint32_t, 3>>;

Vector area_vector(const std::vector<Point>& polygon) {
  Vector sum = Vector::Zero();
  for (std::size_t k = 1; k + 1 < polygon.size(); k++)
    sum += 0.5 * (polygon[k] - polygon[0]).cross(polygon[k + 1] - polygon[0]);
  return sum;
}

// A flat simple polygon is filled when there are n - 2 triangles, all with its orientation, whose areas add
// up to its own. Each edge of the polygon is used once in its direction, each diagonal once in both.
void expect_filling(const std::vector<Point>& polygon) {
  Triangles triangles;
  triangulate_polygon(polygon, triangles);
  ASSERT_EQ(triangles.size(), polygon.size() - 2);
  const Vector whole = area_vector(polygon);
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  double sum = 0;
  for (const auto& t : triangles) {
    const Vector a = 0.5 * (polygon[t[1]] - polygon[t[0]]).cross(polygon[t[2]] - polygon[t[0]]);
    EXPECT_GE(a.dot(whole), 0);
    sum += a.norm();
    for (int k = 0; k < 3; k++) edges[{t[k], t[(k + 1) % 3]}]++;
  }
  EXPECT_NEAR(sum, whole.norm(), 1e-9 * whole.norm());
  const std::uint32_t n = static_cast<std::uint32_t>(polygon.size());
  for (const auto& [edge, count] : edges) {
    EXPECT_EQ(count, 1);
    const bool side = edge.second == (edge.first + 1) % n;
    EXPECT_EQ(edges.count({edge.second, edge.first}), side ? 0u : 1u);
  }
  for (std::uint32_t k = 0; k < n; k++) EXPECT_EQ(edges.count({k, (k + 1) % n}), 1u);
}

std::vector<Point> flat(const std::vector<std::array<double, 2>>& corners) {
  std::vector<Point> polygon;
  for (const auto& c : corners) polygon.emplace_back(c[0], c[1], 0);
  return polygon;
}

TEST(Polygon, ConcaveOnesAreFilledFromAnyCornerAndSide) {
  const std::vector<std::vector<std::array<double, 2>>> shapes = {
      {{0, 0}, {2, 0}, {2, 1}, {1, 1}, {1, 2}, {0, 2}},
      {{0, 0}, {4, 0}, {4, 3}, {3, 3}, {3, 1}, {1, 1}, {1, 3}, {0, 3}},
      {{0, 0}, {3, 0}, {0.5, 0.5}, {0, 3}}};  // a quad that only one diagonal fills
  for (const auto& shape : shapes)
    for (std::size_t first = 0; first < shape.size(); first++) {
      auto turned = shape;
      std::rotate(turned.begin(), turned.begin() + static_cast<std::ptrdiff_t>(first), turned.end());
      expect_filling(flat(turned));
      std::reverse(turned.begin(), turned.end());
      expect_filling(flat(turned));
    }
}

TEST(Polygon, RandomStarsInRandomPlanes) {
  for (unsigned seed = 1; seed <= 60; seed++) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> radius(0.1, 1), angle(-3, 3);
    const int n = 4 + static_cast<int>(seed) * 3;
    const Eigen::Matrix3d turn = (Eigen::AngleAxisd(angle(random), Vector::UnitX()) *
                                  Eigen::AngleAxisd(angle(random), Vector::UnitY()))
                                     .toRotationMatrix();
    std::vector<Point> star;
    for (int k = 0; k < n; k++)
      star.push_back(turn * shapes::on_circle(k, n, radius(random)) + Point(3, 4, 5));
    expect_filling(star);
  }
}

TEST(Polygon, CollinearCornersGiveNoFlatTriangleWhereOneCanBeHad) {
  const std::vector<Point> square = flat({{0, 0}, {1, 0}, {2, 0}, {2, 2}, {1, 2}, {0, 2}});
  Triangles triangles;
  triangulate_polygon(square, triangles);
  ASSERT_EQ(triangles.size(), 4u);
  for (const auto& t : triangles)
    EXPECT_GT((square[t[1]] - square[t[0]]).cross(square[t[2]] - square[t[0]]).norm(), 0.5);
}

TEST(Polygon, QuadIsCutWhereTheWorseAngleIsLarger) {
  Triangles triangles;
  triangulate_polygon(flat({{0, 0}, {2, -0.3}, {4, 0}, {2, 0.3}}), triangles);
  ASSERT_EQ(triangles.size(), 2u);
  for (const auto& t : triangles) {  // along the short diagonal 1-3
    EXPECT_TRUE(std::ranges::find(t, 1u) != t.end());
    EXPECT_TRUE(std::ranges::find(t, 3u) != t.end());
  }
}

TEST(Polygon, RingCutOpenByABridgeIsFilled) {  // two corners at one place, twice
  const std::vector<Point> ring =
      flat({{0, 0}, {4, 0}, {4, 4}, {0, 4}, {0, 0}, {1, 1}, {1, 3}, {3, 3}, {3, 1}, {1, 1}});
  Triangles triangles;
  triangulate_polygon(ring, triangles);
  ASSERT_EQ(triangles.size(), 8u);
  double sum = 0;
  for (const auto& t : triangles)
    sum += 0.5 * (ring[t[1]] - ring[t[0]]).cross(ring[t[2]] - ring[t[0]]).norm();
  EXPECT_NEAR(sum, 12, 1e-12);
}

TEST(Polygon, WithoutAreaOrCrossingItselfItStillEnds) {
  for (const auto& polygon : {flat({{0, 0}, {1, 0}, {2, 0}, {3, 0}, {1, 0}}),
                              flat({{0, 0}, {1, 1}, {1, 0}, {0, 1}}), flat({{0, 0}, {0, 0}, {0, 0}, {0, 0}}),
                              flat({{0, 0}, {2, 1}, {0, 1}, {2, 0}, {1, 2}, {1, -1}, {-1, 0.5}})}) {
    Triangles triangles;
    triangulate_polygon(polygon, triangles);
    EXPECT_EQ(triangles.size(), polygon.size() - 2);
  }
}

TEST(Polygon, ManyCorners) {
  std::vector<Point> circle, comb;
  for (int k = 0; k < 100000; k++) circle.push_back(shapes::on_circle(k, 100000, 1, 1));
  Triangles triangles;
  triangulate_polygon(circle, triangles);
  EXPECT_EQ(triangles.size(), circle.size() - 2);
  for (int k = 0; k < 500; k++) comb.emplace_back(k, k % 2 ? 5 : 0.5, 0);
  comb.emplace_back(499, -1, 0), comb.emplace_back(0, -1, 0);
  std::reverse(comb.begin(), comb.end());
  expect_filling(comb);
}

// With a look at all of them for each ear it took more than 40 s.
TEST(Polygon, HalfOfManyCornersMayBeReflex) {
  std::vector<Point> star;
  for (int k = 0; k < 100000; k++) star.push_back(shapes::on_circle(k, 100000, k % 2 ? 1 : 0.5));
  const std::clock_t began = std::clock();  // of this process: other programs may be at work
  Triangles triangles;
  triangulate_polygon(star, triangles);
  EXPECT_EQ(triangles.size(), star.size() - 2);
  EXPECT_LT(double(std::clock() - began) / CLOCKS_PER_SEC, 10);
}

}  // namespace
}  // namespace padder
