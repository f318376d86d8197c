// SPDX-License-Identifier: MIT
// Several levels: blocks of threads take tiles of spheres, which search their own level; behind them are
// blocks whose warps take units, which search another level.
#include "detect/cuda/device/overlapped_launch.h"
#include "detect/cuda/search/launch.h"
#include "detect/cuda/search/same_level.h"
#include "detect/cuda/search/tile_search.h"
#include "detect/cuda/search/unit_rows.h"
#include "detect/cuda/tuning.h"

namespace padder::detect::cuda {
namespace {

// Of a search of other levels: the index of j, and the lane or query of i.
template <std::uint32_t Capacity>
struct ContactQueue {
  static constexpr std::uint32_t kCapacity = Capacity;
  alignas(8) std::uint32_t index[Capacity];
  unsigned char who[Capacity];
};

// Tiles use the `index` of it as the words of a PairQueue.
using UnitQueue = ContactQueue<tuning::kUnitQueue>;

// Tests those of the queue one by one, where float is not sure of all or something beside the distance
// counts. Contacts move together, in the same order. counts: are doubtful pairs to be counted?
template <SlotKind Kind>
__device__ __noinline__ std::uint32_t test_unit_exactly(const SearchTask& task, UnitQueue& queue,
                                                        const UnitQueries<Kind>& queries, std::uint32_t count,
                                                        bool counts) {
  const auto* const slots = slots_of<Kind>(task);
  const std::uint32_t lane = threadIdx.x & 31, below = (1u << lane) - 1;
  std::uint32_t hits = 0, doubtful = 0;
#pragma unroll 1
  for (std::uint32_t from = 0; from < count; from += 32) {
    const std::uint32_t k = min(from + lane, count - 1), j = queue.index[k], query = queue.who[k];
    const bool hit = from + lane < count && test<Kind>(task, queries.index(query), queries.slot[query], j,
                                                       load_slot(slots + j), doubtful);
    const std::uint32_t has = __ballot_sync(kFullWarp, hit), to = hits + __popc(has & below);
    __syncwarp();  // all have read what is written over
    if (hit) queue.index[to] = j, queue.who[to] = static_cast<unsigned char>(query);
    hits += __popc(has);
    __syncwarp();
  }
  if (counts) count_doubtful(task, doubtful);
  return hits;
}

// Emits what is in the queue, as numbers `before` onwards of the producer.
template <SlotKind Kind>
__device__ __forceinline__ void emit_unit_queue(const SearchTask& task, const UnitQueue& queue,
                                                const UnitQueries<Kind>& queries, std::uint32_t count,
                                                const OutputRange& range, std::uint32_t before) {
  emit_by_warp<Kind>(task, range, count, before, [&](std::uint32_t k, std::uint32_t& i, std::uint32_t& j) {
    i = queries.index(queue.who[k]), j = queue.index[k];
  });
}

// For units with more contacts than their queue holds: whenever it is full, its pairs are tested, and it
// begins anew. In any order the contacts are written at once; the result is 0. In a stable order they are
// counted without a range, and emitted with one, as numbers `before` onwards of the producer.
template <SlotKind Kind>
__device__ __noinline__ std::uint32_t search_unit_in_parts(const SearchTask& task, const Grid& grid,
                                                           const LevelPairs& pairs, UnitQueue& queue,
                                                           UnitQueries<Kind>& queries, std::uint32_t warp,
                                                           std::uint32_t nth, const OutputRange* range,
                                                           std::uint32_t before) {
  const std::uint32_t below = (1u << (threadIdx.x & 31)) - 1;
  bool doubt = task.test_all;
  std::uint32_t waiting = 0, found = 0;
  const auto take_waiting = [&] {
    __syncwarp();
    const std::uint32_t hits = __any_sync(kFullWarp, doubt)
                                   ? test_unit_exactly<Kind>(task, queue, queries, waiting, !range)
                                   : waiting;
    if (range) {
      for (std::uint32_t k = threadIdx.x & 31; k < hits; k += 32)
        emit<Kind>(task, *range, before + found + k, queries.index(queue.who[k]), queue.index[k]);
    } else if (!task.stable_order) {
      const OutputRange to = reserve_for_warp(task, hits);
      // Beyond the capacity they are counted alone, and the caller searches again.
      if (to.slot + hits <= task.output.capacity) emit_unit_queue<Kind>(task, queue, queries, hits, to, 0);
    }
    __syncwarp();
    found += hits, waiting = 0, doubt = task.test_all;
  };
  search_rows<Kind>(task, grid, pairs, queries, warp, nth, false,
                    [&](bool valid, std::uint32_t query, std::uint32_t j, const auto& b) {
                      bool sure;
                      const bool hit =
                          float_test<Kind>(task, queries.slot[query], b, task.spheres.rounded, sure) && valid;
                      const std::uint32_t has = __ballot_sync(kFullWarp, hit);
                      if (waiting + __popc(has) > UnitQueue::kCapacity) take_waiting();
                      doubt = doubt || (hit && !sure);
                      const std::uint32_t to = waiting + __popc(has & below);
                      if (hit) queue.index[to] = j, queue.who[to] = static_cast<unsigned char>(query);
                      waiting += __popc(has);
                    });
  if (waiting) take_waiting();
  return task.stable_order ? found : 0;
}

// The contacts of unit number `nth` of those of a warp, in the queue unless kQueueOverflow is set. Contacts
// that are written already are not counted.
template <SlotKind Kind>
__device__ __forceinline__ std::uint32_t search_unit(const SearchTask& task, const Grid& grid,
                                                     const LevelPairs& pairs, UnitQueue& queue,
                                                     UnitQueries<Kind>& queries, std::uint32_t warp,
                                                     std::uint32_t nth) {
  const std::uint32_t below = (1u << (threadIdx.x & 31)) - 1;
  bool doubt = task.test_all;
  std::uint32_t hits = 0;
  search_rows<Kind>(
      task, grid, pairs, queries, warp, nth, true,
      [&](bool valid, std::uint32_t query, std::uint32_t j, const auto& b) {
        bool sure;
        const bool hit = float_test<Kind>(task, queries.slot[query], b, task.spheres.rounded, sure) && valid;
        doubt = doubt || (hit && !sure);
        const std::uint32_t has = __ballot_sync(kFullWarp, hit), to = hits + __popc(has & below);
        if (hit && to < UnitQueue::kCapacity)
          queue.index[to] = j, queue.who[to] = static_cast<unsigned char>(query);
        hits += __popc(has);
      });
  __syncwarp();
  if (hits > UnitQueue::kCapacity)
    return search_unit_in_parts<Kind>(task, grid, pairs, queue, queries, warp, nth, nullptr, 0) |
           (task.stable_order ? kQueueOverflow : 0);
  if (__any_sync(kFullWarp, doubt)) hits = test_unit_exactly<Kind>(task, queue, queries, hits, true);
  return hits;
}

// Emits the contacts of a unit that lane 0 has reserved slots for.
template <SlotKind Kind>
__device__ __forceinline__ void emit_unit(const SearchTask& task, const Grid& grid, const LevelPairs& pairs,
                                          UnitQueue& queue, UnitQueries<Kind>& queries, std::uint32_t warp,
                                          std::uint32_t nth, std::uint32_t found, Word slot) {
  const std::uint32_t lane = threadIdx.x & 31, hits = found & ~kQueueOverflow,
                      here = task.stable_order ? min(hits, queries.range.quota) : hits;
  if (slot + here > task.output.capacity) {
    // The contacts are counted: the caller makes the list longer and searches again.
  } else if (found & kQueueOverflow) {
    search_unit_in_parts<Kind>(task, grid, pairs, queue, queries, warp, nth, &queries.range, 0);
  } else {
    for (std::uint32_t k = lane; k < here; k += 32)
      write_record<Kind>(task, queries.index(queue.who[k]), queue.index[k], slot + k);
    for (std::uint32_t k = here + lane; k < hits; k += 32)
      spill(task, queries.range, k, queries.index(queue.who[k]), queue.index[k]);
  }
}

// The warp takes units one after the other, as long as there are any.
template <SlotKind Kind>
__device__ __forceinline__ void search_units(const SearchTask& task, const Grid& grid,
                                             const LevelPairs& pairs, UnitQueue& queue,
                                             UnitQueries<Kind>& queries) {
  const std::uint32_t lane = threadIdx.x & 31;
  if (task.stable.unit_quotas) wait_for_previous_kernel();
  do {
    std::uint32_t warp = (blockIdx.x - task.tiles) * kTileWarps + (threadIdx.x >> 5);
    if (task.next) {
      if (lane == 0) {
        warp = atomicAdd(task.next, 1u);
        // The last to find nothing leaves the counter as it was.
        if (warp + 1 == pairs.warps + (gridDim.x - task.tiles) * kTileWarps) *task.next = 0;
      }
      warp = __shfl_sync(kFullWarp, warp, 0);
    }
    if (warp >= pairs.warps) return;
    for (std::uint32_t nth = 0;; nth++) {
      const std::uint32_t found = search_unit<Kind>(task, grid, pairs, queue, queries, warp, nth);
      __syncwarp();  // other lanes' contacts are read below
      Word slot = 0;
      if (lane == 0) {
        const OutputRange r = reserve_for_unit(task, queries.unit, queries.first, found & ~kQueueOverflow);
        queries.range = r, slot = r.slot;
      }
      // By a shuffle and not through shared memory: lanes 1 to 31 wait here, or the warp stays divided.
      slot = __shfl_sync(kFullWarp, slot, 0);
      __syncwarp();  // the range is read below
      const bool more = queries.more;
      // The units after it that are empty: no contact was expected of them.
      if (task.stable_order && !more && lane < queries.left)
        task.stable.net[task.tiles + queries.unit + 1 + lane] = 0;
      emit_unit<Kind>(task, grid, pairs, queue, queries, warp, nth, found, slot);
      __syncwarp();
      if (!more) break;
    }
  } while (task.next);
}

// A tile of spheres or, where tiles wait for those before them, of four units.
template <SlotKind Kind>
struct SeveralLevels {
  using Pairs = LevelPairs;
  using Queue = UnitQueue;
  using State = UnitQueries<Kind>;
  static __device__ __forceinline__ bool find(const SearchTask& task, const Grid& grid, const Pairs& pairs,
                                              Queue& queue, State& queries, std::uint32_t number,
                                              std::uint32_t warp, std::uint32_t flags, std::uint32_t& found) {
    if (number < task.tiles) {
      const std::uint32_t first = (number * kTileWarps + warp) * 32;
      return first >= task.spheres.count ||
             find_same_level<Kind>(task, grid, pairs, queue, first, flags, found);
    }
    const std::uint32_t unit_warp = (number - task.tiles) * kTileWarps + warp;
    if (unit_warp < pairs.warps) found = search_unit<Kind>(task, grid, pairs, queue, queries, unit_warp, 0);
    return true;
  }
  static __device__ __forceinline__ void emit(const SearchTask& task, const Grid& grid, const Pairs& pairs,
                                              Queue& queue, State& queries, std::uint32_t number,
                                              std::uint32_t warp, std::uint32_t found,
                                              const OutputRange& range, std::uint32_t before) {
    if (number < task.tiles)
      emit_same_level<Kind>(task, grid, pairs, queue, (number * kTileWarps + warp) * 32, found, range,
                            before);
    else if (found & kQueueOverflow)
      search_unit_in_parts<Kind>(task, grid, pairs, queue, queries, (number - task.tiles) * kTileWarps + warp,
                                 0, &range, before);
    else
      emit_unit_queue<Kind>(task, queue, queries, found, range, before);
  }
};

template <SlotKind Kind>
__global__ void __launch_bounds__(kTileSpheres, tuning::kSeveralLevelsBlocks)
    several_levels_kernel(const __grid_constant__ SearchTask task, const __grid_constant__ Grid grid,
                          const __grid_constant__ LevelPairs pairs) {
  __shared__ TileMemory<SeveralLevels<Kind>> memory;
  const bool ordered = task.stable.ordered;
  if (ordered && threadIdx.x == 0) memory.search_number = ordered_search_number(task);
  // Where a flag is set the table is not whole, and the caller will order the spheres in another way.
  if (task.counters->flags) return;
  const std::uint32_t number = kept_in_register(blockIdx.x);
  if (!ordered && number >= task.tiles) {
    const std::uint32_t warp = threadIdx.x >> 5;
    search_units<Kind>(task, grid, pairs, memory.queue[warp], memory.state[warp]);
    return;
  }
  search_tile<SeveralLevels<Kind>>(task, grid, pairs, memory, number, ordered, 0);
}

}  // namespace

unsigned resident_several_levels(SlotKind kind, int processors) {
  unsigned blocks = 0;
  with_kind(kind, [&](auto k) {
    blocks = resident_blocks(reinterpret_cast<const void*>(several_levels_kernel<k()>), kTileSpheres, 0,
                             processors);
  });
  return blocks;
}

void launch_several_levels(const SearchTask& task, const Grid& grid, const LevelPairs& pairs, int processors,
                           cudaStream_t stream) {
  const std::uint32_t unit_blocks = (pairs.warps + kTileWarps - 1) / kTileWarps,
                      fill = static_cast<std::uint32_t>(processors) * tuning::kSeveralLevelsBlocks,
                      blocks = task.tiles + (task.next ? std::min(unit_blocks, fill) : unit_blocks);
  // Quotas of units are computed beside the search of the tiles: the search starts once all blocks that
  // compute quotas run, and units wait for their end.
  const bool quotas = task.stable.unit_quotas && !task.stable.ordered;
  if (quotas) launch_unit_quotas(task, grid, pairs, false, processors, stream);
  with_kind(task.spheres.kind, [&](auto kind) {
    if (quotas)
      launch_overlapped(several_levels_kernel<kind()>, {blocks, kTileSpheres}, stream, task, grid, pairs);
    else
      several_levels_kernel<kind()><<<blocks, kTileSpheres, 0, stream>>>(task, grid, pairs);
  });
  cuda_launched("search for contacts");
}

}  // namespace padder::detect::cuda
