// Places in the list, given out to tiles. For any order by one atomic addition. For a fixed order a tile has
// its share of places to itself, wherever the others are; what it finds beyond them spills over, and what it
// leaves spare is filled afterwards, the n-th spare place by the n-th hit that spilled, counted in the order
// of the tiles. The share is a little less than the mean (of tiles of spheres, and of those that look down),
// so that all that spares is filled and few hits move; nobody waits for anybody. Only cuda_search.cu includes
// this.
#pragma once
#include <cub/block/block_reduce.cuh>
#include <cub/block/block_scan.cuh>

#include "detect/cuda_judge.h"

namespace padder::detect::cuda {
namespace {

constexpr int kGroupTiles = 1024, kFillTiles = 8;
using Word = unsigned long long;

__device__ __forceinline__ std::uint32_t share_of(const Task& task, std::uint32_t tile) {
  return tile < task.own_tiles ? task.options.share.own : task.options.share.down;
}
// The first place of a tile; of the number of tiles, the end of all shares.
__device__ __forceinline__ Word base_of(const Task& task, std::uint32_t tile) {
  const std::uint32_t own = min(tile, task.own_tiles);
  return static_cast<Word>(own) * task.options.share.own +
         static_cast<Word>(tile - own) * task.options.share.down;
}
__device__ __forceinline__ Target take_place(const Task& task, std::uint32_t tile, std::uint32_t sum) {
  if (!task.options.fixed_order)
    return {sum ? atomicAdd(&task.counters->contacts, static_cast<Word>(sum)) : 0, 0, ~0u};
  const std::uint32_t share = share_of(task, tile), spilled = sum > share ? sum - share : 0;
  Word* const group = task.sums.groups + tile / kGroupTiles * 2;
  Target t{base_of(task, tile), 0, share};
  if (spilled) t.spill = atomicAdd(&task.counters->spilled, static_cast<Word>(spilled));
  if (spilled) atomicAdd(group + 1, static_cast<Word>(spilled));
  if (sum < share) atomicAdd(group, static_cast<Word>(share - sum));
  task.sums.counts[tile] = sum, task.sums.spill_at[tile] = t.spill;
  return t;
}

// What was spare and what spilled before each tile, and the number of contacts.
__global__ void __launch_bounds__(kGroupTiles) count_places_kernel(const __grid_constant__ Task task) {
  using Reduce = cub::BlockReduce<Word, kGroupTiles>;
  using Scan = cub::BlockScan<Word, kGroupTiles>;
  __shared__ union {
    typename Reduce::TempStorage reduce;
    typename Scan::TempStorage scan;
  } memory;
  __shared__ Word shared_before[2];
  if (task.counters->flags) return;
  const std::uint32_t tile = blockIdx.x * kGroupTiles + threadIdx.x, share = share_of(task, tile);
  for (int which = 0; which < 2; which++) {
    Word sum = 0;
    for (std::uint32_t k = threadIdx.x; k < blockIdx.x; k += kGroupTiles)
      sum += task.sums.groups[2 * k + which];
    sum = Reduce(memory.reduce).Sum(sum);
    if (threadIdx.x == 0) shared_before[which] = sum;
    __syncthreads();
  }
  const bool valid = tile < task.tiles;
  const std::uint32_t count = valid ? task.sums.counts[tile] : 0;
  const Word own = Reduce(memory.reduce).Sum(tile < task.own_tiles ? count : 0);
  if (threadIdx.x == 0) atomicAdd(&task.counters->own, own);
  __syncthreads();
  Word before[2], total[2];
  for (int which = 0; which < 2; which++) {
    const Word mine = !valid  ? 0
                      : which ? (count > share ? count - share : 0)
                              : (count < share ? share - count : 0);
    Scan(memory.scan).ExclusiveSum(mine, before[which], total[which]);
    before[which] += shared_before[which], total[which] += shared_before[which];
    __syncthreads();
  }
  if (valid) task.sums.spares[tile] = before[0], task.sums.spills[tile] = before[1];
  if (blockIdx.x + 1 == gridDim.x && threadIdx.x == 0) {
    task.sums.spares[task.tiles] = total[0];
    task.counters->contacts = base_of(task, task.tiles) - total[0] + total[1];
  }
}

// The last tile with spares[tile] <= n, by the whole warp: 33 parts a step.
__device__ __forceinline__ std::uint32_t tile_of_spare(const Task& task, Word n) {
  std::uint32_t low = 0, high = task.tiles;  // spares[low] <= n < spares[high]
  while (high - low > 1) {
    const std::uint32_t step = (high - low + 32) / 33, at = low + (1 + (threadIdx.x & 31)) * step;
    const std::uint32_t below = __popc(__ballot_sync(kAll, at < high && __ldg(task.sums.spares + at) <= n));
    low += below * step;
    if (low + step < high) high = low + step;
  }
  return low;
}

// The hits that spilled, of some tiles a block (or several blocks, where tiles may have many): a warp looks
// for each tile's first spare place, then all threads share the hits.
template <SlotKind Kind>
__global__ void __launch_bounds__(32 * kFillTiles, 6) fill_kernel(const __grid_constant__ Task task) {
  __shared__ std::uint32_t counts[kFillTiles], lows[kFillTiles];
  if (task.counters->flags) return;
  const std::uint32_t warp = threadIdx.x >> 5, first = blockIdx.x * kFillTiles, tile = first + warp;
  const std::uint32_t count = tile < task.tiles ? task.sums.counts[tile] : 0, share = share_of(task, tile),
                      spilled = count > share ? count - share : 0;
  const Word *const spares = task.sums.spares, spare = spares[task.tiles];
  if (spilled) {
    const Word number = task.sums.spills[tile];
    const std::uint32_t low = number < spare ? tile_of_spare(task, number) : 0;
    lows[warp] = low;
  }
  counts[warp] = spilled;
  __syncthreads();
  std::uint32_t total = 0;
  for (int t = 0; t < kFillTiles; t++) total += counts[t];
  for (std::uint32_t at = blockIdx.y * blockDim.x + threadIdx.x; at < total; at += gridDim.y * blockDim.x) {
    std::uint32_t k = at, t = 0;
    while (k >= counts[t]) k -= counts[t++];
    const Word n = task.sums.spills[first + t] + k, from = task.sums.spill_at[first + t] + k;
    Word to = base_of(task, task.tiles) + n - spare;
    if (n < spare) {
      std::uint32_t low = lows[t], step = 1;
      while (low + step < task.tiles && __ldg(spares + low + step) <= n) low += step, step *= 2;
      while (step /= 2)
        if (low + step < task.tiles && __ldg(spares + low + step) <= n) low += step;
      to = base_of(task, low) + task.sums.counts[low] + n - spares[low];
    }
    if (from >= task.sums.room || to >= task.output.capacity) continue;  // the search is repeated
    const Word hit = task.sums.spill[from];
    write_record<Kind>(task, static_cast<std::uint32_t>(hit >> 32), static_cast<std::uint32_t>(hit), to);
  }
}

}  // namespace
}  // namespace padder::detect::cuda
