// SPDX-License-Identifier: MIT
#include "padding/geometry/indices.h"

#include <gtest/gtest.h>

#include "padding/geometry/random.h"

namespace padder {
namespace {

TEST(Indices, JoinedOnesHaveTheSmallestAsTheirRoot) {
  Random random(1);
  std::vector<std::uint32_t> parent = numbered(200), label = numbered(200);
  for (int k = 0; k < 150; k++) {
    const auto a = static_cast<std::uint32_t>(random.below(200)),
               b = static_cast<std::uint32_t>(random.below(200));
    const auto [low, high] = std::minmax({label[a], label[b]});
    EXPECT_EQ(join(parent, a, b), low != high);
    for (auto& l : label)
      if (l == high) l = low;
  }
  for (std::uint32_t k = 0; k < 200; k++) EXPECT_EQ(root_of(parent, k), label[k]);
}

TEST(Indices, AnEdgeIsTheSameEitherWay) {
  EXPECT_EQ(edge_of(7, 0xfffffff0u), edge_of(0xfffffff0u, 7));
  EXPECT_EQ(ends_of(edge_of(0xfffffff0u, 7)), (std::array<std::uint32_t, 2>{7, 0xfffffff0u}));
  EXPECT_LT(edge_of(1, 9), edge_of(2, 3));
}

TEST(Indices, SortedAndEachOnce) {
  std::vector<int> list{3, 1, 3, 2, 1};
  sort_unique(list);
  EXPECT_EQ(list, (std::vector<int>{1, 2, 3}));
}

}  // namespace
}  // namespace padder
