// SPDX-License-Identifier: MIT
// The stable order of few tiles: each tile waits for the counts of those before it and writes its contacts
// where they stay, so that nothing moves afterwards. The tiles it waits for run or have run, since blocks
// start in the order of their numbers (CUB's scans rely on that, too) and the caller launches no more than
// run at once. Only .cu files include this.
//
// Many tiles that poll the same few words hold up each other and the search. So counts are brought to those
// who wait: each tile adds its count to a word of each later tile in its group of 32, and the last tile of a
// group adds the group's sum to a word of each later group. A tile then polls two words of its own. A word is
// complete when as many have added to it as come before. There are two sets of words: a search uses one and
// clears the other for the next.
#pragma once
#include "detect/cuda/device/ptx.h"
#include "detect/cuda/output/output_task.h"
#include "detect/cuda/tuning.h"

namespace padder::detect::cuda {

inline constexpr std::uint32_t kOrderedGroups = (tuning::kMostOrderedTiles + 31) / 32,
                               kOrderedWords = tuning::kMostOrderedTiles + 2 * kOrderedGroups;

// The number of the search, which says which set of words it uses. Read it before the tile is searched and
// pass it to slots_before_tile.
__device__ __forceinline__ std::uint32_t ordered_search_number(const OutputTask& task) {
  return *reinterpret_cast<volatile std::uint32_t*>(task.stable.ordered_words);
}

// By all threads of the block, after a barrier: how many contacts the tiles before this one found. `found`:
// of this tile.
__device__ __forceinline__ Word slots_before_tile(const OutputTask& task, const std::uint32_t& search,
                                                  std::uint32_t found, Word* shared) {
  constexpr int kAdders = 40;  // the bits from here on count the adders, those below sum the contacts
  const std::uint32_t tile = kept_in_register(blockIdx.x), lane = kept_in_register(threadIdx.x & 31);
  if (threadIdx.x < 32) {
    const std::uint32_t odd = search & 1, index = tile & 31, group = tile / 32, other = tile - index + lane;
    Word *const words = task.stable.ordered_words + 1 + odd * kOrderedWords,
                *const of_groups = words + tuning::kMostOrderedTiles,
                *const sums = of_groups + kOrderedGroups,
                *const next = words + kOrderedWords - 2 * odd * kOrderedWords;
    const Word mine = Word(1) << kAdders | found;
    if (lane > index && other < gridDim.x) atomicAdd(words + other, mine);
    Word before = lane == 0 ? atomicAdd(sums + group, mine) : 0;
    before = __shfl_sync(kFullWarp, before, 0);
    if (before >> kAdders == 31)
      for (std::uint32_t g = group + 1 + lane; g * 32 < gridDim.x; g += 32)
        atomicAdd(of_groups + g, before + mine - (Word(31) << kAdders));
    for (std::uint32_t k = tile + lane * gridDim.x; k < kOrderedWords; k += 32 * gridDim.x) next[k] = 0;
    if (lane == 0) {
      const volatile Word *const a = words + tile, *const b = of_groups + group;
      Word x, y;
      do x = *a, y = *b;
      while (x >> kAdders != index || y >> kAdders != group);
      *shared = before = (x + y) & ((Word(1) << kAdders) - 1);
      if (tile + 1 == gridDim.x) {  // all tiles have counted, so all have read the number of the search
        task.counters->contacts = before + found;
        *reinterpret_cast<std::uint32_t*>(task.stable.ordered_words) = search + 1;
      }
    }
  }
  __syncthreads();
  return *shared;
}

}  // namespace padder::detect::cuda
