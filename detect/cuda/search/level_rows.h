// SPDX-License-Identifier: MIT
// The rows of bins in which a sphere finds its partners of the same level, and the first test of the
// candidates there, by their codes (codes.h). Only .cu files include this.
#pragma once
#include "detect/cuda/device/warp.h"
#include "detect/cuda/search/level_pairs.h"
#include "detect/cuda/search/search_task.h"

namespace padder::detect::cuda {

inline constexpr int kRows =
    5;  // the rest of the own row, and four rows that are the forward half of those around

// The lane's sphere and where its rows begin and end.
template <SlotKind Kind>
struct LevelQuery {
  typename SlotOf<Kind>::Type slot;
  std::uint32_t index, seeker;
  bool valid;  // false: behind the last sphere
  std::uint32_t begin[kRows], end[kRows];
  // A row of some lane runs over the end of its ring. The rest of it is one row more: rows are so far from
  // each other that no lane has two of these.
  bool split;
  std::uint32_t rest_begin, rest_end;  // only where split
};

// How the keys of a sphere's neighbours follow from its own. In a dense level no row ends at the end of the
// keys, and `mask` changes nothing.
struct RowSteps {
  std::uint32_t key, row, plane, reach = 1, mask = ~0u, base = 0;  // base: of the level's keys
};
template <SlotKind Kind, bool Hashed, class Pairs>
__device__ __forceinline__ RowSteps row_steps(const SearchTask& task, const Grid& grid, const Pairs& pairs,
                                              const LevelQuery<Kind>& query) {
  RowSteps r;
  const FloatBins& bins = task.spheres.bins;
  if constexpr (Kind != SlotKind::fixed_point) {
    if (bins.on) {
      key_of(bins, query.slot.x, query.slot.y, query.slot.z, r.key);
      r.row = bins.row, r.plane = bins.plane, r.reach = bins.fine, r.mask = bins.mask;
      return r;
    }
  }
  if constexpr (Kind == SlotKind::unequal && Pairs::kSeveralLevels) {
    if (pairs.bins.on) {
      const float4 s = make_float4(query.slot.x, query.slot.y, query.slot.z, query.slot.r);
      const FloatBins& b = pairs.bins.level[level_of(pairs.bins, s)];
      r.row = b.row, r.plane = b.plane;
      if (Hashed && b.size > 0)
        r.key = hashed_key(b, s.x, s.y, s.z), r.mask = b.mask, r.base = b.first;
      else
        dense_key_of(b, s.x, s.y, s.z, r.key);
      return r;
    }
  }
  r.key = __ldg(task.spheres.keys + query.index);
  const Level& l = grid.level[level_of_key(grid, r.key)];
  if (l.hashed)
    r.row = l.row, r.plane = l.plane, r.mask = l.ring - 1, r.base = l.offset;
  else
    r.row = l.count[0] + 2, r.plane = r.row * (l.count[1] + 2);
  return r;
}

// `pairs`: LevelPairs or NoLevelPairs. Hashed: some level may be.
template <SlotKind Kind, bool Hashed = true, class Pairs>
__device__ __forceinline__ LevelQuery<Kind> level_query(const SearchTask& task, const Grid& grid,
                                                        const Pairs& pairs, std::uint32_t first) {
  const std::uint32_t at = first + (threadIdx.x & 31), last = task.spheres.count - 1;
  LevelQuery<Kind> query;
  query.index = min(at, last), query.valid = at <= last;
  query.slot = load_slot(slots_of<Kind>(task) + query.index);
  query.seeker = seeker<Kind>(__ldg(task.spheres.codes + query.index));
  const RowSteps r = row_steps<Kind, Hashed>(task, grid, pairs, query);
  const int m = task.spheres.merge;
  const auto start = [&](std::uint32_t entry) { return __ldg(task.spheres.table + entry); };
  std::uint32_t k = r.key - r.base, over = 0;  // over: bins of a row that lie behind the end of the ring
#pragma unroll
  for (int q = 0; q < kRows; q++) {
    const std::uint32_t from = (q ? k - r.reach : k) & r.mask, upto = from + (q ? 2 * r.reach : r.reach);
    if (upto > r.mask) over = upto - r.mask;
    query.begin[q] = q ? start((r.base + from) >> m) : query.index + 1,
    query.end[q] = start(((r.base + min(upto, r.mask)) >> m) + 1);
    k = q == 1 ? r.key - r.base + r.plane - r.row : k + r.row;  // of the next row
  }
  query.split = Hashed && task.spheres.hashed && __any_sync(kFullWarp, over != 0);
  if (query.split) {
    query.rest_begin = start(r.base >> m);
    query.rest_end = over ? start(((r.base + over - 1) >> m) + 1) : query.rest_begin;
  }
  return query;
}

// Tests up to 32 candidates of each lane by their codes, from the multiple of four at or before `begin` on.
// The result has a bit for each that may touch, the first candidate in the highest bit. `longest`: most
// candidates of a lane.
template <SlotKind Kind>
__device__ __forceinline__ std::uint32_t code_mask(const SearchTask& task, std::uint32_t seeker,
                                                   std::uint32_t begin, std::uint32_t end, bool valid,
                                                   std::uint32_t& longest) {
  const std::uint32_t skipped = begin & 3, upto = valid && end > begin ? end - begin + skipped : 0;
  longest = __reduce_max_sync(kFullWarp, upto);
  if (longest == 0) return 0;
  const auto* const four = reinterpret_cast<const uint4*>(task.spheres.codes + (begin - skipped));
  std::uint32_t mask = 0;
  const auto next = [&](const uint4& c) {
    const auto bit = [&](std::uint32_t code) {
      const auto e = static_cast<std::uint32_t>(code_excess<Kind>(seeker, code, task.code_limit));
      mask = __funnelshift_l(e, mask, 1);
    };
    bit(c.x), bit(c.y), bit(c.z), bit(c.w);
  };
  // Rarely more than eight, rarely fewer than five: both loads are issued at once.
  const uint4 c0 = __ldg(four), c1 = __ldg(four + 1);
  next(c0), next(c1);
  std::uint32_t span = 8;
#pragma unroll 1
  for (const std::uint32_t most = min(longest, 32u); span < most; span += 4) next(__ldg(four + span / 4));
  return __funnelshift_lc(0, mask, 32 - span) & __funnelshift_rc(0, ~0u, upto) & ~0u >> skipped;
}

// Counts of the five rows side by side in one word, so that one prefix sum serves all: each is at most 32 *
// 32 in a warp.
struct RowCounts {
  static constexpr int kBits = 12;
  static __device__ __forceinline__ std::uint64_t put(int count, int q) {
    return static_cast<std::uint64_t>(count) << kBits * q;
  }
  static __device__ __forceinline__ std::uint32_t get(std::uint64_t counts, int q) {
    return static_cast<std::uint32_t>(counts >> kBits * q) & ((1u << kBits) - 1);
  }
};

}  // namespace padder::detect::cuda
