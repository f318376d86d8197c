// SPDX-License-Identifier: MIT
// How the work of several levels and the places of a list of fixed order are dealt out, on the host.
#include "detect/cuda/output/slot_estimate.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace padder::detect::cuda {
namespace {

// Never more places than asked for: what is left spare would exceed what spills, and the list would have
// holes. No fewer than rounding down costs a tile.
TEST(CudaExpect, TilesGetNoMorePlacesThanThereAre) {
  const unsigned seed = std::random_device{}();
  std::printf("seed %u\n", seed);
  std::mt19937 random(seed);
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
    const std::uint64_t share = below(1000), of_half_tiles = (spheres + kThreads - 1) / kThreads,
                        places = share * of_half_tiles;
    const auto tiles = static_cast<std::uint32_t>((spheres + kFlowTile - 1) / kFlowTile);
    const TileShares s = tile_shares(grid, places, tiles);
    ASSERT_EQ(s.levels, grid.levels);
    ASSERT_EQ(s.first[0], 0u);
    for (int k = 0; k < s.levels; k++) {
      const std::uint32_t end = k + 1 < s.levels ? s.first[k + 1] : tiles;
      ASSERT_LE(s.first[k], end);
      ASSERT_EQ(s.place[k + 1] - s.place[k], std::uint64_t(s.share[k]) * (end - s.first[k]));
    }
    ASSERT_LE(s.place[s.levels], places) << "scene " << scene;
    ASSERT_GE(s.place[s.levels] + tiles, places) << "scene " << scene;
  }
}

// Each sphere of a level looks once at each part of its rows of each finer level, whatever units are made of.
TEST(CudaExpect, PiecesOfUnitsAreEachLookedAtOnce) {
  const unsigned seed = std::random_device{}();
  std::printf("seed %u\n", seed);
  std::mt19937 random(seed);
  const auto below = [&](std::uint64_t n) { return random() % n; };
  int in_pieces = 0, parts_in_pieces = 0, in_one = 0;
  for (int scene = 0; scene < 300; scene++) {
    Grid grid;
    grid.levels = 2 + static_cast<int>(below(4));
    double radius = 1;
    for (int k = 0; k < grid.levels; k++, radius *= 2 + static_cast<double>(below(3))) {
      Level& l = grid.level[k];
      l.spheres = k == 0 ? (scene % 2 ? kManyPieces : 200'000) + below(100'000) : 1 + below(20'000 >> 3 * k);
      l.radius_max = radius, l.size = 2 * radius, l.per_size = 1 / l.size;
      for (auto& side : l.count)
        side = 2 + static_cast<std::uint32_t>(below(static_cast<std::uint64_t>(400 / radius) + 1));
    }
    const Downs downs = plan_downs(grid, SlotKind::unequal, true, true);
    for (std::uint32_t p = 0; p < downs.count; p++) {
      const Down& d = downs.pair[p];
      const std::uint32_t units =
          (p + 1 < downs.count ? downs.pair[p + 1].first_unit : downs.units) - d.first_unit;
      std::vector<std::uint8_t> looks(static_cast<std::size_t>(d.end - d.first) * d.parts);
      for (std::uint32_t unit = 0; unit < units; unit++)
        for (std::uint32_t piece = 0; piece < d.pieces; piece++) {
          const Piece q = piece_of(d, unit, piece);
          if (q.part >= d.parts) continue;  // more than the largest sphere has
          for (std::uint32_t k = q.first; k < std::min(q.first + d.group, d.end); k++)
            looks[static_cast<std::size_t>(k - d.first) * d.parts + q.part]++;
        }
      for (const std::uint8_t n : looks) ASSERT_EQ(n, 1) << "scene " << scene << " pair " << p;
      (d.pieces == 1 ? in_one : d.parts > 1 ? parts_in_pieces : in_pieces)++;
    }
  }
  EXPECT_GT(in_one, 0);
  EXPECT_GT(in_pieces, 0);
  EXPECT_GT(parts_in_pieces, 0);
}

}  // namespace
}  // namespace padder::detect::cuda
