// SPDX-License-Identifier: MIT
// Compaction in one kernel, for many tiles and no units: a block moves what some tiles spilled.
#include <cub/block/block_scan.cuh>

#include "detect/cuda/output/compaction.h"
#include "detect/cuda/output/spilled_contact.h"
#include "detect/cuda/warp.h"

namespace padder::detect::cuda {
namespace {

constexpr int kThreads = 256, kBlockTiles = 32;

struct FillMemory {
  cub::BlockScan<Word, kThreads>::TempStorage groups;
  cub::BlockScan<std::uint32_t, kThreads>::TempStorage tiles;
  std::uint32_t begins[kBlockTiles], total, left[kGroupProducers], group;
  Word spills[kBlockTiles], sums[3][kThreads / 32], spare;
};
// The tile of the hit that is `at`-th of the block's.
__device__ __forceinline__ std::uint32_t tile_of(const FillMemory& memory, std::uint32_t at) {
  std::uint32_t low = 0;
#pragma unroll
  for (std::uint32_t step = kBlockTiles / 2; step; step /= 2)
    if (memory.begins[low + step] <= at) low += step;
  return low;
}
// Sums of three numbers of all threads.
struct Three {
  Word v[3];
};
__device__ __forceinline__ Three block_sums(FillMemory& memory, Three mine) {
#pragma unroll
  for (int k = 0; k < 3; k++) {
#pragma unroll
    for (int d = 16; d; d >>= 1) mine.v[k] += __shfl_xor_sync(kFullWarp, mine.v[k], d);
    if ((threadIdx.x & 31) == 0) memory.sums[k][threadIdx.x >> 5] = mine.v[k];
  }
  __syncthreads();
  Three all{};
#pragma unroll
  for (int k = 0; k < 3; k++)
    for (int w = 0; w < kThreads / 32; w++) all.v[k] += memory.sums[k][w];
  return all;
}
// The last block leaves the groups of tiles as they were before the search.
__device__ __forceinline__ void leave_groups(const StableOutput& stable) {
  __syncthreads();
  if (threadIdx.x >= 32) return;
  unsigned last = 0;
  if (threadIdx.x == 0) {
    __threadfence();
    last = atomicInc(stable.blocks_done, gridDim.x - 1) + 1 == gridDim.x;
  }
  if (__shfl_sync(kFullWarp, last, 0))
    for (std::uint32_t k = threadIdx.x; k < 2 * stable.all_groups; k += 32) stable.group_sums[k] = 0;
}
__device__ __forceinline__ Word spill_place(const FillMemory& memory, std::uint32_t at) {
  const std::uint32_t t = tile_of(memory, at);
  return memory.spills[t] + (at - memory.begins[t]);
}
template <SlotKind Kind, bool Double>
__device__ __forceinline__ void move(const OutputTask& task, const FillMemory& memory, std::uint32_t at,
                                     Word to) {
  const Word from = spill_place(memory, at);
  if (from >= task.stable.spill_capacity || to >= task.output.capacity) return;  // the search is repeated
  SpilledContact<Kind, Double>(task, __ldg(task.stable.spill + from)).write(task, to);
}
// The thread's first at no less than `from`.
__device__ __forceinline__ std::uint32_t own_from(std::uint32_t from) {
  return from + (threadIdx.x - from) % kThreads;
}

// The hits of some tiles that fill the spare places from the `number`-th on: group after group of the tiles
// that left them.
template <SlotKind Kind, bool Double>
__device__ __forceinline__ void fill_spare(const OutputTask& task, FillMemory& memory, Word number,
                                           std::uint32_t total) {
  constexpr int kEach = kGroupProducers / kThreads;
  const std::uint32_t share = task.quota.tile;
  Word spare = memory.spare;  // before the group
  std::uint32_t done = 0;
  for (std::uint32_t g = memory.group; done < total; g++) {
    std::uint32_t left[kEach], all;
    const std::uint32_t tile = g * kGroupProducers + threadIdx.x * kEach;
    uint4 c = make_uint4(share, share, share, share);
    if (tile < task.tiles) c = *reinterpret_cast<const uint4*>(task.stable.counts + tile);
    const std::uint32_t count[kEach] = {c.x, c.y, c.z, c.w};
#pragma unroll
    for (int u = 0; u < kEach; u++)
      left[u] = tile + u < task.tiles && count[u] < share ? share - count[u] : 0;
    __syncthreads();
    cub::BlockScan<std::uint32_t, kThreads>(memory.tiles).InclusiveSum(left, left, all);
#pragma unroll
    for (int u = 0; u < kEach; u++) memory.left[threadIdx.x * kEach + u] = left[u];
    __syncthreads();
    const auto upto = static_cast<std::uint32_t>(min(spare + all - number, static_cast<Word>(total)));
    for (std::uint32_t at = own_from(done); at < upto; at += kThreads) {
      std::uint32_t low = 0;
      const auto n = static_cast<std::uint32_t>(number + at - spare);  // of the group
      for (std::uint32_t step = kGroupProducers / 2; step; step /= 2)
        if (memory.left[low + step - 1] <= n) low += step;
      const Word end = static_cast<Word>(g * kGroupProducers + low + 1) * share;
      move<Kind, Double>(task, memory, at, end - (memory.left[low] - n));
    }
    done = upto, spare += all;
  }
}

// The group of tiles with the `number`-th spare place, and the spare places before it. `spare`: of the group
// of the thread's number.
__device__ __forceinline__ void find_spare(const OutputTask& task, FillMemory& memory, Word number,
                                           Word spare) {
  Word before = 0;
  for (std::uint32_t g0 = 0; g0 < task.stable.tile_groups; g0 += kThreads) {
    const std::uint32_t g = g0 + threadIdx.x;
    if (g0) spare = g < task.stable.tile_groups ? task.stable.group_sums[2 * g] : 0;
    Word upto, all;
    cub::BlockScan<Word, kThreads>(memory.groups).InclusiveSum(spare, upto, all);
    upto += before;
    if (upto - spare <= number && number < upto) memory.group = g, memory.spare = upto - spare;
    before += all;
    __syncthreads();
    if (number < before) return;
  }
}

// Some tiles of spheres a block, where there are no units.
template <SlotKind Kind, bool Double>
__global__ void __launch_bounds__(kThreads, 6) tile_kernel(const __grid_constant__ OutputTask task) {
  __shared__ FillMemory memory;
  const StableOutput& stable = task.stable;
  const std::uint32_t share = task.quota.tile, first = blockIdx.x * kBlockTiles,
                      group = first / kGroupProducers;
  const auto over = [&](std::uint32_t count) { return count > share ? count - share : 0; };
  // What needs no other's word is asked for all at once. Spare places, spilled hits before the block's, all
  // of them.
  const std::uint32_t flags = task.counters->flags;
  Three mine{};
  Word spare_here = 0;
  for (std::uint32_t g = threadIdx.x; g < stable.all_groups; g += kThreads) {
    const ulonglong2 both = *reinterpret_cast<const ulonglong2*>(stable.group_sums + 2 * g);
    mine.v[0] += both.x, mine.v[1] += g < group ? both.y : 0, mine.v[2] += both.y;
    if (g < kThreads) spare_here = both.x;
  }
  const std::uint32_t tile = group * kGroupProducers + 4 * threadIdx.x;
  if (tile < first) {
    const uint4 c = *reinterpret_cast<const uint4*>(stable.counts + tile);
    mine.v[1] += over(c.x) + over(c.y) + over(c.z) + over(c.w);  // first is a multiple of four
  }
  if (threadIdx.x < 32) {
    const std::uint32_t mine_tile = first + threadIdx.x;
    const bool valid = threadIdx.x < kBlockTiles && mine_tile < task.tiles;
    const std::uint32_t count = valid ? over(stable.counts[mine_tile]) : 0;
    const Word at = valid ? stable.spill_start[mine_tile] : 0;
    std::uint32_t all, before = sum_before(count, all);
    memory.begins[threadIdx.x] = before, memory.spills[threadIdx.x] = at;
    if (threadIdx.x == 0) memory.total = all;
  }
  if (flags) return;
  const Three all = block_sums(memory, mine);
  const Word spares = all.v[0], number = all.v[1], shares = static_cast<Word>(task.tiles) * share;
  if (blockIdx.x == 0 && threadIdx.x == 0)
    task.counters->contacts = task.counters->own = shares - spares + all.v[2];
  // What does not fill a spare place lies behind all shares.
  const Word behind = shares + number - spares;
  const std::uint32_t total = memory.total;
  const auto spare =
      static_cast<std::uint32_t>(number >= spares ? 0 : min(spares - number, static_cast<Word>(total)));
  if (spare) find_spare(task, memory, number, spare_here);
  leave_groups(stable);
  if (spare) fill_spare<Kind, Double>(task, memory, number, spare);
  for (std::uint32_t at = own_from(spare); at < total; at += kThreads)
    move<Kind, Double>(task, memory, at, behind + at);
}

}  // namespace

void compact_tiles(const OutputTask& task, int, cudaStream_t stream) {
  with_record(task, [&](auto kind, auto wide) {
    tile_kernel<kind(), wide()><<<(task.tiles + kBlockTiles - 1) / kBlockTiles, kThreads, 0, stream>>>(task);
  });
  cuda_launched("search for contacts");
}

}  // namespace padder::detect::cuda
