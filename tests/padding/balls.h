// SPDX-License-Identifier: MIT
// The spheres of a cluster as balls, and their union by asking all of them, which tests compare with.
#pragma once
#include <gtest/gtest.h>
#include <algorithm>
#include <limits>
#include <vector>
#include "padding/asset/cluster.h"
#include "padding/geometry/balls.h"

namespace padder {

// Their centres are seen from `from`.
inline std::vector<Ball> balls_of(const Cluster& cluster, const Point& from = Point::Zero()) {
  std::vector<Ball> balls;
  for (std::size_t k = 0; k < cluster.size(); k++)
    balls.push_back({cluster.centers[k] - from, cluster.radii[k]});
  return balls;
}

inline void expect_same(const std::vector<Ball>& a, const std::vector<Ball>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t k = 0; k < a.size(); k++) {
    ASSERT_EQ(a[k].center, b[k].center) << k;
    ASSERT_EQ(a[k].radius, b[k].radius) << k;
  }
}

// How far a point is from the union; below 0 inside.
inline double gap_to(const std::vector<Ball>& balls, const Point& x) {
  double least = std::numeric_limits<double>::infinity();
  for (const Ball& ball : balls) least = std::min(least, gap_to(ball, x));
  return least;
}

}  // namespace padder
