// SPDX-License-Identifier: MIT
// After a flow of fixed order (flow.h), in one kernel: the n-th hit that spilled goes to the n-th place left
// spare or, where there are no more, behind all shares. Each block sums up all tiles for itself, eight by
// eight, so that it waits for no other kernel and no other block, and finds what it looks for in shared
// memory. Where tiles are too many for that: number.h. Only search.cu includes this.
#pragma once
#include "detect/cuda/output/output_slots.h"

namespace padder::detect::cuda {
namespace {

constexpr int kFlowFillThreads = 1024;
// Eights of tiles that shared memory holds.
constexpr std::uint32_t kMostEights = 25000;

// Contacts of a tile less its places: above zero it spilled so many, below zero it left so many spare.
__device__ __forceinline__ void load_eight(const Task& task, std::uint32_t eight, std::int32_t (&net)[8]) {
  const auto* const p = reinterpret_cast<const int4*>(task.sums.counts) + 2 * eight;
  const int4 a = __ldcg(p), b = __ldcg(p + 1);
  net[0] = a.x, net[1] = a.y, net[2] = a.z, net[3] = a.w, net[4] = b.x, net[5] = b.y, net[6] = b.z,
  net[7] = b.w;
}

// Of each eight of tiles, hits spilled (x) and places left spare (y) before it, counted within its chunk; of
// each of 32 chunks those before it, at last all.
struct Eights {
  const uint2* eight;
  const uint2* chunk;
  std::uint32_t count, bits;  // 2^bits eights a chunk
};
__device__ __forceinline__ std::uint32_t chunk_bits(std::uint32_t eights) {
  std::uint32_t bits = 5;
  while (std::uint64_t(32) << bits < eights) bits++;
  return bits;
}

// The `number`-th spare place of all.
__device__ __forceinline__ Word spare_place(const Task& task, const Eights& eights, std::uint32_t number) {
  std::uint32_t chunk = 0;
#pragma unroll
  for (std::uint32_t step = 16; step; step /= 2)
    if (eights.chunk[chunk + step].y <= number) chunk += step;
  const std::uint32_t m = number - eights.chunk[chunk].y, first = chunk << eights.bits;
  std::uint32_t at = first;
#pragma unroll 1
  for (std::uint32_t step = 1u << (eights.bits - 1); step; step /= 2)
    if (at + step < eights.count && eights.eight[at + step].y <= m) at += step;
  std::int32_t net[8], left = static_cast<std::int32_t>(m - eights.eight[at].y);
  load_eight(task, at, net);
  std::uint32_t tile = 8 * at;
  std::int32_t end = 0;  // from the place to the end of its tile
  bool found = false;
#pragma unroll
  for (int u = 0; u < 8; u++) {
    left += min(net[u], 0);
    if (!found && left < 0) found = true, end = -left, tile += u;
  }
  return end_of_places(task, min(tile, task.own_tiles + task.units - 1)) - end;
}

__global__ void __launch_bounds__(kFlowFillThreads, 1) fill_flow_kernel(const __grid_constant__ Task task) {
  static_assert(kFlowFillThreads == 32 * 32);
  extern __shared__ uint2 of_eights[];
  __shared__ uint2 chunks[33];
  await_before();
  const TileSums& sums = task.sums;
  const std::uint32_t lane = threadIdx.x & 31, warp = threadIdx.x >> 5,
                      thread = blockIdx.x * kFlowFillThreads + threadIdx.x,
                      threads = gridDim.x * kFlowFillThreads, count = eights_of(task),
                      bits = chunk_bits(count);
  const Eights eights{of_eights, chunks, count, bits};
  // The thread's first hit and what it needs are asked for before it is known whether there is one.
  const auto* const spill = reinterpret_cast<const uint4*>(sums.spill);
  const Word room = sums.room / 2;
  uint4 hit{};
  if (thread < room) hit = __ldcg(spill + thread);
  // Four eights a lane at a time, the next asked for while the last are summed up.
  constexpr std::uint32_t kEach = 4;
  const std::uint32_t end = min((warp + 1) << bits, count);
  std::uint32_t k = (warp << bits) + lane * kEach;
  ulonglong2 word[kEach / 2];
  const auto ask_for_eights = [&] {
#pragma unroll
    for (std::uint32_t u = 0; u < kEach / 2; u++) {  // zeros lie behind the last
      word[u] = {};
      if (k < end) word[u] = __ldcg(reinterpret_cast<const ulonglong2*>(sums.groups + k) + u);
    }
  };
  ask_for_eights();
  const std::uint32_t flags = task.counters->flags;
  const Word spilled = task.counters->spilled / 2, hits = min(spilled, room), shares = behind_shares(task);
  const bool totals = blockIdx.x + 1 == gridDim.x;  // sets the counters: it has the fewest hits
  if (flags) return;
  Spilled<SlotKind::unequal, false> mine;
  std::int32_t net[8];
  std::uint32_t rank = 0;
  const auto take = [&] {
    mine = {task, hit.x, hit.y, hit.z}, rank = hit.w;
    load_eight(task, mine.tile / 8, net);
  };
  if (thread < hits) take();
  if (thread + threads < hits) hit = __ldcg(spill + thread + threads);

  Word own = 0;
  uint2 sum = make_uint2(0, 0);
#pragma unroll 1
  for (std::uint32_t at = k; at - lane * kEach < end; at = k) {
    uint2 before[kEach], mine_all = make_uint2(0, 0), all;
#pragma unroll
    for (std::uint32_t u = 0; u < kEach; u++) {
      const Word w = u % 2 ? word[u / 2].y : word[u / 2].x;
      const auto over = static_cast<std::uint32_t>(w), spare = static_cast<std::uint32_t>(w >> 32);
      before[u] = mine_all, mine_all.x += over, mine_all.y += spare;
      if (totals && at + u < task.own_tiles / 8) own += static_cast<Word>(over) - spare;
    }
    k += 32 * kEach;
    ask_for_eights();
    const uint2 first =
        make_uint2(sum.x + sum_before(mine_all.x, all.x), sum.y + sum_before(mine_all.y, all.y));
#pragma unroll
    for (std::uint32_t u = 0; u < kEach; u++)
      if (at + u < end) of_eights[at + u] = make_uint2(first.x + before[u].x, first.y + before[u].y);
    sum.x += all.x, sum.y += all.y;
  }
  if (lane == 0) chunks[warp] = sum;
  if (totals) {
#pragma unroll
    for (int d = 16; d; d >>= 1) own += __shfl_xor_sync(kAll, own, d);
    if (threadIdx.x == 0) {
      own += task.shares.place[task.shares.levels];
      for (std::uint32_t tile = task.own_tiles & ~7u; tile < task.own_tiles; tile++)
        own += static_cast<std::int32_t>(__ldcg(sums.counts + tile));
    }
    if (lane == 0 && own) atomicAdd(&task.counters->own, own);
  }
  __syncthreads();
  if (warp == 0) {
    const uint2 c = chunks[lane];
    uint2 all;
    const std::uint32_t over_before = sum_before(c.x, all.x), spare_before = sum_before(c.y, all.y);
    chunks[lane] = make_uint2(over_before, spare_before);
    if (lane == 0) chunks[32] = all;
  }
  __syncthreads();
  // The last block leaves the groups as they were before the search.
  if (warp == 31) {
    unsigned last = 0;
    if (lane == 0) last = atomicInc(sums.fills, gridDim.x - 1) + 1 == gridDim.x;
    if (__shfl_sync(kAll, last, 0)) {
      for (std::uint32_t g = lane; g < count; g += 32) sums.groups[g] = 0;
      for (std::uint32_t g = lane; g < sums.share_groups; g += 32) sums.share_sums[g] = 0;
    }
  }
  const std::uint32_t spares = chunks[32].y;
  if (totals && threadIdx.x == 0) task.counters->contacts = shares + spilled - spares;
  const Word behind = shares - spares;
#pragma unroll 1
  for (Word from = thread; from < hits;) {
    const std::uint32_t eight = mine.tile / 8;
    std::uint32_t number = chunks[eight >> bits].x + of_eights[eight].x + rank;
#pragma unroll
    for (std::uint32_t u = 0; u < 7; u++)
      if (u < mine.tile % 8) number += max(net[u], 0);
    const auto hit_of_number = mine;
    // The next is asked for before this one is moved.
    from += threads;
    if (from < hits) take();
    if (from + threads < hits) hit = __ldcg(spill + from + threads);
    hit_of_number.write(task, number < spares ? spare_place(task, eights, number) : behind + number);
  }
}

}  // namespace
}  // namespace padder::detect::cuda
