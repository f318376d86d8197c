// Places in the list, given out to tiles: of spheres, then units that look down. For any order by one atomic
// addition. For a fixed order a tile of spheres has its share of places to itself, wherever the others are;
// what it finds beyond them spills over, and what it leaves spare is filled afterwards, the n-th spare place
// by the n-th hit that spilled, counted in the order of the tiles. The share is a little less than the mean,
// so that all that spares is filled and few hits move; nobody waits for anybody. Units that look down find so
// different numbers that each has a share of its own (expect.h), or none where spheres are few. Where tiles
// are so few that all run at once, each waits for the counts of those before it instead. Only search.cu
// includes this.
#pragma once
#include <cub/block/block_scan.cuh>

#include "detect/cuda/judge.h"

namespace padder::detect::cuda {
namespace {

constexpr int kGroupTiles = 1024, kShareUnits = 256, kFillTiles = 32, kFillThreads = 256;
constexpr std::uint32_t kMostTurns = 1056, kTurnGroups = (kMostTurns + 31) / 32,
                        kTurnWords = kMostTurns + 2 * kTurnGroups;
using Word = unsigned long long;

// Tiles of spheres that a block fills: fewer, while that is not too many blocks.
constexpr std::uint32_t kManyTiles = 10000;
__host__ __device__ inline std::uint32_t fill_tiles(const Task& task) {
  return task.own_tiles >= kManyTiles ? kFillTiles : kFillTiles / 2;
}

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

// ---- Few tiles: a tile waits for the counts of those before it. They are at work or done, since blocks
// begin in the order of their numbers (what CUB's scans rely on, too): so the wait ends, whatever else the
// device does. Counts are brought to the tiles that ask for them, since many that ask at few places hold up
// each other and the search: a tile adds its own to a word of each later tile among its 32, and the last of
// 32 their sum to a word of each later group of 32. A word is whole when as many have added to it as come
// before. Of two sets of words a search uses one and clears the other for the next.
__device__ __forceinline__ std::uint32_t begin_turn(const Task& task) {
  return *reinterpret_cast<volatile std::uint32_t*>(task.sums.turn);
}
// By all threads of the block, after a barrier: the contacts before the tile. `turn` from begin_turn.
__device__ __forceinline__ Word take_turn(const Task& task, const std::uint32_t& turn, std::uint32_t sum,
                                          Word* shared) {
  constexpr int kAdded = 40;  // a word: how many have added, from this bit on, and their sum
  const std::uint32_t tile = kept(blockIdx.x), lane = kept(threadIdx.x & 31);
  if (threadIdx.x < 32) {
    const std::uint32_t odd = turn & 1, index = tile & 31, group = tile / 32, other = tile - index + lane;
    Word *const words = task.sums.turn + 1 + odd * kTurnWords, *const of_groups = words + kMostTurns,
                *const sums = of_groups + kTurnGroups,
                *const next = words + kTurnWords - 2 * odd * kTurnWords;
    const Word mine = Word(1) << kAdded | sum;
    if (lane > index && other < gridDim.x) atomicAdd(words + other, mine);
    Word before = lane == 0 ? atomicAdd(sums + group, mine) : 0;
    before = __shfl_sync(kAll, before, 0);
    if (before >> kAdded == 31)
      for (std::uint32_t g = group + 1 + lane; g * 32 < gridDim.x; g += 32)
        atomicAdd(of_groups + g, before + mine - (Word(31) << kAdded));
    for (std::uint32_t k = tile + lane * gridDim.x; k < kTurnWords; k += 32 * gridDim.x) next[k] = 0;
    if (lane == 0) {
      const volatile Word *const a = words + tile, *const b = of_groups + group;
      Word x, y;
      do x = *a, y = *b;
      while (x >> kAdded != index || y >> kAdded != group);
      *shared = before = (x + y) & ((Word(1) << kAdded) - 1);
      if (tile + 1 == gridDim.x) {  // all have counted, and so have read which set of words it is
        task.counters->contacts = before + sum;
        *reinterpret_cast<std::uint32_t*>(task.sums.turn) = turn + 1;
      }
    }
  }
  __syncthreads();
  return *shared;
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

// What a thread's first hit of the block needs, asked for before its place is known.
template <SlotKind Kind>
struct Ahead {
  Word hit = 0;
  Both both;
  bool known = false;
  __device__ __forceinline__ std::uint32_t i() const { return static_cast<std::uint32_t>(hit >> 32); }
  __device__ __forceinline__ std::uint32_t j() const { return static_cast<std::uint32_t>(hit); }
};
__device__ __forceinline__ Word spill_place(const FillMemory& memory, std::uint32_t at) {
  const std::uint32_t t = tile_of(memory, at);
  return memory.spills[t] + (at - memory.begins[t]);
}
template <SlotKind Kind>
__device__ __forceinline__ void move(const Task& task, const FillMemory& memory, const Ahead<Kind>& ahead,
                                     std::uint32_t at, Word to) {
  if (Kind == SlotKind::fixed || !ahead.known || at != threadIdx.x)
    move<Kind>(task, spill_place(memory, at), to);
  else if (to < task.output.capacity)
    write_both<Kind>(task, ahead.both, ahead.i(), ahead.j(), to);
}
// The thread's first at no less than `from`.
__device__ __forceinline__ std::uint32_t own_from(std::uint32_t from) {
  return from + (threadIdx.x - from) % kFillThreads;
}

// The hits of some tiles that fill the spare places from the `number`-th on: group after group of the tiles
// that left them.
template <SlotKind Kind>
__device__ __forceinline__ void fill_spare(const Task& task, FillMemory& memory, Word number,
                                           std::uint32_t total, const Ahead<Kind>& ahead) {
  constexpr int kEach = kGroupTiles / kFillThreads;
  const std::uint32_t share = task.options.share.own;
  Word spare = memory.spare;  // before the group
  std::uint32_t done = 0;
  for (std::uint32_t g = memory.group; done < total; g++) {
    std::uint32_t left[kEach], all;
    const std::uint32_t tile = g * kGroupTiles + threadIdx.x * kEach;
    uint4 c = make_uint4(share, share, share, share);
    if (tile < task.own_tiles) c = *reinterpret_cast<const uint4*>(task.sums.counts + tile);
    const std::uint32_t count[kEach] = {c.x, c.y, c.z, c.w};
#pragma unroll
    for (int u = 0; u < kEach; u++)
      left[u] = tile + u < task.own_tiles && count[u] < share ? share - count[u] : 0;
    __syncthreads();
    cub::BlockScan<std::uint32_t, kFillThreads>(memory.tiles).InclusiveSum(left, left, all);
#pragma unroll
    for (int u = 0; u < kEach; u++) memory.left[threadIdx.x * kEach + u] = left[u];
    __syncthreads();
    const auto upto = static_cast<std::uint32_t>(min(spare + all - number, static_cast<Word>(total)));
    for (std::uint32_t at = own_from(done); at < upto; at += kFillThreads) {
      std::uint32_t low = 0;
      const auto n = static_cast<std::uint32_t>(number + at - spare);  // of the group
      for (std::uint32_t step = kGroupTiles / 2; step; step /= 2)
        if (memory.left[low + step - 1] <= n) low += step;
      const Word end = static_cast<Word>(g * kGroupTiles + low + 1) * share;
      move<Kind>(task, memory, ahead, at, end - (memory.left[low] - n));
    }
    done = upto, spare += all;
  }
}

// The group of tiles with the `number`-th spare place, and the spare places before it. `spare`: of the group
// of the thread's number.
__device__ __forceinline__ void find_spare(const Task& task, FillMemory& memory, Word number, Word spare) {
  Word before = 0;
  for (std::uint32_t g0 = 0; g0 < task.sums.own_groups; g0 += kFillThreads) {
    const std::uint32_t g = g0 + threadIdx.x;
    if (g0) spare = g < task.sums.own_groups ? task.sums.groups[2 * g] : 0;
    Word upto, all;
    cub::BlockScan<Word, kFillThreads>(memory.groups).InclusiveSum(spare, upto, all);
    upto += before;
    if (upto - spare <= number && number < upto) memory.group = g, memory.spare = upto - spare;
    before += all;
    __syncthreads();
    if (number < before) return;
  }
}

// Some tiles of spheres a block, where there are no units. Many: of so many tiles that full processors count
// for more than a block's latency.
template <SlotKind Kind, bool Many>
__global__ void __launch_bounds__(kFillThreads, Many ? 6 : 3) fill_kernel(const __grid_constant__ Task task) {
  __shared__ FillMemory memory;
  const TileSums& sums = task.sums;
  const std::uint32_t each_tiles = fill_tiles(task), share = task.options.share.own,
                      group = blockIdx.x * each_tiles / kGroupTiles, first = blockIdx.x * each_tiles;
  const auto over = [&](std::uint32_t count) { return count > share ? count - share : 0; };
  // What needs no other's word is asked for all at once. Spare places, spilled hits before the block's, all
  // of them.
  const std::uint32_t flags = task.counters->flags;
  Three mine{};
  Word spare_here = 0;
  for (std::uint32_t g = threadIdx.x; g < sums.all_groups; g += kFillThreads) {
    const ulonglong2 both = *reinterpret_cast<const ulonglong2*>(sums.groups + 2 * g);
    mine.v[0] += both.x, mine.v[1] += g < group ? both.y : 0, mine.v[2] += both.y;
    if (g < kFillThreads) spare_here = both.x;
  }
  const std::uint32_t tile = group * kGroupTiles + 4 * threadIdx.x;
  if (tile < first) {
    const uint4 c = *reinterpret_cast<const uint4*>(sums.counts + tile);
    mine.v[1] += over(c.x) + over(c.y) + over(c.z) + over(c.w);  // first is a multiple of four
  }
  if (threadIdx.x < 32) {
    const std::uint32_t mine_tile = first + threadIdx.x;
    const bool valid = threadIdx.x < each_tiles && mine_tile < task.own_tiles;
    const std::uint32_t count = valid ? over(sums.counts[mine_tile]) : 0;
    const Word at = valid ? sums.spill_at[mine_tile] : 0;
    std::uint32_t all, before = sum_before(count, all);
    memory.begins[threadIdx.x] = before, memory.spills[threadIdx.x] = at;
    if (threadIdx.x == 0) memory.total = all;
  }
  if (flags) return;
  const Three all = block_sums(memory, mine);
  const Word spares = all.v[0], number = all.v[1], shares = static_cast<Word>(task.own_tiles) * share;
  if (blockIdx.x == 0 && threadIdx.x == 0)
    task.counters->contacts = task.counters->own = shares - spares + all.v[2];
  // What does not fill a spare place lies behind all shares.
  const Word behind = shares + number - spares;
  const std::uint32_t total = memory.total;
  const auto spare =
      static_cast<std::uint32_t>(number >= spares ? 0 : min(spares - number, static_cast<Word>(total)));
  Ahead<Kind> ahead;
  if (!Many && threadIdx.x < total) {
    const Word from = spill_place(memory, threadIdx.x);
    if (from < sums.room && !is_wide<Kind>(task)) ahead.hit = __ldg(sums.spill + from), ahead.known = true;
  }
  if (spare) find_spare(task, memory, number, spare_here);
  leave_groups(sums);
  if constexpr (Kind != SlotKind::fixed)
    if (ahead.known) ahead.both = load_both<Kind>(task, ahead.i(), ahead.j());
  if (spare) fill_spare<Kind>(task, memory, number, spare, ahead);
  for (std::uint32_t at = own_from(spare); at < total; at += kFillThreads)
    move<Kind>(task, memory, ahead, at, behind + at);
}

}  // namespace
}  // namespace padder::detect::cuda
