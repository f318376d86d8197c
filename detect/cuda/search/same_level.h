// SPDX-License-Identifier: MIT
// The search of a warp, 32 consecutive spheres of the order, one a lane, through their own level of dense
// bins. First by codes alone (codes.h): candidates of a row of bins lie side by side, their verdicts are the
// bits of a mask, and what may touch goes to a queue of the warp. Then full warps settle the queue: float
// says which do touch (judge.h), and those are moved together. Only search.cu includes this.
#pragma once
#include "detect/cuda/search/exact_test.h"

namespace padder::detect::cuda {
namespace {

// The queue of a warp, in shared memory: a word for each pair.
struct Queue {
  static constexpr std::uint32_t kFar = 1u << 27, kLane = 27;
  std::uint32_t address, first;  // first: of the warp's spheres
  __device__ __forceinline__ void put(std::uint32_t k, std::uint32_t word) const {
    store_shared(address + 4 * k, word);
  }
  __device__ __forceinline__ std::uint32_t get(std::uint32_t k) const { return load_shared(address + 4 * k); }
  __device__ __forceinline__ std::uint32_t i(std::uint32_t word) const { return first + (word >> kLane); }
  __device__ __forceinline__ std::uint32_t j(std::uint32_t word) const { return first + (word & (kFar - 1)); }
};

// The lane's sphere and where the rows of bins begin and end that hold its partners: what follows it in its
// own row and the forward half of those around.
template <SlotKind Kind>
struct Own {
  typename SlotOf<Kind>::Type slot;
  std::uint32_t place, seeker;
  bool live;  // false: stands for no sphere, behind the last
  std::uint32_t begin[5], end[5];
};
// `downs`: of the way (DownsOf). `finest`: all 32 are known to be of the finest level.
template <SlotKind Kind, class DownsOfWay>
__device__ __forceinline__ Own<Kind> own_of(const Task& task, const Grid& grid, const DownsOfWay& downs,
                                            std::uint32_t first, bool finest = false) {
  const std::uint32_t at = first + (threadIdx.x & 31), last = task.spheres.count - 1;
  Own<Kind> own;
  own.place = min(at, last), own.live = at <= last;
  own.slot = load_slot(slots_of<Kind>(task) + own.place);
  own.seeker = seeker<Kind>(__ldg(task.spheres.codes + own.place));
  std::uint32_t key, row, plane, reach = 1;
  const FloatBins& bins = task.spheres.bins;
  bool keyed = true;
  if constexpr (Kind != SlotKind::fixed_point) {
    if (bins.on) {
      key_of(bins, own.slot.x, own.slot.y, own.slot.z, key);
      row = bins.row, plane = bins.plane, reach = bins.fine, keyed = false;
    }
  }
  if constexpr (Kind == SlotKind::unequal && DownsOfWay::kLevels) {
    if (downs.bins.on) {
      const float4 s = make_float4(own.slot.x, own.slot.y, own.slot.z, own.slot.r);
      const auto in = [&](const FloatBins& b) { key_of(b, s, key), row = b.row, plane = b.plane; };
      if (finest)
        in(downs.bins.level[0]);
      else
        in(downs.bins.level[level_of(downs.bins, s)]);
      keyed = false;
    }
  }
  if (keyed) {
    key = __ldg(task.spheres.keys + own.place);
    const Level& l = grid.level[level_of_key(grid, key)];
    row = l.count[0] + 2, plane = row * (l.count[1] + 2);
  }
  const int m = task.spheres.merge;
  const auto start = [&](std::uint32_t entry) { return __ldg(task.spheres.table + entry); };
  std::uint32_t k = key;
#pragma unroll
  for (int q = 0; q < 5; q++) {
    own.begin[q] = q ? start((k - reach) >> m) : own.place + 1, own.end[q] = start(((k + reach) >> m) + 1);
    k = q == 1 ? key + plane - row : k + row;  // of the next one
  }
  return own;
}

// Candidates `begin` to `end` - 1 of each lane, of which 32 from those a multiple of four before on are
// looked at: bits of those that may touch, the first the highest.
template <SlotKind Kind>
__device__ __forceinline__ std::uint32_t look(const Task& task, std::uint32_t seeker, std::uint32_t begin,
                                              std::uint32_t end, bool live, std::uint32_t& longest) {
  const std::uint32_t skipped = begin & 3, upto = live && end > begin ? end - begin + skipped : 0;
  longest = __reduce_max_sync(kAll, upto);
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
  // Rarely more than eight, rarely fewer than five: both are asked for at once.
  const uint4 c0 = __ldg(four), c1 = __ldg(four + 1);
  next(c0), next(c1);
  std::uint32_t span = 8;
#pragma unroll 1
  for (const std::uint32_t most = min(longest, 32u); span < most; span += 4) next(__ldg(four + span / 4));
  return __funnelshift_lc(0, mask, 32 - span) & __funnelshift_rc(0, ~0u, upto) & ~0u >> skipped;
}

// Candidates to the queue; returns how many. More than it holds: none is in it.
template <SlotKind Kind, Way W>
__device__ __forceinline__ std::uint32_t search_level(const Task& task, const Own<Kind>& own,
                                                      const Queue& queue) {
  std::uint32_t mask[5], from[5];
  if (task.spheres.count > Queue::kFar &&
      __any_sync(kAll, own.end[4] > queue.first && own.end[4] - queue.first > Queue::kFar))
    return kQueue<W> + 1;
    // Of slots only few will be asked for, but soon.
#pragma unroll
  for (int q = 0; q < 5; q++)
    asm volatile("prefetch.global.L1 [%0];" ::"l"(slots_of<Kind>(task) + own.begin[q]));
  // What a hit of the row has for a word, if it is at bit 0.
  const std::uint32_t lane = threadIdx.x & 31, base = (lane << Queue::kLane) - queue.first + 31;
  // Counts of five rows side by side, no more than 32 * 32 each in the warp.
  constexpr int kBits = 12;
  const auto of_row = [](std::uint64_t counts, int q) {
    return static_cast<std::uint32_t>(counts >> kBits * q) & ((1u << kBits) - 1);
  };
  std::uint64_t counts = 0;
#pragma unroll
  for (int q = 0; q < 5; q++) {
    std::uint32_t longest;
    mask[q] = look<Kind>(task, own.seeker, own.begin[q], own.end[q], own.live, longest);
    from[q] = base + (own.begin[q] & ~3u);
    counts |= static_cast<std::uint64_t>(__popc(mask[q])) << kBits * q;
    if (longest > 32) return kQueue<W> + 1;
  }
  std::uint64_t all, before = sum_before(counts, all);
  std::uint32_t total = 0;
#pragma unroll
  for (int q = 0; q < 5; q++) total += of_row(all, q);
  if (total > kQueue<W>) return total;
  // Row after row, so that neighbours in the queue ask for neighbours in memory.
  std::uint32_t row = queue.address;
#pragma unroll
  for (int q = 0; q < 5; q++) {
    std::uint32_t at = row + 4 * of_row(before, q);
    row += 4 * of_row(all, q);
    while (mask[q]) {
      const int bit = 31 - __clz(mask[q]);
      store_shared(at, from[q] - bit);
      mask[q] ^= 1u << bit, at += 4;
    }
  }
  __syncwarp();
  return total;
}

// Those of the queue that touch, moved together, in the same order; `check(words, hit)` tells of some at a
// time, the last word standing for those behind the end.
template <int AtOnce, class Check>
__device__ __forceinline__ std::uint32_t sieve(const Queue& queue, std::uint32_t count, Check check) {
  const std::uint32_t lane = kept(threadIdx.x & 31), below = (1u << lane) - 1;
  std::uint32_t hits = 0;
#pragma unroll 1
  for (std::uint32_t k = 0; k < count; k += 32 * AtOnce) {
    std::uint32_t word[AtOnce];
    bool hit[AtOnce];
#pragma unroll
    for (int u = 0; u < AtOnce; u++) {
      hit[u] = k + 32 * u + lane < count;
      word[u] = queue.get(min(k + 32 * u + lane, count - 1));  // never one that is written over
    }
    check(word, hit);
#pragma unroll
    for (int u = 0; u < AtOnce; u++) {
      const std::uint32_t has = __ballot_sync(kAll, hit[u]);
      if (u == 0) __syncwarp();  // all have read what is written over
      if (hit[u]) queue.put(hits + __popc(has & below), word[u]);
      hits += __popc(has);
    }
  }
  __syncwarp();
  return hits;
}
// Judges one by one those that float is not sure of, and where all are asked for more than their distance.
template <SlotKind Kind, Way W>
__device__ __noinline__ std::uint32_t settle_carefully(const Task& task, const Grid& grid, Queue queue,
                                                       std::uint32_t count) {
  const auto* const slots = slots_of<Kind>(task);
  return sieve<1>(queue, count, [&](const std::uint32_t(&word)[1], bool(&hit)[1]) {
    const std::uint32_t i = queue.i(word[0]), j = queue.j(word[0]);
    if (hit[0]) hit[0] = meets<Kind, W>(task, grid, i, load_slot(slots + i), j, load_slot(slots + j), true);
  });
}
template <SlotKind Kind, Way W>
__device__ __forceinline__ std::uint32_t settle(const Task& task, const Grid& grid, const Queue& queue,
                                                std::uint32_t count) {
  constexpr int kAtOnce = 3;  // pairs that a lane has under way
  const auto* const slots = slots_of<Kind>(task);
  bool doubt = task.judge_all;
  std::uint32_t hits =
      sieve<kAtOnce>(queue, count, [&](const std::uint32_t(&word)[kAtOnce], bool(&hit)[kAtOnce]) {
        typename SlotOf<Kind>::Type a[kAtOnce], b[kAtOnce];
#pragma unroll
        for (int u = 0; u < kAtOnce; u++)
          a[u] = load_slot(slots + queue.i(word[u])), b[u] = load_slot(slots + queue.j(word[u]));
#pragma unroll
        for (int u = 0; u < kAtOnce; u++) {
          bool sure;
          const bool in = within<Kind>(task, a[u], b[u], sure);
          hit[u] = hit[u] && in;
          doubt = doubt || (hit[u] && !sure);
        }
      });
  if (__any_sync(kAll, doubt)) hits = settle_carefully<Kind, W>(task, grid, queue, hits);
  return hits;
}

// Without a queue, for warps with more candidates than it holds and for long rows. With a target, writes the
// hits as those from `base` on of the tile.
template <SlotKind Kind, Way W, class DownsOfWay>
__device__ __noinline__ std::uint32_t search_unqueued(const Task& task, const Grid& grid,
                                                      const DownsOfWay& downs, std::uint32_t first,
                                                      const Target* target, std::uint32_t base) {
  const std::uint32_t lane = threadIdx.x & 31, below = (1u << lane) - 1;
  Own<Kind> own = own_of<Kind>(task, grid, downs, first);
  const auto* const slots = slots_of<Kind>(task);
  std::uint32_t hits = 0;
#pragma unroll 1
  for (int q = 0; q < 5; q++) {
    for (std::uint32_t begin = own.begin[0], longest = 64; longest > 32;) {
      std::uint32_t mask = look<Kind>(task, own.seeker, begin, own.end[0], own.live, longest);
      begin &= ~3u;
      while (__any_sync(kAll, mask != 0)) {
        const int k = __clz(mask);
        const std::uint32_t j = begin + k;
        const bool hit =
            mask && meets<Kind, W>(task, grid, own.place, own.slot, j, load_slot(slots + j), !target);
        if (mask) mask ^= 0x80000000u >> k;
        const std::uint32_t has = __ballot_sync(kAll, hit);
        if (hit && target) put<Kind>(task, *target, base + hits + __popc(has & below), own.place, j);
        hits += __popc(has);
      }
      begin = min(begin + 32, own.end[0]);  // no further than what is there to be read
    }
#pragma unroll
    for (int k = 0; k < 4; k++) own.begin[k] = own.begin[k + 1], own.end[k] = own.end[k + 1];
  }
  return hits;
}

}  // namespace
}  // namespace padder::detect::cuda
