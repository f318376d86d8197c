// SPDX-License-Identifier: MIT
// Rows of bins that are too long for the warp that comes upon them. Where spheres are crowded, at one point
// or towards a cusp, a few warps would have most of the work, and the others would have ended. So a warp puts
// such a row on a list, in parts, and kernels behind the search deal these out to all warps (long_rows.cu).
// Which rows are long follows from the spheres alone, not from which warp comes first. Only .cu files include
// this.
#pragma once
#include "detect/cuda/device/ptx.h"
#include "detect/cuda/device/warp.h"
#include "detect/cuda/search/search_task.h"
#include "detect/cuda/tuning.h"

namespace padder::detect::cuda {

// A part: `count` candidates from index `begin` on, of sphere `i`, at the level `at` or at its own.
struct RowPart {
  static constexpr std::uint32_t kOwnLevel = ~0u;
  std::uint32_t i, begin, count, at;
};
__device__ __forceinline__ void store_part(const LongRows& rows, Word number, const RowPart& p) {
  rows.key[number] = static_cast<Word>(p.i) << rows.index_bits | p.begin;
  rows.value[number] = static_cast<Word>(p.at) << 32 | p.count;
}
__device__ __forceinline__ RowPart load_part(const LongRows& rows, Word number) {
  const Word key = __ldcg(rows.key + number), value = __ldcg(rows.value + number);
  return {static_cast<std::uint32_t>(key >> rows.index_bits),
          static_cast<std::uint32_t>(key & ((Word(1) << rows.index_bits) - 1)),
          static_cast<std::uint32_t>(value), static_cast<std::uint32_t>(value >> 32)};
}

// For all lanes of a warp, one row a lane: candidates `begin` to `end` - 1 of sphere `i` (indices of the
// order) go to the list if they are more than `most`. Returns the end of what is left to the lane. A row goes
// there once: who searches it again leaves it out. Where there is no room the parts are counted alone, and
// the caller of the search makes room and searches again. Only where task.defers.
__device__ __forceinline__ std::uint32_t defer_long_row(const SearchTask& task, std::uint32_t i,
                                                        std::uint32_t begin, std::uint32_t end,
                                                        std::uint32_t most,
                                                        std::uint32_t at = RowPart::kOwnLevel) {
  const std::uint32_t length = end > begin ? end - begin : 0,
                      parts = length > most ? (length - 1) / tuning::kRowPart + 1 : 0;
  if (!__any_sync(kFullWarp, parts != 0)) return end;
  std::uint32_t all;
  const std::uint32_t before = sum_before(parts, all);
  Word first = 0;
  if ((threadIdx.x & 31) == 0) first = atomicAdd(&task.counters->long_rows, static_cast<Word>(all));
  first = __shfl_sync(kFullWarp, first, 0) + before;
#pragma unroll 1
  for (std::uint32_t k = 0; k < parts && first + k < task.long_rows.room; k++) {
    const std::uint32_t from = begin + k * tuning::kRowPart;
    store_part(task.long_rows, first + k, {i, from, min(end - from, tuning::kRowPart), at});
  }
  return parts ? begin : end;
}

}  // namespace padder::detect::cuda
