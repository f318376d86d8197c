// SPDX-License-Identifier: MIT
// Search between levels, the division of work: of each two levels, the spheres of one search the rows of the
// other's bins that come near them. Mostly the coarser ones search: what they meet are mostly contacts, and a
// fine sphere that searched a coarser level would meet mostly strangers. The finer ones search where large
// spheres would visit many bins that are nearly empty, or more than can be told apart. Internal; only .cu
// files include this.
#pragma once
#include "detect/cuda/order/bins.h"
#include "detect/cuda/output/output_task.h"

namespace padder::detect::cuda {

// Two levels: the spheres of level `from` search level `at`. The work is cut into units: `group` spheres with
// all their rows; or one sphere with one part of its rows. A sphere has as many parts as its size asks for,
// `parts` at most. A warp takes `warp_units` units one after the other, of parts that lie far from each
// other: most spheres have only the first of them. Levels too far apart to touch have no unit.
struct LevelPair {
  std::uint32_t first_warp, first_unit;
  std::uint32_t entry, end_entry;                // of the table of bins: where level `from` begins and ends
  std::uint32_t group, parts, warp_units, step;  // step: parts / warp_units, rounded up
  float parts_at_one;  // parts of a sphere that reaches one bin far; they grow with cubed_within()
  float density;       // spheres of level `at` in a bin
  std::int32_t from, at;
};
struct LevelPairs {
  static constexpr int kMost = kMaxLevels * (kMaxLevels - 1) / 2;
  static constexpr bool kSeveralLevels = true;
  std::uint32_t count = 0, warps = 0, units = 0;
  LevelPair pair[kMost];
  LevelBins bins;  // where the order is by these
};
// Stands for LevelPairs in kernels that search one level.
struct NoLevelPairs {
  static constexpr bool kSeveralLevels = false;
};

// Decides who searches whom. Fused: larger units, since the fused search divides nothing but its work by
// them.
LevelPairs plan_level_pairs(const Grid& grid, std::uint64_t spheres, SlotKind kind, bool fused = false);

// The work of a unit: `group` spheres of level `from` from number `first` on, or part number `part` of the
// rows of that sphere. There may be units behind the last sphere.
struct UnitWork {
  std::uint32_t first, part;
};
// Of unit number `nth` of a warp's; `warp` counts the warps of the pair.
__host__ __device__ __forceinline__ UnitWork work_of_unit(const LevelPair& d, std::uint32_t warp,
                                                          std::uint32_t nth) {
  const std::uint32_t number = d.step == 1 ? warp : warp / d.step;
  if (d.parts == 1) return {number * d.group, 0};
  return {number, warp - number * d.step + nth * d.step};
}
// Where the spheres of level `from` lie in the order, and how many there are.
struct SpheresOfLevel {
  std::uint32_t first, count;
  // Of `most` from number `at` on, those that there are.
  __device__ __forceinline__ std::uint32_t left(std::uint32_t at, std::uint32_t most) const {
    return at < count ? min(most, count - at) : 0;
  }
};
__device__ __forceinline__ SpheresOfLevel spheres_of(const OutputTask& task, const LevelPair& d) {
  // A speculative call may search with the bins of another scene: indices are held within bounds.
  const std::uint32_t end = min(__ldg(task.spheres.table + d.end_entry), task.spheres.count),
                      first = min(__ldg(task.spheres.table + d.entry), end);
  return {first, end - first};
}

// The third power of a reach in bins of a level, as far as the level goes: where it is thinner than the ball
// of that radius, three quarters of its thickness count along that axis.
template <RealNumber T>
PADDER_HD T cubed_within(const Level& l, T reach) {
  T cubed = 1;
  for (int c = 0; c < 3; c++) {
    const T most = T(0.75) * static_cast<T>(l.count[c]);
    cubed *= bounded(l, c) && most < reach ? most : reach;
  }
  return cubed;
}

// Into how many parts the rows of such a sphere are divided, of the spheres that search level `at`. Work
// beyond the last part is empty.
PADDER_HD std::uint32_t parts_of(const LevelPair& d, const Level& at, float reach) {
  if (d.parts == 1) return 1;
  const float parts = d.parts_at_one * cubed_within(at, reach);
  return min(d.parts, static_cast<std::uint32_t>(fminf(parts, 0x1p30f)) + 1);
}

}  // namespace padder::detect::cuda
