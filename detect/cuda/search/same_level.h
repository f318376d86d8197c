// SPDX-License-Identifier: MIT
// A warp searches for the partners of 32 consecutive spheres, one a lane, at their own level of dense bins.
// Codes are tested first (level_rows.h); what may touch goes to a queue of the warp. Then full warps test the
// queue, and those that touch move together in it. Only .cu files include this.
#pragma once
#include "detect/cuda/device/ptx.h"
#include "detect/cuda/output/output_slots.h"
#include "detect/cuda/search/exact_test.h"
#include "detect/cuda/search/level_rows.h"
#include "detect/cuda/search/long_rows.h"

namespace padder::detect::cuda {

// ---- What a warp found, in shared memory, until its producer has output slots.

// Of a search of the spheres' own level: j follows i, and seldom by more than 2^27, so that a pair is one
// word. In a hashed level it may follow beyond the last sphere, which the first one follows.
template <std::uint32_t Capacity>
struct PairWords {
  static constexpr std::uint32_t kCapacity = Capacity;
  alignas(8) std::uint32_t index[Capacity];
};
struct PairQueue {
  using Word = std::uint32_t;
  static constexpr std::uint32_t kFar = 1u << 27, kLaneShift = 27;
  std::uint32_t address, first, count;  // of the words; of the warp's spheres; spheres in all
  __device__ __forceinline__ void put(std::uint32_t k, std::uint32_t word) const {
    store_shared(address + 4 * k, word);
  }
  __device__ __forceinline__ std::uint32_t get(std::uint32_t k) const { return load_shared(address + 4 * k); }
  __device__ __forceinline__ std::uint32_t i(std::uint32_t word) const {
    return first + (word >> kLaneShift);
  }
  __device__ __forceinline__ std::uint32_t j(std::uint32_t word) const {
    const std::uint32_t at = first + (word & (kFar - 1));
    return min(at, at - count);
  }
};
// The same memory for half as many pairs, of any two spheres.
struct WidePairQueue {
  using Word = uint2;
  std::uint32_t address;
  __device__ __forceinline__ void put(std::uint32_t k, uint2 pair) const {
    store_shared(address + 8 * k, pair.x, pair.y);
  }
  __device__ __forceinline__ uint2 get(std::uint32_t k) const { return load_shared_pair(address + 8 * k); }
  __device__ __forceinline__ std::uint32_t i(uint2 pair) const { return pair.x; }
  __device__ __forceinline__ std::uint32_t j(uint2 pair) const { return pair.y; }
};

// ---- The search.

// Puts the candidates of the rows' rest behind `total` others; `base` as in queue_candidates().
template <SlotKind Kind, std::uint32_t Capacity>
static __device__ __noinline__ std::uint32_t queue_rest(const SearchTask& task, std::uint32_t seeker,
                                                        bool valid, std::uint32_t begin, std::uint32_t end,
                                                        PairQueue queue, std::uint32_t base,
                                                        std::uint32_t total) {
  std::uint32_t longest, all;
  std::uint32_t mask = code_mask<Kind>(task, seeker, begin, end, valid, longest);
  const std::uint32_t before = sum_before(static_cast<std::uint32_t>(__popc(mask)), all);
  if (longest > 32 || total + all > Capacity) return Capacity + 1;
  // The rest lies at the begin of the level, before the sphere itself.
  const std::uint32_t from = base + (begin & ~3u) + (begin < queue.first ? queue.count : 0);
  for (std::uint32_t at = queue.address + 4 * (total + before); mask; at += 4) {
    const int bit = 31 - __clz(mask);
    store_shared(at, from - bit);
    mask ^= 1u << bit;
  }
  return total + all;
}

// Puts candidates in the queue and returns how many there are. Where the result exceeds the capacity none is
// in it.
template <SlotKind Kind, std::uint32_t Capacity>
__device__ __forceinline__ std::uint32_t queue_candidates(const SearchTask& task,
                                                          const LevelQuery<Kind>& query,
                                                          const PairQueue& queue) {
  std::uint32_t mask[kRows], from[kRows];
  if (task.spheres.hashed && queue.count > PairQueue::kFar / 2) return Capacity + 1;
  if (task.spheres.count > PairQueue::kFar &&
      __any_sync(kFullWarp, query.end[4] > queue.first && query.end[4] - queue.first > PairQueue::kFar))
    return Capacity + 1;
    // Few of the slots will be needed, but those soon.
#pragma unroll
  for (int q = 0; q < kRows; q++) prefetch_l1(slots_of<Kind>(task) + query.begin[q]);
  // The word of the candidate at bit 0 of a row that begins at index 0.
  const std::uint32_t lane = threadIdx.x & 31, base = (lane << PairQueue::kLaneShift) - queue.first + 31;
  std::uint64_t counts = 0;
#pragma unroll
  for (int q = 0; q < kRows; q++) {
    std::uint32_t longest;
    mask[q] = code_mask<Kind>(task, query.seeker, query.begin[q], query.end[q], query.valid, longest);
    from[q] = base + (query.begin[q] & ~3u);
    if (task.spheres.hashed && query.begin[q] < queue.first) from[q] += queue.count;
    counts |= RowCounts::put(__popc(mask[q]), q);
    if (longest > 32) return Capacity + 1;
  }
  std::uint64_t all, before = sum_before(counts, all);
  std::uint32_t total = 0;
#pragma unroll
  for (int q = 0; q < kRows; q++) total += RowCounts::get(all, q);
  if (total > Capacity) return total;
  // Row after row, so that neighbours in the queue read neighbours in memory.
  std::uint32_t row = queue.address;
#pragma unroll
  for (int q = 0; q < kRows; q++) {
    std::uint32_t at = row + 4 * RowCounts::get(before, q);
    row += 4 * RowCounts::get(all, q);
    while (mask[q]) {
      const int bit = 31 - __clz(mask[q]);
      store_shared(at, from[q] - bit);
      mask[q] ^= 1u << bit, at += 4;
    }
  }
  if (query.split)
    total = queue_rest<Kind, Capacity>(task, query.seeker, query.valid, query.rest_begin, query.rest_end,
                                       queue, base, total);
  __syncwarp();
  return total;
}

// Keeps those of the queue that pass `check`, in the same order. `check(words, hit)` is given AtOnce pairs of
// a lane and says which of them hit; behind the end it is given the last pair again.
template <int AtOnce, class Queue, class Check>
__device__ __forceinline__ std::uint32_t keep_those(const Queue& queue, std::uint32_t count, Check check) {
  const std::uint32_t lane = kept_in_register(threadIdx.x & 31), below = (1u << lane) - 1;
  std::uint32_t hits = 0;
#pragma unroll 1
  for (std::uint32_t k = 0; k < count; k += 32 * AtOnce) {
    typename Queue::Word word[AtOnce];
    bool hit[AtOnce];
#pragma unroll
    for (int u = 0; u < AtOnce; u++) {
      hit[u] = k + 32 * u + lane < count;
      word[u] = queue.get(min(k + 32 * u + lane, count - 1));  // never one that is written over
    }
    check(word, hit);
#pragma unroll
    for (int u = 0; u < AtOnce; u++) {
      const std::uint32_t has = __ballot_sync(kFullWarp, hit[u]);
      if (u == 0) __syncwarp();  // all have read what is written over
      if (hit[u]) queue.put(hits + __popc(has & below), word[u]);
      hits += __popc(has);
    }
  }
  __syncwarp();
  return hits;
}
// Tests the pairs of the queue one by one: float is not sure of some, or something beside the distance
// counts. counts: are doubtful pairs to be counted?
template <SlotKind Kind, class Queue>
static __device__ __noinline__ std::uint32_t test_queue_exactly(const SearchTask& task, Queue queue,
                                                                std::uint32_t count, bool counts) {
  const auto* const slots = slots_of<Kind>(task);
  std::uint32_t doubtful = 0;
  const std::uint32_t hits =
      keep_those<1>(queue, count, [&](const typename Queue::Word(&word)[1], bool(&hit)[1]) {
        const std::uint32_t i = queue.i(word[0]), j = queue.j(word[0]);
        if (hit[0]) hit[0] = test<Kind>(task, i, load_slot(slots + i), j, load_slot(slots + j), doubtful);
      });
  if (counts) count_doubtful(task, doubtful);
  return hits;
}
// `doubt`: float is not enough for the lane's own sphere. MayRound: slots may be doubles rounded to float.
template <SlotKind Kind, bool MayRound, class Queue>
__device__ __forceinline__ std::uint32_t test_queue(const SearchTask& task, const Queue& queue,
                                                    std::uint32_t count, bool doubt, bool counts) {
  constexpr int kAtOnce = 3;  // pairs that a lane has under way
  const auto* const slots = slots_of<Kind>(task);
  std::uint32_t hits =
      keep_those<kAtOnce>(queue, count, [&](const typename Queue::Word(&word)[kAtOnce], bool(&hit)[kAtOnce]) {
        typename SlotOf<Kind>::Type a[kAtOnce], b[kAtOnce];
#pragma unroll
        for (int u = 0; u < kAtOnce; u++)
          a[u] = load_slot(slots + queue.i(word[u])), b[u] = load_slot(slots + queue.j(word[u]));
#pragma unroll
        for (int u = 0; u < kAtOnce; u++) {
          bool sure;
          const bool in = float_test<Kind>(task, a[u], b[u], MayRound && task.spheres.rounded, sure);
          hit[u] = hit[u] && in;
          doubt = doubt || (hit[u] && !sure);
        }
      });
  if (__any_sync(kFullWarp, doubt)) hits = test_queue_exactly<Kind>(task, queue, hits, counts);
  return hits;
}

// Emits what is in the queue, as numbers `before` onwards of the producer.
template <SlotKind Kind, class Queue>
__device__ __forceinline__ void emit_queue(const SearchTask& task, const Queue& queue, std::uint32_t count,
                                           const OutputRange& range, std::uint32_t before) {
  emit_by_warp<Kind>(task, range, count, before, [&](std::uint32_t k, std::uint32_t& i, std::uint32_t& j) {
    const auto word = queue.get(k);
    i = queue.i(word), j = queue.j(word);
  });
}
// Slots for so many contacts of a warp, in any order.
static __device__ __forceinline__ OutputRange reserve_for_warp(const SearchTask& task, std::uint32_t count) {
  Word slot = 0;
  if ((threadIdx.x & 31) == 0) slot = atomicAdd(&task.counters->contacts, static_cast<Word>(count));
  return {__shfl_sync(kFullWarp, slot, 0), 0, ~0u, 0, 0};
}

// For warps with more candidates than their queue holds, and for long rows: whenever the queue is full, its
// pairs are tested, and it begins anew. In any order the contacts are written at once; the result is 0. In a
// stable order they are counted without a range, and emitted with one, as numbers `before` onwards of the
// tile.
template <SlotKind Kind, class Words, class Pairs>
static __device__ __noinline__ std::uint32_t search_in_parts(const SearchTask& task, const Grid& grid,
                                                             const Pairs& pairs, Words& words,
                                                             std::uint32_t first, const OutputRange* range,
                                                             std::uint32_t before) {
  const WidePairQueue queue{shared_address(words.index)};
  const std::uint32_t below = (1u << (threadIdx.x & 31)) - 1;
  std::uint32_t waiting = 0, found = 0;
  const auto take_waiting = [&] {
    __syncwarp();
    const std::uint32_t hits = test_queue<Kind, true>(task, queue, waiting, task.test_all, !range);
    if (range || !task.stable_order) {
      const OutputRange to = range ? *range : reserve_for_warp(task, hits);
      // Beyond the capacity they are counted alone, and the caller searches again.
      if (range || to.slot + hits <= task.output.capacity)
        emit_queue<Kind>(task, queue, hits, to, range ? before + found : 0);
    }
    __syncwarp();
    found += hits, waiting = 0;
  };
  LevelQuery<Kind> query = level_query<Kind>(task, grid, pairs, first);
  const int rows = query.split ? kRows + 1 : kRows;
#pragma unroll 1
  for (int q = 0; q < rows; q++) {
    if (task.defers) {
      if (!query.valid) query.end[0] = query.begin[0];
      if (!range)
        query.end[0] = defer_long_row(task, query.index, query.begin[0], query.end[0], tuning::kLongRow);
      else if (query.end[0] > query.begin[0] + tuning::kLongRow)  // they were deferred the first time
        query.end[0] = query.begin[0];
    }
    for (std::uint32_t begin = query.begin[0], longest = 64; longest > 32;) {
      std::uint32_t mask = code_mask<Kind>(task, query.seeker, begin, query.end[0], query.valid, longest);
      begin &= ~3u;
      while (const std::uint32_t has = __ballot_sync(kFullWarp, mask != 0)) {
        if (waiting + 32 > Words::kCapacity / 2) take_waiting();
        const int k = __clz(mask);
        if (mask)
          queue.put(waiting + __popc(has & below), {query.index, begin + k}), mask ^= 0x80000000u >> k;
        waiting += __popc(has);
      }
      begin = min(begin + 32, query.end[0]);  // no further than what may be read
    }
    // The next row becomes row 0: a row number that is not constant would put the arrays in local memory.
#pragma unroll
    for (int k = 0; k + 1 < kRows; k++) query.begin[k] = query.begin[k + 1], query.end[k] = query.end[k + 1];
    if (query.split) query.begin[kRows - 1] = query.rest_begin, query.end[kRows - 1] = query.rest_end;
  }
  if (waiting) take_waiting();
  return task.stable_order ? found : 0;
}

// The contacts of the 32 spheres from `first` on, in the queue unless kQueueOverflow is set. Contacts that
// are written already are not counted. `flags`: of the counters; where any is set the table is not whole, and
// the caller of the search will order the spheres in another way.
template <SlotKind Kind, bool MayRound = true, class Words, class Pairs>
__device__ __forceinline__ bool find_same_level(const SearchTask& task, const Grid& grid, const Pairs& pairs,
                                                Words& words, std::uint32_t first, std::uint32_t flags,
                                                std::uint32_t& found) {
  const PairQueue queue{shared_address(words.index), first, task.spheres.count};
  const LevelQuery<Kind> query = level_query<Kind>(task, grid, pairs, first);
  if (flags) return false;
  bool doubt = task.test_all;
  if constexpr (!Pairs::kSeveralLevels)  // there the slot's registers would cost more than this gains
    doubt = doubt && !(task.only_owner && owns_contacts_of<Kind>(task, query.slot));
  const std::uint32_t queued = queue_candidates<Kind, Words::kCapacity>(task, query, queue);
  if (queued <= Words::kCapacity)
    found = test_queue<Kind, MayRound>(task, queue, queued, doubt, true);
  else
    found = search_in_parts<Kind>(task, grid, pairs, words, first, nullptr, 0) |
            (task.stable_order ? kQueueOverflow : 0);
  return true;
}
template <SlotKind Kind, class Words, class Pairs>
__device__ __forceinline__ void emit_same_level(const SearchTask& task, const Grid& grid, const Pairs& pairs,
                                                Words& words, std::uint32_t first, std::uint32_t found,
                                                const OutputRange& range, std::uint32_t before) {
  if (found & kQueueOverflow)
    search_in_parts<Kind>(task, grid, pairs, words, first, &range, before);
  else
    emit_queue<Kind>(task, PairQueue{shared_address(words.index), first, task.spheres.count}, found, range,
                     before);
}

}  // namespace padder::detect::cuda
