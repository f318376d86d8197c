// SPDX-License-Identifier: MIT
// How the work of several levels is divided, and how many output slots the tiles of each level get: host
// code.

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "detect/cuda/output/stable_output.h"
#include "detect/cuda/search/level_pairs.h"
#include "detect/cuda/tuning.h"
#include "tests/detect/random.h"

namespace padder::detect::cuda {
namespace {

// No more slots than there are: else more slots would be left empty than contacts spill, and the list would
// have holes. No fewer than rounding down costs a tile.
TEST(CudaSlotEstimate, TilesGetNoMoreSlotsThanThereAre) {
  std::mt19937_64 random = random_of_new_seed();
  const auto below = [&](std::uint64_t n) { return random() % n; };
  for (int scene = 0; scene < 20'000; scene++) {
    Grid grid;
    grid.levels = 1 + static_cast<int>(below(kMaxLevels));
    std::uint64_t spheres = 0;
    for (int k = 0; k < grid.levels; k++) {
      Level& l = grid.level[k];
      // Also levels of less than a tile, and two scenes in three with one level that holds nearly all.
      l.spheres = k == 0 && scene % 3 ? 140'000 + below(2'000'000) : 1 + below(scene % 3 == 1 ? 9 : 100'000);
      for (auto& side : l.count) side = 1 + static_cast<std::uint32_t>(below(100));
      l.radius_max = std::exp2(-static_cast<double>(below(1000)) / 100), l.per_size = 0.5 / l.radius_max;
      spheres += l.spheres;
    }
    const std::uint64_t slots = below(1000) * tiles_of(spheres);
    const auto tiles = static_cast<std::uint32_t>((spheres + kLargeTile - 1) / kLargeTile);
    const TileQuotas q = quotas_of_levels(grid, slots, tiles);
    ASSERT_EQ(q.levels, grid.levels);
    ASSERT_EQ(q.first[0], 0u);
    for (int k = 0; k < q.levels; k++) {
      const std::uint32_t end = k + 1 < q.levels ? q.first[k + 1] : tiles;
      ASSERT_LE(q.first[k], end);
      ASSERT_EQ(q.slot[k + 1] - q.slot[k], std::uint64_t(q.quota[k]) * (end - q.first[k]));
    }
    ASSERT_LE(q.slot[q.levels], slots) << "scene " << scene;
    ASSERT_GE(q.slot[q.levels] + tiles, slots) << "scene " << scene;
  }
}

// Of each two levels, each sphere of one searches each part of its rows of the other once, however the work
// is divided.
TEST(CudaSlotEstimate, EachPartOfTheRowsIsSearchedOnce) {
  std::mt19937_64 random = random_of_new_seed();
  const auto below = [&](std::uint64_t n) { return random() % n; };
  int in_groups = 0, in_parts = 0, one_after_the_other = 0, from_fine = 0;
  for (int scene = 0; scene < 300; scene++) {
    Grid grid;
    grid.levels = 2 + static_cast<int>(below(4));
    double radius = 1;
    for (int k = 0; k < grid.levels; k++, radius *= 2 + static_cast<double>(below(3))) {
      Level& l = grid.level[k];
      l.spheres =
          k == 0 ? (scene % 2 ? tuning::kManySpheres : 200'000) + below(100'000) : 1 + below(20'000 >> 3 * k);
      l.radius_max = radius, l.size = 2 * radius, l.per_size = 1 / l.size;
      for (auto& side : l.count)
        side = 2 + static_cast<std::uint32_t>(below(static_cast<std::uint64_t>(400 / radius) + 1));
      // Few buckets: spheres that reach far into the level cannot search it.
      if (k == 0 && scene % 5 == 0) l.hashed = 1, l.ring = 1 << 20, l.side = 12;
    }
    std::uint64_t all = 0;
    for (int k = 0; k < grid.levels; k++) {
      Level& l = grid.level[k];
      l.offset = grid.buckets, l.buckets = 100, grid.buckets += l.buckets, all += l.spheres;
    }
    const LevelPairs pairs = plan_level_pairs(grid, all, SlotKind::unequal, scene % 3 == 0);
    ASSERT_EQ(pairs.count, static_cast<std::uint32_t>(grid.levels * (grid.levels - 1) / 2));
    for (std::uint32_t p = 0; p < pairs.count; p++) {
      const LevelPair& d = pairs.pair[p];
      const Level& from = grid.level[d.from];
      ASSERT_EQ(d.entry, from.offset);
      ASSERT_EQ(d.end_entry, from.offset + from.buckets);
      const std::uint32_t units =
          (p + 1 < pairs.count ? pairs.pair[p + 1].first_unit : pairs.units) - d.first_unit;
      std::vector<std::uint8_t> searched(from.spheres * d.parts);
      for (std::uint32_t unit = 0; unit < units; unit++) {
        const UnitWork w = work_of_unit(d, unit / d.warp_units, unit % d.warp_units);
        if (w.part >= d.parts) continue;  // more than the largest sphere has
        for (std::uint64_t k = w.first; k < std::min<std::uint64_t>(w.first + d.group, from.spheres); k++)
          searched[k * d.parts + w.part]++;
      }
      for (const std::uint8_t n : searched) ASSERT_EQ(n, 1) << "scene " << scene << " pair " << p;
      (d.warp_units > 1 ? one_after_the_other : d.parts > 1 ? in_parts : in_groups)++;
      from_fine += d.from < d.at;
    }
  }
  EXPECT_GT(in_groups, 0);
  EXPECT_GT(in_parts, 0);
  EXPECT_GT(one_after_the_other, 0);
  EXPECT_GT(from_fine, 0);
}

// Where two levels have no units, no sphere of one can touch a sphere of the other; and levels that lie far
// from each other have none.
TEST(CudaSlotEstimate, LevelsThatLieApartHaveNoUnits) {
  std::mt19937_64 random = random_of_new_seed();
  const auto below = [&](std::uint64_t n) { return random() % n; };
  int apart = 0, near = 0;
  for (int scene = 0; scene < 3000; scene++) {
    Grid grid;
    grid.levels = 2;
    for (int k = 0; k < 2; k++) {
      Level& l = grid.level[k];
      l.spheres = 1000, l.radius_max = k ? 4 + static_cast<double>(below(20)) : 1;
      l.size = 2.1 * l.radius_max, l.per_size = 1 / l.size;
      for (int c = 0; c < 3; c++)
        l.first[c] = static_cast<int>(below(60)) - 30, l.count[c] = 1 + static_cast<std::uint32_t>(below(20));
    }
    const LevelPairs pairs = plan_level_pairs(grid, 2000, SlotKind::unequal, scene % 2 == 0);
    ASSERT_EQ(pairs.count, 1u);
    double farthest = -1e9;  // of the gaps between the bounds along an axis
    for (int c = 0; c < 3; c++) {
      double low[2], high[2];
      for (int k = 0; k < 2; k++) {
        const Level& l = grid.level[k];
        low[k] = static_cast<double>(l.first[c]) * l.size, high[k] = low[k] + l.count[c] * l.size;
      }
      farthest = std::max({farthest, low[0] - high[1], low[1] - high[0]});
    }
    const double sum = grid.level[0].radius_max + grid.level[1].radius_max;
    if (pairs.units == 0) {
      ASSERT_GT(farthest, sum) << "scene " << scene;
    }
    if (farthest > 4 * sum) {
      ASSERT_EQ(pairs.units, 0u) << "scene " << scene;
    }
    (pairs.units ? near : apart)++;
  }
  EXPECT_GT(apart, 0);
  EXPECT_GT(near, 0);
}

// A few spheres may share a level with one that is far larger than all the others together. Their rows are
// divided by how many spheres they reach, not by how small a part of the largest ball the others fill.
TEST(CudaSlotEstimate, RowsAreDividedByWhatEachSphereReaches) {
  for (const double giant : {100.0, 1e3, 1e5}) {
    Grid grid;
    grid.levels = 2;
    Level &fine = grid.level[0], &coarse = grid.level[1];
    fine.spheres = 1'000'000, fine.radius_max = 1, fine.size = 2, fine.per_size = 0.5;
    for (auto& side : fine.count) side = 100;
    coarse.spheres = 6, coarse.radius_max = giant, coarse.size = 2 * giant, coarse.per_size = 0.5 / giant;
    coarse.first[0] = -1;
    for (auto& side : coarse.count) side = 2;
    for (const bool fused : {false, true}) {
      const LevelPair d = plan_level_pairs(grid, 1'000'006, SlotKind::unequal, fused).pair[0];
      ASSERT_EQ(d.from, 1);
      for (const double radius : {20.0, 50.0, giant}) {
        // The spheres of a ball of this radius, one in a bin, and those that a part should find.
        const double reach = (radius + 1) * fine.per_size,
                     reached = std::min(4.19 * reach * reach * reach, 1e6),
                     aim = fused ? tuning::kFusedPartContacts : tuning::kPartContacts;
        const double parts = parts_of(d, fine, static_cast<float>(reach));
        EXPECT_LT(reached / parts, 4 * aim) << giant << ", " << radius;
        EXPECT_LE(parts, d.parts);
      }
    }
  }
}

}  // namespace
}  // namespace padder::detect::cuda
