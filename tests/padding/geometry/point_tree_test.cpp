// SPDX-License-Identifier: MIT
#include "padding/geometry/point_tree.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "padding/geometry/random.h"

namespace padder {
namespace {

TEST(PointTree, AgreesWithBruteForce) {
  Random random(1);
  const auto coordinate = [&] { return 2 * random.uniform() - 1; };
  for (std::size_t n : {0, 1, 8, 9, 1000}) {
    std::vector<Point> points(n);
    for (Point& p : points) p = {coordinate(), coordinate(), coordinate()};
    for (std::size_t k = 0; k < n / 4; k++) points[k] = points[n - 1];  // many alike
    const PointTree tree(points);
    for (int k = 0; k < 200; k++) {
      const Point center(coordinate(), coordinate(), coordinate());
      const double radius = k % 7 == 0 ? 4 : random.uniform();
      std::vector<std::uint32_t> found, expected;
      tree.find(center, radius, found);
      for (std::uint32_t p = 0; p < n; p++)
        if ((points[p] - center).squaredNorm() <= radius * radius) expected.push_back(p);
      std::sort(found.begin(), found.end());
      ASSERT_EQ(found, expected);
    }
  }
}

TEST(PointTree, RenumberedPointsLieInTheOrderOfTheTree) {
  Random random(1);
  for (std::size_t n : {0, 5, 1000}) {
    std::vector<Point> points(n);
    for (Point& p : points) p = {random.uniform(), random.uniform(), random.uniform()};
    PointTree tree(points);
    std::vector<std::uint32_t> before = tree.renumber(), found;
    ASSERT_EQ(before.size(), n);
    for (std::size_t k = 0; k < n; k++) EXPECT_EQ(tree.points()[k], points[before[k]]);
    tree.find(Point::Constant(0.5), 0.3, found);
    EXPECT_TRUE(std::is_sorted(found.begin(), found.end()));
    std::size_t expected = 0;
    for (const Point& p : points) expected += (p - Point::Constant(0.5)).norm() <= 0.3;
    EXPECT_EQ(found.size(), expected);
    std::sort(before.begin(), before.end());
    for (std::uint32_t k = 0; k < n; k++) EXPECT_EQ(before[k], k);
  }
}

TEST(PointTree, NegativeRadiusFindsNothing) {
  const PointTree tree({Point::Zero()});
  std::vector<std::uint32_t> found;
  tree.find(Point::Zero(), -1, found);
  EXPECT_TRUE(found.empty());
  tree.find(Point::Zero(), 0, found);
  EXPECT_EQ(found.size(), 1u);
}

TEST(PointTree, SparsePointsStandApartAndNothingIsFarFromThem) {
  Random random(2);
  std::vector<Point> points(800);
  for (Point& p : points) p = {random.uniform(), random.uniform(), random.uniform()};
  const double spacing = 0.12;
  std::vector<std::uint32_t> expected, order = random_order(points.size(), 3);
  for (const auto k : order)
    if (std::ranges::all_of(expected, [&](auto j) { return (points[j] - points[k]).norm() > spacing; }))
      expected.push_back(k);
  EXPECT_EQ(sparse(points, order, spacing), expected);
  EXPECT_LT(expected.size(), points.size() / 2);
}

}  // namespace
}  // namespace padder
