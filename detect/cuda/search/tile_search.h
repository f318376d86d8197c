// SPDX-License-Identifier: MIT
// The common course of a tile, whatever family of kernels it belongs to: each warp finds contacts, the block
// reserves slots for all of them, each warp emits its own. Only .cu files include this.
//
// A family is a struct that says how a warp finds and emits:
//   Pairs, Queue, State   parameter of the kernel; what a warp has in shared memory
//   find                  puts the contacts of warp number `warp` of tile `number` in the queue and counts
//   them in
//                         `found`; false: the tile is given up
//   emit                  emits them as numbers `before` onwards of the tile
#pragma once
#include "detect/cuda/output/ordered_tiles.h"
#include "detect/cuda/output/output_slots.h"
#include "detect/cuda/search/search_task.h"

namespace padder::detect::cuda {

template <class Family>
struct TileMemory {
  typename Family::Queue queue[kTileWarps];
  typename Family::State state[kTileWarps];
  std::uint32_t found[kTileWarps];
  OutputRange range[kTileWarps];
  Word before;
  std::uint32_t search_number;  // of ordered_tiles.h
};

// `ordered`: the tile waits for those before it. By all threads of the block.
template <class Family>
__device__ __forceinline__ void search_tile(const SearchTask& task, const Grid& grid,
                                            const typename Family::Pairs& pairs, TileMemory<Family>& memory,
                                            std::uint32_t number, bool ordered, std::uint32_t flags) {
  // By a shuffle: then the compiler knows that all lanes agree.
  const std::uint32_t warp = __shfl_sync(kFullWarp, threadIdx.x >> 5, 0);
  std::uint32_t mine = 0;
  if (!Family::find(task, grid, pairs, memory.queue[warp], memory.state[warp], number, warp, flags, mine))
    return;
  if ((threadIdx.x & 31) == 0) memory.found[warp] = mine;
  __syncthreads();
  std::uint32_t sum = 0, before = 0;
#pragma unroll
  for (std::uint32_t k = 0; k < kTileWarps; k++) {
    const std::uint32_t count = memory.found[k] & ~kQueueOverflow;
    sum += count, before += k < warp ? count : 0;
  }
  if (ordered) {
    const Word slot = slots_before_tile(task, memory.search_number, sum, &memory.before);
    if ((threadIdx.x & 31) == 0) memory.range[warp] = {slot, 0, ~0u, 0, 0};
    __syncwarp();
  } else {
    if (threadIdx.x == 0) memory.range[0] = reserve_for_tile(task, number, sum);
    __syncthreads();
  }
  const OutputRange& range = memory.range[ordered ? warp : 0];
  if (range.slot + min(sum, range.quota) > task.output.capacity)
    return;  // the contacts are counted: the caller makes the list longer and searches again
  Family::emit(task, grid, pairs, memory.queue[warp], memory.state[warp], number, warp, memory.found[warp],
               range, before);
}

}  // namespace padder::detect::cuda
