// SPDX-License-Identifier: MIT
// The cut: boxes cover space without overlap, and share the weight evenly.
#include "detect/boxes/cut.h"
#include "padding/asset/error.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "tests/detect/random.h"

namespace padder::detect {
namespace {

std::vector<WeightedPoint> cloud(std::size_t n, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<WeightedPoint> points;
  for (std::size_t k = 0; k < n; k++)
    points.push_back({{3 * unit(random), unit(random), unit(random)}, 1 + unit(random)});
  return points;
}

bool holds(const Region& r, const double (&at)[3]) { return owns(r, Midpoint{at[0], at[1], at[2]}); }

TEST(BoxCut, EveryPointOfSpaceLiesInExactlyOneBox) {
  std::mt19937_64 random(4711);
  for (const std::uint32_t boxes : {1u, 2u, 3u, 7u, 64u, 100u}) {
    const std::vector<WeightedPoint> points = cloud(1000, 4711 + boxes);
    const BoxTree tree = cut_space(points, boxes);
    ASSERT_EQ(tree.boxes(), boxes);
    std::vector<double> faces = {-1e100, 1e100, 0, -1e-300};
    for (std::uint32_t b = 0; b < boxes; b++)
      for (int a = 0; a < 3; a++)
        for (const double f : {tree.region(b).low[a], tree.region(b).high[a]})
          if (std::isfinite(f))
            faces.insert(faces.end(), {f, std::nextafter(f, -1e9), std::nextafter(f, 1e9)});
    for (int trial = 0; trial < 3000; trial++) {
      double at[3];
      for (double& c : at) c = faces[random() % faces.size()];
      std::uint32_t owners = 0, owner = 0;
      for (std::uint32_t b = 0; b < boxes; b++)
        if (holds(tree.region(b), at)) owners++, owner = b;
      ASSERT_EQ(owners, 1u);
      ASSERT_EQ(tree.box_of(at), owner);
    }
  }
}

TEST(BoxCut, BoundsMeetExactlyTheBoxesThatShareAPointWithThem) {
  std::mt19937_64 random(815);
  std::uniform_real_distribution<double> unit(-0.2, 1.2), size(0, 0.3);
  const BoxTree tree = cut_space(cloud(5000, 815), 37);
  for (int trial = 0; trial < 2000; trial++) {
    Bounds bounds;
    for (int a = 0; a < 3; a++)
      bounds.low[a] = (a ? 1 : 3) * unit(random), bounds.high[a] = bounds.low[a] + size(random);
    if (trial % 3 == 0) bounds.high[1] = tree.region(trial % 37).low[1];  // touches a face from below
    std::set<std::uint32_t> wanted;
    for (std::uint32_t b = 0; b < tree.boxes(); b++) {
      bool meets = true;
      for (int a = 0; a < 3; a++)
        meets &= bounds.low[a] <= bounds.high[a] && bounds.low[a] < tree.region(b).high[a] &&
                 bounds.high[a] >= tree.region(b).low[a];
      if (meets) wanted.insert(b);
    }
    std::vector<std::uint32_t> found;
    tree.each_box(bounds, [&](std::uint32_t b) { found.push_back(b); });
    ASSERT_TRUE(std::is_sorted(found.begin(), found.end()));
    if (bounds.low[1] <= bounds.high[1]) {
      ASSERT_EQ(std::vector<std::uint32_t>(wanted.begin(), wanted.end()), found);
    }
  }
}

TEST(BoxCut, WeightIsSharedEvenly) {
  for (const std::uint32_t boxes : {2u, 3u, 8u, 13u}) {
    const std::vector<WeightedPoint> points = cloud(20000, boxes);
    const BoxTree tree = cut_space(points, boxes);
    std::vector<double> weight(boxes, 0);
    double sum = 0;
    for (const WeightedPoint& p : points) weight[tree.box_of(p.at)] += p.weight, sum += p.weight;
    for (const double w : weight) EXPECT_NEAR(w / sum * boxes, 1, 0.01) << boxes;
  }
}

TEST(BoxCut, TheResultDoesNotDependOnTheThreads) {
  const std::vector<WeightedPoint> points = cloud(50000, 99);
  const BoxTree one = cut_space(points, 50), four = cut_space(points, 50, {}, 4);
  for (std::uint32_t b = 0; b < 50; b++) EXPECT_EQ(one.region(b), four.region(b));
}

TEST(BoxCut, AGrainFarAwayDoesNotTurnBoxesIntoSlabs) {
  std::vector<WeightedPoint> points = cloud(10000, 5);
  for (WeightedPoint& p : points) p.at[0] /= 3;
  points.push_back({{0, 0, 1e30}, 1});
  const BoxTree tree = cut_space(points, 8);
  int finite_x = 0, finite_y = 0, finite_z = 0;
  for (std::uint32_t b = 0; b < 8; b++) {
    const auto cuts = [&](int a) {
      return std::isfinite(tree.region(b).low[a]) || std::isfinite(tree.region(b).high[a]);
    };
    finite_x += cuts(0), finite_y += cuts(1), finite_z += cuts(2);
  }
  EXPECT_EQ(finite_x, 8);
  EXPECT_EQ(finite_y, 8);
  EXPECT_EQ(finite_z, 8);
}

TEST(BoxCut, PointsThatCannotBeSeparatedLeaveBoxesEmpty) {
  const std::vector<WeightedPoint> same(100, {{1, 2, 3}, 1});
  for (const std::uint32_t boxes : {2u, 5u, 16u}) {
    const BoxTree tree = cut_space(same, boxes);
    EXPECT_EQ(tree.boxes(), boxes);
    std::uint32_t owners = 0;
    for (std::uint32_t b = 0; b < boxes; b++) owners += holds(tree.region(b), same[0].at);
    EXPECT_EQ(owners, 1u);
  }
  EXPECT_EQ(cut_space({}, 7).boxes(), 7u);
  EXPECT_EQ(cut_space({}, 0).boxes(), 1u);
}

TEST(BoxCut, OnlyTheGivenRegionIsCut) {
  Region whole;
  whole.low[0] = 1, whole.high[1] = 0.5;
  const BoxTree tree = cut_space(cloud(1000, 6), 4, whole);
  for (std::uint32_t b = 0; b < 4; b++) {
    EXPECT_GE(tree.region(b).low[0], 1);
    EXPECT_LE(tree.region(b).high[1], 0.5);
  }
}

// A tree made of nothing but the boxes of another one has the same boxes, and sends points to the same ones.
TEST(BoxCut, ATreeIsFoundFromItsBoxes) {
  for (const std::uint32_t boxes : {1u, 2u, 3u, 7u, 64u, 1000u}) {
    const std::vector<WeightedPoint> points = cloud(20000, boxes);
    const BoxTree tree = cut_space(points, boxes);
    std::vector<Region> regions;
    for (std::uint32_t b = 0; b < boxes; b++) regions.push_back(tree.region(b));
    const BoxTree found = tree_of(regions);
    ASSERT_EQ(found.boxes(), boxes);
    for (std::uint32_t b = 0; b < boxes; b++)
      EXPECT_EQ(found.region(b), tree.region(b)) << b << " of " << boxes;
    for (const WeightedPoint& p : points) ASSERT_EQ(found.box_of(p.at), tree.box_of(p.at));
  }
}

// Whatever boxes are given, those of the tree leave no gap: empty ones, and ones that overlap a little.
TEST(BoxCut, ATreeOfBoxesThatDoNotFitCoversSpaceAllTheSame) {
  std::vector<Region> regions(3);
  regions[0].high[0] = regions[1].low[0] = regions[1].high[0] = regions[2].low[0] = 1;
  const BoxTree empty = tree_of(regions);
  std::uint32_t owners = 0;
  for (std::uint32_t b = 0; b < 3; b++) owners += holds(empty.region(b), {1, 0, 0});
  EXPECT_EQ(owners, 1u);
  regions = std::vector<Region>(2);
  regions[0].high[0] = 1, regions[1].low[0] = 1.5;
  const BoxTree gap = tree_of(regions);
  EXPECT_EQ(gap.region(0).high[0], gap.region(1).low[0]);
  regions[1].low[0] = 0.5;
  EXPECT_THROW(tree_of(regions), Error);
}

}  // namespace
}  // namespace padder::detect
