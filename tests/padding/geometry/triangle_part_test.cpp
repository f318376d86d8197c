// SPDX-License-Identifier: MIT
#include "padding/geometry/triangle_part.h"

#include <gtest/gtest.h>

namespace padder {
namespace {

struct Tagged : TrianglePart {
  double tag = 0;
};

TEST(TrianglePart, IsCutAcrossItsLongestEdge) {
  const Tagged part{{{Point(0, 0, 0), Point(4, 0, 0), Point(1, 1, 0)}, 7}, 0.5};
  EXPECT_EQ(part.longest_edge().second, 0);
  EXPECT_EQ(part.size(), 4);
  const auto halves = bisect(part);
  EXPECT_EQ(halves[0].corner[1], Point(2, 0, 0));
  EXPECT_EQ(halves[1].corner[0], Point(2, 0, 0));
  for (const Tagged& half : halves) {
    EXPECT_EQ(half.corner[2], part.corner[2]);
    EXPECT_EQ(half.triangle, 7u);
    EXPECT_EQ(half.tag, 0.5);
  }
}

}  // namespace
}  // namespace padder
