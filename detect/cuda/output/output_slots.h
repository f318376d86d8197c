// SPDX-License-Identifier: MIT
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

#include "detect/cuda/search/exact_test.h"

namespace padder::detect::cuda {
namespace {

// Spheres of a tile of flow.h.
constexpr std::uint32_t kFlowTile = 2 * kThreads;
constexpr int kGroupTiles = 1024, kShareUnits = 256, kFillTiles = 32, kFillThreads = 256;
// So many tiles at most are numbered by each block for itself, 8 bytes of shared memory a tile.
constexpr std::uint32_t kMostNumbered = 14000;
constexpr int kFewThreads = 1024;
// Four tiles each of a thread's; an odd number, so that threads do not meet at a bank.
__host__ __device__ inline std::uint32_t few_quads(std::uint32_t tiles) {
  return ((tiles + 4 * kFewThreads - 1) / (4 * kFewThreads)) | 1;
}
constexpr std::uint32_t few_bytes(std::uint32_t quads) { return 2 * 16 * kFewThreads * quads; }
constexpr std::uint32_t kMostTurns = 1056, kTurnGroups = (kMostTurns + 31) / 32,
                        kTurnWords = kMostTurns + 2 * kTurnGroups;
using Word = unsigned long long;
// Where the words of groups begin in SearchMemory::marks; a multiple of two, since two are read at a time.
constexpr std::uint32_t kGroupsAt = 4 + 2 * kTurnWords;
static_assert(kGroupsAt % 2 == 0);
// Eights of tiles and units, the last perhaps of fewer.
__host__ __device__ inline std::uint32_t eights_of(const Task& task) {
  return static_cast<std::uint32_t>((std::uint64_t(task.own_tiles) + task.units + 7) / 8);
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

// What a tile left spare or spilled, to its group.
__device__ __forceinline__ void note(const Task& task, std::uint32_t tile, std::uint32_t share,
                                     std::uint32_t found) {
  if (!task.sums.groups || found == share) return;
  Word* const group = task.sums.groups + group_of(task, tile) * 2;
  atomicAdd(group + (found > share), static_cast<Word>(found > share ? found - share : share - found));
}

// Of flow.h: contacts less places. To its group or, where fill_flow.h serves, to its eight tiles: hits
// spilled in the lower half of a word, places left spare in the upper.
__device__ __forceinline__ void note_net(const Task& task, std::uint32_t tile, std::int32_t net) {
  task.sums.counts[tile] = static_cast<std::uint32_t>(net);
  if (net == 0) return;
  const auto more = static_cast<Word>(net < 0 ? -net : net);
  if (task.sums.eights)
    atomicAdd(task.sums.groups + tile / 8, net < 0 ? more << 32 : more);
  else
    atomicAdd(task.sums.groups + group_of(task, tile) * 2 + (net > 0), more);
}

// Of a tile of spheres.
__device__ __forceinline__ Target take_place(const Task& task, std::uint32_t tile, std::uint32_t sum) {
  if (!task.options.stable_order)
    return {sum ? atomicAdd(&task.counters->contacts, static_cast<Word>(sum)) : 0, 0, ~0u, 0, 0};
  const std::uint32_t share = task.options.share.own, spilled = sum > share ? sum - share : 0;
  Target t{static_cast<Word>(tile) * share, 0, share, 0, 0};
  if (spilled) t.spill = atomicAdd(&task.counters->spilled, static_cast<Word>(spilled));
  note(task, tile, share, sum);
  task.sums.counts[tile] = sum, task.sums.spill_at[tile] = t.spill;
  return t;
}

// The places of a tile of spheres.
struct PlacesOfTile {
  Word first;
  std::uint32_t count;
};
__device__ __forceinline__ PlacesOfTile places_of_tile(const Task& task, std::uint32_t tile) {
  const TileShares& s = task.shares;
  int level = s.levels - 1;
#pragma unroll 1
  while (level > 0 && tile < s.first[level]) level--;
  return {s.place[level] + static_cast<Word>(tile - s.first[level]) * s.share[level], s.share[level]};
}
// The word of a unit in `shares`, and what lies behind all shares.
__device__ __forceinline__ std::uint32_t share_of(const TileSums& sums, std::uint32_t unit) {
  return sums.shares ? __ldcg(sums.shares + unit) : 0;
}
__device__ __forceinline__ Word behind_shares(const Task& task) {
  const TileSums& sums = task.sums;
  return sums.shares ? sums.bases[sums.share_groups] : task.shares.place[task.shares.levels];
}

// Behind the places that a tile of spheres or a unit has to itself.
__device__ __forceinline__ Word end_of_places(const Task& task, std::uint32_t tile) {
  if (tile < task.own_tiles) {
    const PlacesOfTile p = places_of_tile(task, tile);
    return p.first + p.count;
  }
  const std::uint32_t unit = tile - task.own_tiles, word = __ldcg(task.sums.shares + unit);
  return __ldcg(task.sums.bases + unit / kShareUnits) + (word >> kShareBits) + (word & kMostShare);
}

// Of a unit.
__device__ __forceinline__ Target take_unit(const Task& task, std::uint32_t unit, std::uint32_t first,
                                            std::uint32_t hits) {
  Counters* const c = task.counters;
  if (!task.options.stable_order)
    return {hits ? atomicAdd(&c->contacts, static_cast<Word>(hits)) : 0, 0, ~0u, 0, 0};
  const TileSums& sums = task.sums;
  const std::uint32_t tile = task.own_tiles + unit, word = share_of(sums, unit), share = word & kMostShare,
                      spilled = hits > share ? hits - share : 0;
  Target t{0, 0, share, kOfUnit | unit << 5, first};
  if (share) t.place = __ldcg(sums.bases + unit / kShareUnits) + (word >> kShareBits);
  if (spilled) t.spill = atomicAdd(&c->spilled, static_cast<Word>(spilled));
  note(task, tile, share, hits);
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

// A hit that spilled. Where the list was too short the spill may hold anything: it is kept within bounds.
// Wide: is_wide records; known beforehand, since a call within a loop costs registers.
template <SlotKind Kind, bool Wide>
struct Spilled {
  std::uint32_t i, j, tile;
  Both both;  // unless Wide
  __device__ __forceinline__ Spilled() {}
  __device__ __forceinline__ Spilled(const Task& task, std::uint32_t pi, std::uint32_t pj, std::uint32_t of)
      : i(min(pi, task.spheres.count - 1)),
        j(min(pj, task.spheres.count - 1)),
        tile(min(of, task.own_tiles + task.units - 1)) {
    if constexpr (!Wide) both = load_both<Kind>(task, i, j);
  }
  __device__ __forceinline__ Spilled(const Task& task, Word hit) {
    const std::uint32_t last = task.spheres.count - 1;
    i = static_cast<std::uint32_t>(hit >> 32), j = min(static_cast<std::uint32_t>(hit), last);
    if (i & kOfUnit && task.units) {
      const std::uint32_t unit = min((i & ~kOfUnit) >> 5, task.units - 1);
      tile = task.own_tiles + unit, i = __ldg(task.sums.firsts + unit) + (i & 31);
    } else {
      tile = min(i, last) / kThreads;
    }
    i = min(i, last);
    if constexpr (!Wide) both = load_both<Kind>(task, i, j);
  }
  __device__ __forceinline__ void write(const Task& task, Word to) const {
    if (to >= task.output.capacity) return;
    if constexpr (Wide)
      write_wide<Kind>(task, i, j, to);
    else
      write_both<Kind>(task, both, i, j, to);
  }
};

// ---- Few tiles, but too many to wait: each block sums up the counts of all, and moves some of what spilled.
// Units have no share here.
template <SlotKind Kind, bool Wide>
__global__ void __launch_bounds__(kFewThreads) fill_few_kernel(const __grid_constant__ Task task) {
  static_assert(kFewThreads == 32 * 32);
  extern __shared__ uint4 shared[];
  __shared__ uint2 of_warps[32];
  const TileSums& sums = task.sums;
  const std::uint32_t tiles = task.own_tiles + task.units, each = few_quads(tiles),
                      share = task.options.share.own, lane = threadIdx.x & 31, warp = threadIdx.x >> 5;
  // Of each tile: the number of the first hit that it spilled; places left spare up to its end.
  uint4 *const quads = shared + threadIdx.x * each, *const spare_quads = quads + kFewThreads * each;
  const auto* const numbers = reinterpret_cast<const std::uint32_t*>(shared);
  const std::uint32_t* const spares = numbers + 4 * kFewThreads * each;
  const bool totals = blockIdx.x + 1 == gridDim.x;  // sets the counters: it has the fewest hits
  // The thread's first hit is asked for before it is known whether there is one.
  const Word step = gridDim.x * Word(kFewThreads);
  Word from = blockIdx.x * Word(kFewThreads) + threadIdx.x, hit = 0;
  if (from < sums.room) hit = __ldg(sums.spill + from);
  const std::uint32_t flags = task.counters->flags;
  const Word spilled = task.counters->spilled, count = min(spilled, static_cast<Word>(sums.room));
  // Places of tiles `t` to t + 3, of which those behind the last count nothing and have none.
  const auto places_of = [&](std::uint32_t t) {
    const auto of = [&](std::uint32_t tile) { return tile < task.own_tiles ? share : 0; };
    if (t + 3 < task.own_tiles) return make_uint4(share, share, share, share);
    return make_uint4(of(t), of(t + 1), of(t + 2), of(t + 3));
  };
  const std::uint32_t first = threadIdx.x * each * 4;
  std::uint32_t over = 0, spare = 0;  // hits that spilled, places left spare
  const auto add = [&](std::uint32_t found, std::uint32_t places) {
    const std::uint32_t more = max(found, places);
    over += more - places, spare += more - found;
  };
  Word own = 0;
#pragma unroll 3
  for (std::uint32_t q = 0; q < each; q++) {
    const std::uint32_t t = first + 4 * q;
    uint4 c = make_uint4(0, 0, 0, 0);
    if (t < tiles) c = __ldg(reinterpret_cast<const uint4*>(sums.counts + t));
    if (t + 3 >= tiles) {
      c.y = t + 1 < tiles ? c.y : 0, c.z = t + 2 < tiles ? c.z : 0, c.w = 0;
    }
    quads[q] = c;
    const uint4 p = places_of(t);
    add(c.x, p.x), add(c.y, p.y), add(c.z, p.z), add(c.w, p.w);
    if (totals)
      own += (t < task.own_tiles ? c.x : 0) + static_cast<Word>(t + 1 < task.own_tiles ? c.y : 0) +
             (t + 2 < task.own_tiles ? c.z : 0) + static_cast<Word>(t + 3 < task.own_tiles ? c.w : 0);
  }
  if (flags || (blockIdx.x * Word(kFewThreads) >= count && !totals)) return;
  Spilled<Kind, Wide> mine;
  std::uint32_t lies_at = 0;
  const auto ask = [&] {
    mine = {task, hit}, lies_at = static_cast<std::uint32_t>(__ldg(sums.spill_at + mine.tile));
  };
  // The next is asked for before this one is moved.
  const auto ask_next = [&] {
    if (from + step < count) hit = __ldg(sums.spill + from + step);
  };
  if (from < count) ask(), ask_next();
  std::uint32_t over_all, spare_all;
  over = sum_before(over, over_all), spare = sum_before(spare, spare_all);
  if (lane == 0) of_warps[warp] = make_uint2(over_all, spare_all);
  if (totals) {
#pragma unroll
    for (int d = 16; d; d >>= 1) own += __shfl_xor_sync(kAll, own, d);
    if (lane == 0 && own) atomicAdd(&task.counters->own, own);
  }
  __syncthreads();
  const uint2 of_warp = of_warps[lane];
  over += __reduce_add_sync(kAll, lane < warp ? of_warp.x : 0);
  spare += __reduce_add_sync(kAll, lane < warp ? of_warp.y : 0);
  const std::uint32_t all_spares = __reduce_add_sync(kAll, of_warp.y);
  const Word shares = static_cast<Word>(task.own_tiles) * share;
  if (totals && threadIdx.x == 0) task.counters->contacts = shares - all_spares + spilled;
#pragma unroll 1
  for (std::uint32_t q = 0; q < each; q++) {
    const uint4 c = quads[q], p = places_of(first + 4 * q);
    uint4 n, s;
    n.x = over, add(c.x, p.x), s.x = spare, n.y = over, add(c.y, p.y), s.y = spare;
    n.z = over, add(c.z, p.z), s.z = spare, n.w = over, add(c.w, p.w), s.w = spare;
    quads[q] = n, spare_quads[q] = s;
  }
  __syncthreads();
  while (from < count) {
    const std::uint32_t number = numbers[mine.tile] + (static_cast<std::uint32_t>(from) - lies_at);
    Word to = shares + number - all_spares;
    if (number < all_spares) {
      std::uint32_t tile = 0;
      for (std::uint32_t k = 1u << (31 - __clz(task.own_tiles)); k; k >>= 1)
        if (tile + k <= task.own_tiles && spares[tile + k - 1] <= number) tile += k;
      tile = min(tile, task.own_tiles - 1);
      to = static_cast<Word>(tile + 1) * share - (spares[tile] - number);
    }
    mine.write(task, to);
    from += step;
    if (from < count) ask(), ask_next();
  }
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
__device__ __forceinline__ Word spill_place(const FillMemory& memory, std::uint32_t at) {
  const std::uint32_t t = tile_of(memory, at);
  return memory.spills[t] + (at - memory.begins[t]);
}
template <SlotKind Kind, bool Wide>
__device__ __forceinline__ void move(const Task& task, const FillMemory& memory, std::uint32_t at, Word to) {
  const Word from = spill_place(memory, at);
  if (from >= task.sums.room || to >= task.output.capacity) return;  // the search is repeated
  Spilled<Kind, Wide>(task, __ldg(task.sums.spill + from)).write(task, to);
}
// The thread's first at no less than `from`.
__device__ __forceinline__ std::uint32_t own_from(std::uint32_t from) {
  return from + (threadIdx.x - from) % kFillThreads;
}

// The hits of some tiles that fill the spare places from the `number`-th on: group after group of the tiles
// that left them.
template <SlotKind Kind, bool Wide>
__device__ __forceinline__ void fill_spare(const Task& task, FillMemory& memory, Word number,
                                           std::uint32_t total) {
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
      move<Kind, Wide>(task, memory, at, end - (memory.left[low] - n));
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

// Some tiles of spheres a block, where there are no units.
template <SlotKind Kind, bool Wide>
__global__ void __launch_bounds__(kFillThreads, 6) fill_kernel(const __grid_constant__ Task task) {
  __shared__ FillMemory memory;
  const TileSums& sums = task.sums;
  const std::uint32_t share = task.options.share.own, first = blockIdx.x * kFillTiles,
                      group = first / kGroupTiles;
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
    const bool valid = threadIdx.x < kFillTiles && mine_tile < task.own_tiles;
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
  if (spare) find_spare(task, memory, number, spare_here);
  leave_groups(sums);
  if (spare) fill_spare<Kind, Wide>(task, memory, number, spare);
  for (std::uint32_t at = own_from(spare); at < total; at += kFillThreads)
    move<Kind, Wide>(task, memory, at, behind + at);
}

}  // namespace
}  // namespace padder::detect::cuda
