// How the places of a list of fixed order are dealt to tiles of spheres of several levels, on the host.
#include "detect/cuda/expect.h"

#include <gtest/gtest.h>

#include <random>

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

}  // namespace
}  // namespace padder::detect::cuda
