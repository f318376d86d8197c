// Places in the list, given out to tiles: of spheres, then units that look down. For any order by one atomic
// addition. For a fixed order a tile of spheres has its share of places to itself, wherever the others are;
// what it finds beyond them spills over, and what it leaves spare is filled afterwards, the n-th spare place
// by the n-th hit that spilled, counted in the order of the tiles. The share is a little less than the mean,
// so that all that spares is filled and few hits move; nobody waits for anybody. Units that look down find so
// different numbers that each has a share of its own (expect.h), or none where spheres are few. Where tiles
// are so few that all run at once, each waits for those before it instead. Only search.cu includes this.
#pragma once
#include <cub/block/block_scan.cuh>

#include "detect/cuda/judge.h"

namespace padder::detect::cuda {
namespace {

constexpr int kGroupTiles = 1024, kShareUnits = 256, kFillTiles = 32, kFillThreads = 256;
constexpr std::uint32_t kMostTurns = 1056;
using Word = unsigned long long;

// Groups of tiles are of tiles of spheres or of such that look down, not of both.
__device__ __forceinline__ std::uint32_t group_of(const Task& task, std::uint32_t tile) {
  return tile < task.own_tiles ? tile / kGroupTiles
                               : task.sums.own_groups + (tile - task.own_tiles) / kGroupTiles;
}
struct Tiles {
  std::uint32_t first, end;
};
__device__ __forceinline__ Tiles tiles_of(const Task& task, std::uint32_t group) {
  const bool own = group < task.sums.own_groups;
  const std::uint32_t first =
      own ? group * kGroupTiles : task.own_tiles + (group - task.sums.own_groups) * kGroupTiles;
  return {first, min(first + kGroupTiles, own ? task.own_tiles : task.own_tiles + task.units)};
}

// Of a tile of spheres.
__device__ __forceinline__ Target take_place(const Task& task, std::uint32_t tile, std::uint32_t sum) {
  if (!task.options.fixed_order)
    return {sum ? atomicAdd(&task.counters->contacts, static_cast<Word>(sum)) : 0, 0, ~0u, 0, 0};
  const std::uint32_t share = task.options.share.own, spilled = sum > share ? sum - share : 0;
  Word* const group = task.sums.groups + tile / kGroupTiles * 2;
  Target t{static_cast<Word>(tile) * share, 0, share, 0, 0};
  if (spilled) t.spill = atomicAdd(&task.counters->spilled, static_cast<Word>(spilled));
  if (spilled) atomicAdd(group + 1, static_cast<Word>(spilled));
  if (sum < share) atomicAdd(group, static_cast<Word>(share - sum));
  task.sums.counts[tile] = sum, task.sums.spill_at[tile] = t.spill;
  return t;
}

// The word of a unit in `shares`, and what lies behind all shares.
__device__ __forceinline__ std::uint32_t share_of(const TileSums& sums, std::uint32_t unit) {
  return sums.shares ? sums.shares[unit] : 0;
}
__device__ __forceinline__ Word behind_shares(const Task& task) {
  const TileSums& sums = task.sums;
  return sums.shares ? sums.bases[sums.share_groups]
                     : static_cast<Word>(task.own_tiles) * task.options.share.own;
}

// Of a unit.
__device__ __forceinline__ Target take_unit(const Task& task, std::uint32_t unit, std::uint32_t first,
                                            std::uint32_t hits) {
  Counters* const c = task.counters;
  if (!task.options.fixed_order)
    return {hits ? atomicAdd(&c->contacts, static_cast<Word>(hits)) : 0, 0, ~0u, 0, 0};
  const TileSums& sums = task.sums;
  const std::uint32_t tile = task.own_tiles + unit, word = share_of(sums, unit), share = word & kMostShare,
                      spilled = hits > share ? hits - share : 0;
  Word* const group = sums.groups + group_of(task, tile) * 2;
  Target t{0, 0, share, kOfUnit | unit << 5, first};
  if (share) t.place = sums.bases[unit / kShareUnits] + (word >> kShareBits);
  if (spilled) t.spill = atomicAdd(&c->spilled, static_cast<Word>(spilled));
  if (spilled) atomicAdd(group + 1, static_cast<Word>(spilled));
  if (hits < share) atomicAdd(group, static_cast<Word>(share - hits));
  sums.counts[tile] = hits, sums.spill_at[tile] = t.spill, sums.firsts[unit] = first;
  return t;
}

// ---- Few tiles: a tile waits until all tiles before it are counted. Tiles are numbered as they begin, so
// that those before are at work or done and the wait ends, whatever else the device does. turn[0] holds the
// number of the search and that of the next tile, turn[1 + tile] the number of the search and the tile's
// count: nothing has to be cleared in between.
__device__ __forceinline__ Word begin_turn(const Task& task) {
  const Word turn = atomicAdd(task.sums.turn, Word(1));
  if (static_cast<std::uint32_t>(turn) + 1 == gridDim.x) *task.sums.turn = ((turn >> 32) + 1) << 32;
  return turn;
}
// By all threads of the block: the contacts before the tile.
__device__ __forceinline__ Word take_turn(const Task& task, Word turn, std::uint32_t sum, Word* shared) {
  constexpr int kAtATime = 8;
  const auto tile = static_cast<std::uint32_t>(turn);
  const Word mark = ((turn >> 32) + 1) << 32;
  volatile Word* const counts = task.sums.turn + 1;
  if (threadIdx.x == 0) counts[tile] = mark | sum;
  Word before = 0;
  for (std::uint32_t from = threadIdx.x; from < tile; from += kAtATime * kThreads) {
    Word count[kAtATime];
    bool whole;
    do {
      whole = true;
#pragma unroll
      for (int u = 0; u < kAtATime; u++)
        count[u] = from + u * kThreads < tile ? counts[from + u * kThreads] : mark;
#pragma unroll
      for (int u = 0; u < kAtATime; u++) whole = whole && (count[u] ^ mark) >> 32 == 0;
    } while (!whole);
#pragma unroll
    for (int u = 0; u < kAtATime; u++) before += count[u] ^ mark;
  }
#pragma unroll
  for (int d = 16; d; d >>= 1) before += __shfl_xor_sync(kAll, before, d);
  if ((threadIdx.x & 31) == 0) shared[threadIdx.x >> 5] = before;
  __syncthreads();
  before = 0;
  for (int w = 0; w < kWarps; w++) before += shared[w];
  if (threadIdx.x == 0 && tile + 1 == gridDim.x) task.counters->contacts = before + sum;
  return before;
}

// ---- Many tiles: what spilled is put where places are spare, and behind.
struct FillMemory {
  cub::BlockScan<Word, kFillThreads>::TempStorage groups;
  cub::BlockScan<std::uint32_t, kFillThreads>::TempStorage tiles;
  std::uint32_t begins[kFillTiles], total, left[kGroupTiles], group;
  Word spills[kFillTiles], sums[3][kFillThreads / 32], spare;
};
// The tile of the hit that is `at`-th of the block's.
__device__ __forceinline__ std::uint32_t tile_of(const FillMemory& memory, std::uint32_t at) {
  std::uint32_t low = 0;
#pragma unroll
  for (std::uint32_t step = kFillTiles / 2; step; step /= 2)
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
    for (int d = 16; d; d >>= 1) mine.v[k] += __shfl_xor_sync(kAll, mine.v[k], d);
    if ((threadIdx.x & 31) == 0) memory.sums[k][threadIdx.x >> 5] = mine.v[k];
  }
  __syncthreads();
  Three all{};
#pragma unroll
  for (int k = 0; k < 3; k++)
    for (int w = 0; w < kFillThreads / 32; w++) all.v[k] += memory.sums[k][w];
  return all;
}
// The last block leaves the groups of tiles as they were before the search.
__device__ __forceinline__ void leave_groups(const TileSums& sums) {
  __syncthreads();
  if (threadIdx.x >= 32) return;
  unsigned last = 0;
  if (threadIdx.x == 0) {
    __threadfence();
    last = atomicInc(sums.fills, gridDim.x - 1) + 1 == gridDim.x;
  }
  if (__shfl_sync(kAll, last, 0))
    for (std::uint32_t k = threadIdx.x; k < 2 * sums.all_groups; k += 32) sums.groups[k] = 0;
}
template <SlotKind Kind>
__device__ __forceinline__ void move(const Task& task, Word from, Word to) {
  if (from >= task.sums.room || to >= task.output.capacity) return;  // the search is repeated
  const Word hit = __ldg(task.sums.spill + from);
  write_record<Kind>(task, static_cast<std::uint32_t>(hit >> 32), static_cast<std::uint32_t>(hit), to);
}

// The hits of some tiles that fill the spare places from the `number`-th on: group after group of the tiles
// that left them.
template <SlotKind Kind>
__device__ __forceinline__ void fill_spare(const Task& task, FillMemory& memory, Word number,
                                           std::uint32_t total) {
  constexpr int kEach = kGroupTiles / kFillThreads;
  const std::uint32_t share = task.options.share.own;
  Word spare = memory.spare;  // before the group
  std::uint32_t done = 0;
  for (std::uint32_t g = memory.group; done < total; g++) {
    std::uint32_t left[kEach], all;
#pragma unroll
    for (int u = 0; u < kEach; u++) {
      const std::uint32_t tile = g * kGroupTiles + threadIdx.x * kEach + u,
                          count = tile < task.own_tiles ? task.sums.counts[tile] : share;
      left[u] = count < share ? share - count : 0;
    }
    __syncthreads();
    cub::BlockScan<std::uint32_t, kFillThreads>(memory.tiles).InclusiveSum(left, left, all);
#pragma unroll
    for (int u = 0; u < kEach; u++) memory.left[threadIdx.x * kEach + u] = left[u];
    __syncthreads();
    const auto upto = static_cast<std::uint32_t>(min(spare + all - number, static_cast<Word>(total)));
    for (std::uint32_t at = done + threadIdx.x; at < upto; at += kFillThreads) {
      const std::uint32_t t = tile_of(memory, at);
      std::uint32_t low = 0;
      const auto n = static_cast<std::uint32_t>(number + at - spare);  // of the group
      for (std::uint32_t step = kGroupTiles / 2; step; step /= 2)
        if (memory.left[low + step - 1] <= n) low += step;
      const Word end = static_cast<Word>(g * kGroupTiles + low + 1) * share;
      move<Kind>(task, memory.spills[t] + (at - memory.begins[t]), end - (memory.left[low] - n));
    }
    done = upto, spare += all;
  }
}

// The group of tiles with the `number`-th spare place, and the spare places before it.
__device__ __forceinline__ void find_spare(const Task& task, FillMemory& memory, Word number) {
  Word before = 0;
  for (std::uint32_t g0 = 0; g0 < task.sums.own_groups; g0 += kFillThreads) {
    const std::uint32_t g = g0 + threadIdx.x;
    const Word spare = g < task.sums.own_groups ? task.sums.groups[2 * g] : 0;
    Word upto, all;
    cub::BlockScan<Word, kFillThreads>(memory.groups).InclusiveSum(spare, upto, all);
    upto += before;
    if (upto - spare <= number && number < upto) memory.group = g, memory.spare = upto - spare;
    before += all;
    __syncthreads();
    if (number < before) return;
  }
}

// Some tiles of spheres a block, where there are no units.
template <SlotKind Kind>
__global__ void __launch_bounds__(kFillThreads, 6) fill_kernel(const __grid_constant__ Task task) {
  __shared__ FillMemory memory;
  if (task.counters->flags) return;
  const TileSums& sums = task.sums;
  const std::uint32_t share = task.options.share.own, group = blockIdx.x * kFillTiles / kGroupTiles,
                      first = blockIdx.x * kFillTiles;
  const auto spilled_of = [&](std::uint32_t tile) {
    const std::uint32_t count = sums.counts[tile];
    return count > share ? count - share : 0;
  };
  // Spare places, spilled hits before the block's, all of them.
  Three mine{};
  for (std::uint32_t g = threadIdx.x; g < sums.all_groups; g += kFillThreads) {
    const Word spilled = sums.groups[2 * g + 1];
    mine.v[0] += sums.groups[2 * g], mine.v[1] += g < group ? spilled : 0, mine.v[2] += spilled;
  }
  for (std::uint32_t k = group * kGroupTiles + threadIdx.x; k < first; k += kFillThreads)
    mine.v[1] += spilled_of(k);
  if (threadIdx.x < kFillTiles) {
    const std::uint32_t tile = first + threadIdx.x;
    const bool valid = tile < task.own_tiles;
    const std::uint32_t count = valid ? spilled_of(tile) : 0;
    std::uint32_t upto = count;
#pragma unroll
    for (int d = 1; d < kFillTiles; d <<= 1) {
      const std::uint32_t u = __shfl_up_sync(kAll, upto, d);
      if (static_cast<int>(threadIdx.x) >= d) upto += u;
    }
    memory.begins[threadIdx.x] = upto - count, memory.spills[threadIdx.x] = valid ? sums.spill_at[tile] : 0;
    if (threadIdx.x == kFillTiles - 1) memory.total = upto;
  }
  const Three all = block_sums(memory, mine);
  const Word spares = all.v[0], number = all.v[1], shares = static_cast<Word>(task.own_tiles) * share;
  if (blockIdx.x == 0 && threadIdx.x == 0)
    task.counters->contacts = task.counters->own = shares - spares + all.v[2];
  // What does not fill a spare place lies behind all shares.
  const Word behind = shares + number - spares;
  const std::uint32_t total = memory.total;
  const auto spare =
      static_cast<std::uint32_t>(number >= spares ? 0 : min(spares - number, static_cast<Word>(total)));
  if (spare) {
    find_spare(task, memory, number);
    fill_spare<Kind>(task, memory, number, spare);
  }
  for (std::uint32_t at = spare + threadIdx.x; at < total; at += kFillThreads) {
    const std::uint32_t t = tile_of(memory, at);
    move<Kind>(task, memory.spills[t] + (at - memory.begins[t]), behind + at);
  }
  leave_groups(sums);
}

}  // namespace
}  // namespace padder::detect::cuda
