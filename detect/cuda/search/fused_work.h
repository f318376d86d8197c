// SPDX-License-Identifier: MIT
// The fused search, the order in which warps take work. What is near in space should be searched at one time,
// so that slots come from a cache; the spheres of all levels are ordered alike. So first come the tiles of
// the coarser levels, whose rows may be long; then, in rounds, the first part in 2^bits of each pair of
// levels and of the finest tiles, then the second part of each, and so on. Fewer spheres fit the cache
// anyhow. Then the pairs go from those of the largest spheres to those of the smallest: the units of small
// spheres are short, and what starts last should not take long. In any order the finest tiles come last, in
// one round. In a stable order all tiles come first, since units must wait for their quotas, and the pairs
// follow in few rounds. Only .cu files include this.
#pragma once
#include "detect/cuda/device/warp.h"
#include "detect/cuda/search/level_pairs.h"
#include "detect/cuda/search/search_task.h"
#include "detect/cuda/tuning.h"

namespace padder::detect::cuda {

struct WorkPlan {
  std::uint32_t items, first, tiles;           // all; tiles that come first; tiles
  std::uint32_t count[LevelPairs::kMost + 1];  // units of each pair, then the tiles that do not come first
};
struct WorkItem {
  std::uint32_t pair, unit;  // pair: LevelPairs::count stands for a tile
};

// By all threads of the block; the caller synchronizes them.
__device__ __forceinline__ void plan_work(const SearchTask& task, const Grid& grid, const LevelPairs& pairs,
                                          bool tiles_first, bool largest_first, WorkPlan& work) {
  for (std::uint32_t p = threadIdx.x; p <= pairs.count; p += kTileSpheres) {
    const std::uint32_t tiles = task.tiles,
                        finest = static_cast<std::uint32_t>(min(grid.level[0].spheres / task.tile_spheres,
                                                                static_cast<std::uint64_t>(tiles)));
    const std::uint32_t first = tiles_first ? tiles : tiles - finest,
                        at = largest_first && p < pairs.count ? pairs.count - 1 - p : p;
    if (p == pairs.count) work.tiles = tiles, work.first = first, work.items = pairs.warps + tiles;
    work.count[at] = p == pairs.count       ? tiles - first
                     : p + 1 == pairs.count ? pairs.warps - pairs.pair[p].first_warp
                                            : pairs.pair[p + 1].first_warp - pairs.pair[p].first_warp;
  }
}
__device__ __forceinline__ std::uint32_t round_bits(bool stable, bool largest_first) {
  return !largest_first ? tuning::kRoundBits : stable ? tuning::kStableRoundBits : 0;
}
// Item `number` of the plan, by a warp.
__device__ __forceinline__ WorkItem item_of(const WorkPlan& work, std::uint32_t pairs, std::uint32_t number,
                                            std::uint32_t lane, std::uint32_t bits) {
  if (number < work.first) return {pairs, work.tiles - 1 - number};
  number -= work.first;
  const auto begin = [&](std::uint32_t count, std::uint32_t round) {
    return static_cast<std::uint32_t>(static_cast<std::uint64_t>(count) * round >> bits);
  };
  std::uint32_t round = 0, before = 0;
  if (bits) {
    // A round at or before that of the item, by float arithmetic; then on to the right one.
    round = static_cast<std::uint32_t>(static_cast<float>(number) * static_cast<float>(1 << bits) /
                                       static_cast<float>(work.items - work.first) * 0.99999f);
    for (bool more = true; more; round += more) {
      std::uint32_t next = 0;
      before = 0;
      for (std::uint32_t p = lane; p <= pairs; p += 32)
        before += begin(work.count[p], round), next += begin(work.count[p], round + 1);
      before = __reduce_add_sync(kFullWarp, before), next = __reduce_add_sync(kFullWarp, next);
      more = next <= number;
    }
  }
  std::uint32_t left = number - before;
  for (std::uint32_t p0 = 0;; p0 += 32) {
    const std::uint32_t n = p0 + lane <= pairs ? work.count[p0 + lane] : 0, first = begin(n, round),
                        here = begin(n, round + 1) - first;
    std::uint32_t all, start = sum_before(here, all);
    if (left < all) {
      const std::uint32_t who = 31 - __clz(__ballot_sync(kFullWarp, left - start < here));
      return {p0 + who, __shfl_sync(kFullWarp, first + left - start, who)};
    }
    left -= all;
  }
}

}  // namespace padder::detect::cuda
