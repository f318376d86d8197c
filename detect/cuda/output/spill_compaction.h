// SPDX-License-Identifier: MIT
// After a search of fixed order with units (expect.h), unless it is a flow of so few that fill_flow.h serves:
// one kernel numbers the hits that spilled and the places left spare, another moves hit by hit, the n-th hit
// to the n-th spare place or, where there are no more, behind all shares. Only search.cu includes this.
#pragma once
#include "detect/cuda/output/output_slots.h"

namespace padder::detect::cuda {
namespace {

// A group of tiles a block. spill_at becomes what is between a hit's place in the spill and its number.
// Flows: hits of flow.h, which tell their tile and which they are of those that it spilled: between that and
// the number.
template <bool Flows>
__global__ void __launch_bounds__(kFillThreads, 4) number_kernel(const __grid_constant__ Task task) {
  constexpr int kEach = kGroupTiles / kFillThreads;
  using Scan = cub::BlockScan<Word, kFillThreads>;
  __shared__ typename Scan::TempStorage memory;
  __shared__ Word before[2];
  await_before();  // what comes next must not begin before the search has ended
  begin_next();
  const TileSums& sums = task.sums;
  const std::uint32_t group = blockIdx.x, flags = task.counters->flags;
  const Tiles tiles = tiles_of(task, group);
  if (threadIdx.x < 2) before[threadIdx.x] = 0;
  // Hits that spilled in the lower half, places left spare in the upper.
  const std::uint32_t tile = tiles.first + threadIdx.x * kEach;
  Word mine[kEach], start[kEach], lies_at[kEach], all;
#pragma unroll
  for (int u = 0; u < kEach; u++) {
    mine[u] = lies_at[u] = 0;
    if (tile + u >= tiles.end) continue;
    if (!Flows) lies_at[u] = sums.spill_at[tile + u];
    auto net = static_cast<std::int32_t>(sums.counts[tile + u]);
    if (!Flows)
      net -= static_cast<std::int32_t>(tile + u < task.own_tiles
                                           ? places_of_tile(task, tile + u).count
                                           : share_of(sums, tile + u - task.own_tiles) & kMostShare);
    mine[u] = net > 0 ? net : static_cast<Word>(-net) << 32;
  }
  Word upto[2] = {}, net = 0, own = 0;  // before the group; contacts less shares
  for (std::uint32_t g = threadIdx.x; g < (group ? group : sums.all_groups); g += kFillThreads) {
    const Word spare = sums.groups[2 * g], spilled = sums.groups[2 * g + 1];
    if (group)
      upto[0] += spilled, upto[1] += spare;
    else
      net += spilled - spare, own += g < sums.own_groups ? spilled - spare : 0;
  }
  if (flags) return;
  Scan(memory).ExclusiveSum(mine, start, all);
#pragma unroll
  for (int d = 16; d; d >>= 1) {
    upto[0] += __shfl_xor_sync(kAll, upto[0], d), upto[1] += __shfl_xor_sync(kAll, upto[1], d);
    net += __shfl_xor_sync(kAll, net, d), own += __shfl_xor_sync(kAll, own, d);
  }
  if ((threadIdx.x & 31) == 0) {
    if (upto[0]) atomicAdd(before, upto[0]);
    if (upto[1]) atomicAdd(before + 1, upto[1]);
  }
  if (group == 0 && (threadIdx.x & 31) == 0) {
    if (threadIdx.x == 0) net += behind_shares(task), own += task.shares.place[task.shares.levels];
    if (net) atomicAdd(&task.counters->contacts, net);
    if (own) atomicAdd(&task.counters->own, own);
  }
  __syncthreads();
#pragma unroll
  for (int u = 0; u < kEach; u++) {
    if (tile + u >= tiles.end) continue;
    sums.spill_at[tile + u] = before[0] + static_cast<std::uint32_t>(start[u]) - lies_at[u];
    const auto spare = static_cast<std::uint32_t>(mine[u] >> 32);
    const Word first = before[1] + (start[u] >> 32);
    sums.spares[tile + u] = static_cast<std::uint32_t>(first) + spare;
    for (Word k = (first + kSpares - 1) / kSpares; k * kSpares < first + spare && k < sums.index_room; k++)
      sums.index[k] = tile + u;
  }
  if (threadIdx.x == 0 && group + 1 == gridDim.x) *sums.all_spares = before[1] + (all >> 32);
}

// The `number`-th spare place, of `all`. What number_kernel wrote while this ran is no read-only data.
__device__ __forceinline__ Word spare_place(const Task& task, Word number, Word all) {
  const TileSums& sums = task.sums;
  const Word k = number / kSpares;
  if (k >= sums.index_room) return ~Word(0);   // the spill was too short: the search is repeated
  const auto left = [&](std::uint32_t tile) {  // behind the place, up to the end of the tile's
    return static_cast<std::int32_t>(sums.spares[tile] - static_cast<std::uint32_t>(number));
  };
  // The first tile with some left, of `tile` to `last`; three are asked at a time: what it waits for is
  // memory.
  std::uint32_t tile = sums.index[k], last = task.own_tiles + task.units - 1;
  if ((k + 1) * kSpares < all && k + 1 < sums.index_room) last = min(last, sums.index[k + 1]);
  tile = min(tile, last);
  while (tile < last) {
    const std::uint32_t step = (last - tile + 3) / 4, t1 = min(tile + step - 1, last - 1),
                        t2 = min(t1 + step, last - 1), t3 = min(t2 + step, last - 1);
    const std::int32_t l1 = left(t1), l2 = left(t2), l3 = left(t3);
    if (l1 > 0)
      last = t1;
    else if (l2 > 0)
      tile = t1 + 1, last = t2;
    else if (l3 > 0)
      tile = t2 + 1, last = t3;
    else
      tile = t3 + 1;
  }
  return end_of_places(task, tile) - static_cast<std::uint32_t>(left(tile));
}

// Blocks of it an SM must be able to hold: hits wait for memory, so that many under way pay.
template <bool Flows>
constexpr int kMoveBlocks = Flows ? 7 : 5;
// The hits that spilled to the list. Begins beside number_kernel, since most of what it reads is there
// already. Leaves the groups of tiles and of units as they were before the search.
template <SlotKind Kind, bool Wide, bool Flows>
__global__ void __launch_bounds__(kFillThreads, kMoveBlocks<Flows>)
    move_kernel(const __grid_constant__ Task task) {
  const TileSums& sums = task.sums;
  const std::uint32_t thread = blockIdx.x * kFillThreads + threadIdx.x, threads = gridDim.x * kFillThreads;
  // A thread's next hit is asked for before its last is moved, the first before it is known to be one.
  using Hit = std::conditional_t<Flows, uint4, Word>;
  const auto* const spill = reinterpret_cast<const Hit*>(sums.spill);
  const Word room = Flows ? sums.room / 2 : sums.room;
  Hit hit{};
  if (thread < room) hit = __ldg(spill + thread);
  const std::uint32_t flags = task.counters->flags;
  const Word count = min(Flows ? task.counters->spilled / 2 : task.counters->spilled, room);
  if (flags) return;
  Spilled<Kind, Wide> mine;
  std::uint32_t rank = 0;
  const auto take = [&] {
    if constexpr (Flows)
      mine = {task, hit.x, hit.y, hit.z}, rank = hit.w;
    else
      mine = {task, hit};
  };
  if (thread < count) take();
  await_before();
  for (std::uint32_t k = thread; k < 2 * sums.all_groups; k += threads) sums.groups[k] = 0;
  for (std::uint32_t k = thread; k < sums.share_groups; k += threads) sums.share_sums[k] = 0;
  const Word spares = __ldcg(sums.all_spares), behind = behind_shares(task) - spares;
  for (Word from = thread; from < count;) {
    const Word next = from + threads;
    if (next < count) hit = __ldg(spill + next);
    const Word number = (Flows ? rank : from) + sums.spill_at[mine.tile];
    mine.write(task, number < spares ? spare_place(task, number, spares) : behind + number);
    if (next < count) take();
    from = next;
  }
}

}  // namespace
}  // namespace padder::detect::cuda
