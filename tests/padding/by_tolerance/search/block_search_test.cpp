// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/search/block_search.h"

#include <gtest/gtest.h>

#include "padding/geometry/point_tree.h"
#include "padding/geometry/random.h"
#include "tests/padding/threads.h"

namespace padder {
namespace {

// Discs over the unit square: points on a grid, sets around random points.
struct Discs {
  std::vector<Point> points, centers;
  Sets sets;

  Discs(int grid, std::size_t count, double radius) {
    for (int i = 0; i < grid; i++)
      for (int j = 0; j < grid; j++) points.push_back({(i + 0.5) / grid, (j + 0.5) / grid, 0});
    const PointTree tree(points);
    Random random(2);
    std::vector<std::uint32_t> found;
    for (std::size_t k = 0; k < count; k++) {
      centers.push_back({random.uniform(), random.uniform(), 0});
      found.clear();
      tree.find(centers.back(), radius, found);
      sets.add(found);
    }
  }
  std::vector<std::uint32_t> greedy() const {
    SetCover cover(sets, points.size());
    cover.greedy();
    return cover.best();
  }
  std::vector<std::uint32_t> improved(const std::vector<std::uint32_t>& cover, const BlockSearch& options,
                                      const std::vector<std::uint32_t>& kept = {}) const {
    return improve_in_blocks(sets, points.size(), centers, cover, options, kept);
  }
  std::size_t open(const std::vector<std::uint32_t>& cover) const {
    std::vector<char> done(points.size());
    for (auto s : cover)
      for (auto r : sets[s]) done[r] = 1;
    return static_cast<std::size_t>(std::count(done.begin(), done.end(), 0));
  }
};

TEST(BlockSearch, StaysACoverAndGetsSmaller) {
  const Discs discs(120, 6000, 0.05);
  const auto greedy = discs.greedy();
  std::vector<std::uint32_t> cover = greedy;
  for (std::uint64_t seed = 1; seed <= 3; seed++) {
    const auto better = discs.improved(cover, {.block = 40, .steps = 100, .seed = seed});
    EXPECT_EQ(discs.open(better), discs.open(greedy));
    EXPECT_LE(better.size(), cover.size());
    cover = better;
  }
  EXPECT_LT(cover.size(), 0.9 * static_cast<double>(greedy.size()));
}

TEST(BlockSearch, SameResultForAnyNumberOfThreads) {
  const Discs discs(80, 3000, 0.06);
  const auto greedy = discs.greedy();
  const auto cover = [&] { return discs.improved(greedy, {.block = 20}); };
  const auto one = with_threads(1, cover);
  for (const int threads : {2, 5}) EXPECT_EQ(with_threads(threads, cover), one);
}

TEST(BlockSearch, SetsThatAreKeptCoverTheirElements) {
  const Discs discs(80, 3000, 0.06);
  const auto greedy = discs.greedy();
  std::vector<std::uint32_t> kept, moved;
  for (const auto s : greedy) (discs.centers[s].x() < 0.5 ? kept : moved).push_back(s);
  auto better = discs.improved(moved, {.block = 20, .steps = 100}, kept);
  EXPECT_LT(better.size(), moved.size());
  for (const auto s : better) EXPECT_EQ(std::count(kept.begin(), kept.end(), s), 0);
  better.insert(better.end(), kept.begin(), kept.end());
  EXPECT_EQ(discs.open(better), discs.open(greedy));
}

TEST(BlockSearch, AnEmptyCoverStaysEmpty) { EXPECT_TRUE(improve_in_blocks(Sets(), 0, {}, {}, {}).empty()); }

}  // namespace
}  // namespace padder
