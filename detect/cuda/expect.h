// Places in the list for units that look down, where its order is fixed: each has about as many to itself as
// its spheres can be expected to meet there, from their radii and how many spheres of the finer level there
// are in a bin. Where those lie evenly, nine in ten hits are then written where they stay; what is wrong is
// put right as with tiles of spheres (place.h). Only search.cu includes this.
#pragma once
#include "detect/cuda/down.h"
#include "detect/cuda/place.h"

namespace padder::detect::cuda {
namespace {

// The share of a ball of reach 1 / `per_reach` around p that lies between 0 and n of an axis.
__device__ __forceinline__ float cut(float p, float n, float per_reach) {
  const float low = fmaxf(-p * per_reach, -1.f), high = fminf((n - p) * per_reach, 1.f);
  return fmaxf(0.25f * (high * (3 - high * high) - low * (3 - low * low)), 0.f);
}
// Integral of 2 sqrt(1 - t^2), to two thousandths.
__device__ __forceinline__ float disc(float t) {
  t = fminf(fmaxf(t, -1.f), 1.f);
  const float t2 = t * t, t4 = t2 * t2;
  return t * (2 - t2 * (1 / 3.f + t2 * (0.05f + 0.0459f * t4)));
}

// Hits of a unit, in 16ths, none behind the last unit; by all lanes. Spheres of the finer level are taken for
// 0.68 of the largest.
template <SlotKind Kind>
__device__ __forceinline__ float expected_hits(const Task& task, const Grid& grid, const Downs& downs,
                                               std::uint32_t unit) {
  constexpr float kBall = 4.18879f;
  // Neighbours are mostly of the same pair of levels.
  const std::uint32_t lane = threadIdx.x & 31, lowest = unit - lane;
  std::uint32_t which = 0;
  for (std::uint32_t k = lane; k - lane < downs.count; k += 32)
    which += __popc(__ballot_sync(kAll, k < downs.count && downs.pair[k].first_unit <= lowest));
  which--;
  while (which + 1 < downs.count && downs.pair[which + 1].first_unit <= unit) which++;
  if (unit >= task.units) return 0;
  const Down& d = downs.pair[which];
  const Level& l = grid.level[d.fine];
  const std::uint32_t number_of_unit = unit - d.first_unit,
                      at = d.turns == 1 ? number_of_unit : number_of_unit / d.turns,
                      turn = number_of_unit - at * d.turns, number = d.step == 1 ? at : at / d.step,
                      part = at - number * d.step + turn * d.step, first = d.first + number * d.group,
                      end = min(min(first + d.group, d.end), task.spheres.count);
  const float fine = 0.68f * static_cast<float>(l.radius_max), per_size = static_cast<float>(l.per_size);
  if (d.group > 1) {
    const float unit_of_slot =
        Kind == SlotKind::fixed ? static_cast<float>(1 / grid.level[d.coarse].units) : 1.f;
    float sum = 0;
#pragma unroll 16
    for (std::uint32_t k = 0; k < d.group; k++) {
      const float r = load_slot(slots_of<Kind>(task) + min(first + k, end - 1)).r,
                  reach = fmaf(r, unit_of_slot, fine) * per_size;
      sum += first + k < end ? reach * reach * reach : 0;
    }
    return 16 * kBall * d.density * sum;
  }
  if (first >= end) return 0;
  const Sphere s = sphere_at<Kind>(task, first);
  const float widest = reach_of(grid, d, s.r);
  const std::uint32_t parts = parts_of(d, widest);
  if (part >= parts) return 0;
  float p[3], n[3];
#pragma unroll
  for (int k = 0; k < 3; k++) {
    const double x = k == 0 ? s.x : k == 1 ? s.y : s.z;
    p[k] = static_cast<float>(x * l.per_size - static_cast<double>(l.first[k]));
    n[k] = static_cast<float>(l.count[k]);
  }
  const float reach = (static_cast<float>(s.r) + fine) * per_size, per_reach = __frcp_rn(reach),
              volume = cut(p[0], n[0], per_reach);
  if (parts == 1)
    return 16 * kBall * d.density * reach * reach * reach * volume * cut(p[1], n[1], per_reach) *
           cut(p[2], n[2], per_reach);
  // The part's rows, layer by layer.
  const float y0 = fmaxf(floorf(p[1] - widest), 0.f), y1 = fminf(floorf(p[1] + widest), n[1] - 1),
              z0 = fmaxf(floorf(p[2] - widest), 0.f), z1 = fminf(floorf(p[2] + widest), n[2] - 1);
  if (!(y0 <= y1 && z0 <= z1)) return 0;
  const auto side = static_cast<std::uint32_t>(y1 - y0) + 1,
             all = side * (static_cast<std::uint32_t>(z1 - z0) + 1), each = (all + parts - 1) / parts,
             from = min(part * each, all);
  const float y_at = p[1] - y0, z_at = p[2] - z0;
  float sum = 0;
  std::uint32_t z = from / side, y = from - z * side;
#pragma unroll 1
  for (std::uint32_t left = min(each, all - from); left; z++) {
    const std::uint32_t upto = min(y + left, side);
    const float dz = static_cast<float>(z) + 0.5f - z_at, rest = fmaf(reach, reach, -dz * dz) - 1 / 12.f;
    if (rest > 0) {
      const float per = rsqrtf(rest);
      sum +=
          rest * (disc((static_cast<float>(upto) - y_at) * per) - disc((static_cast<float>(y) - y_at) * per));
    }
    left -= upto - y, y = 0;
  }
  return 16 * d.density * volume * sum;
}

// Groups of units: their shares, and where those begin in the list. The search may begin when all blocks of
// this have begun; who needs the shares waits for the end of it.
template <SlotKind Kind>
__global__ void __launch_bounds__(kShareUnits, 4)
    share_kernel(const __grid_constant__ Task task, const __grid_constant__ Grid grid,
                 const __grid_constant__ Downs downs) {
  using Scan = cub::BlockScan<std::uint32_t, kShareUnits>;
  __shared__ union {
    typename Scan::TempStorage scan;
    typename cub::BlockScan<Word, kShareUnits>::TempStorage groups;
  } memory;
  __shared__ bool last;
  begin_next();
  if (task.counters->flags) return;
  const TileSums& sums = task.sums;
  std::uint32_t expected = 0;
  for (std::uint32_t group = blockIdx.x; group < sums.share_groups; group += gridDim.x) {
    const std::uint32_t unit = group * kShareUnits + threadIdx.x;
    const auto hits =  // in 16ths
        static_cast<std::uint32_t>(fminf(expected_hits<Kind>(task, grid, downs, unit), 16.f * kMostShare));
    const std::uint32_t share =
        min(static_cast<std::uint32_t>(static_cast<float>(hits) * task.options.share.unit), kMostShare);
    std::uint32_t before, all;
    Scan(memory.scan).ExclusiveSum(share, before, all);
    if (unit < task.units) sums.shares[unit] = before << kShareBits | share;
    if (threadIdx.x == 0) sums.bases[group] = all;
    expected += hits;
    __syncthreads();
  }
  expected = __reduce_add_sync(kAll, expected);
  if ((threadIdx.x & 31) == 0 && expected) atomicAdd(&task.counters->expected, static_cast<Word>(expected));
  // The last block sums up the groups.
  if (threadIdx.x == 0) {
    __threadfence();
    last = atomicInc(sums.fills + 1, gridDim.x - 1) + 1 == gridDim.x;
  }
  __syncthreads();
  if (!last) return;
  Word base = static_cast<Word>(task.own_tiles) * task.options.share.own;
  for (std::uint32_t g0 = 0; g0 < sums.share_groups; g0 += kShareUnits) {
    const std::uint32_t g = g0 + threadIdx.x;
    Word of_group = g < sums.share_groups ? __ldcg(sums.bases + g) : 0, total;
    cub::BlockScan<Word, kShareUnits>(memory.groups).ExclusiveSum(of_group, of_group, total);
    if (g < sums.share_groups) sums.bases[g] = base + of_group;
    base += total;
    __syncthreads();
  }
  if (threadIdx.x == 0) sums.bases[sums.share_groups] = base;
}
// After the search, instead of fill_kernel: one kernel numbers what spilled and the places left spare, a
// group of tiles a block (spill_at becomes what is between a hit's place in the spill and its number),
// another moves hit by hit.
__global__ void __launch_bounds__(kFillThreads, 4) number_kernel(const __grid_constant__ Task task) {
  constexpr int kEach = kGroupTiles / kFillThreads;
  using Scan = cub::BlockScan<Word, kFillThreads>;
  __shared__ typename Scan::TempStorage memory;
  __shared__ Word before[2];
  begin_next();
  const TileSums& sums = task.sums;
  const std::uint32_t group = blockIdx.x, share = task.options.share.own, flags = task.counters->flags;
  const Tiles tiles = tiles_of(task, group);
  if (threadIdx.x < 2) before[threadIdx.x] = 0;
  // Hits that spilled in the lower half, places left spare in the upper.
  const std::uint32_t tile = tiles.first + threadIdx.x * kEach;
  Word mine[kEach], start[kEach], lies_at[kEach], all;
#pragma unroll
  for (int u = 0; u < kEach; u++) {
    mine[u] = lies_at[u] = 0;
    if (tile + u >= tiles.end) continue;
    lies_at[u] = sums.spill_at[tile + u];
    const std::uint32_t count = sums.counts[tile + u],
                        places = tile + u < task.own_tiles
                                     ? share
                                     : share_of(sums, tile + u - task.own_tiles) & kMostShare;
    mine[u] = count > places ? count - places : static_cast<Word>(places - count) << 32;
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
    if (threadIdx.x == 0) net += behind_shares(task), own += static_cast<Word>(task.own_tiles) * share;
    if (net) atomicAdd(&task.counters->contacts, net);
    if (own) atomicAdd(&task.counters->own, own);
  }
  __syncthreads();
#pragma unroll
  for (int u = 0; u < kEach; u++) {
    if (tile + u >= tiles.end) continue;
    sums.spill_at[tile + u] = before[0] + static_cast<std::uint32_t>(start[u]) - lies_at[u];
    sums.spares[tile + u] = static_cast<std::uint32_t>((start[u] + mine[u]) >> 32);
  }
  if (threadIdx.x == 0) sums.spares_before[group] = before[1];
  if (threadIdx.x == 0 && group + 1 == gridDim.x) sums.spares_before[gridDim.x] = before[1] + (all >> 32);
}

// The last k of 0 to n - 1 for which upto(k) is no more than `number`, as all before it are, or 0. Three are
// asked at a time: what it waits for is memory.
template <class Upto>
__device__ __forceinline__ std::uint32_t last_upto(std::uint32_t n, Word number, Upto upto) {
  std::uint32_t first = 0;
  while (n > 1) {
    const std::uint32_t step = (n + 3) / 4, k1 = min(step, n - 1), k2 = min(2 * step, n - 1),
                        k3 = min(3 * step, n - 1);
    const Word u1 = upto(first + k1), u2 = upto(first + k2), u3 = upto(first + k3);
    const std::uint32_t low = u3 <= number   ? k3
                              : u2 <= number ? k2
                              : u1 <= number ? k1
                                             : 0,
                        high = u3 <= number   ? n
                               : u2 <= number ? k3
                               : u1 <= number ? k2
                                              : k1;
    first += low, n = max(high, low + 1) - low;
  }
  return first;
}
// The `number`-th spare place. What number_kernel wrote while this ran is no read-only data.
__device__ __forceinline__ Word spare_place(const Task& task, Word number) {
  const TileSums& sums = task.sums;
  const std::uint32_t group =
      last_upto(sums.all_groups, number, [&](std::uint32_t g) { return sums.spares_before[g]; });
  const auto n = static_cast<std::uint32_t>(number - sums.spares_before[group]);
  const Tiles tiles = tiles_of(task, group);
  const std::uint32_t tile =
      tiles.first + last_upto(tiles.end - tiles.first, n, [&](std::uint32_t k) -> Word {
        return k ? sums.spares[tiles.first + k - 1] : 0;
      });
  Word end = static_cast<Word>(tile + 1) * task.options.share.own;
  if (tile >= task.own_tiles) {
    const std::uint32_t unit = tile - task.own_tiles, word = __ldg(sums.shares + unit);
    end = __ldg(sums.bases + unit / kShareUnits) + (word >> kShareBits) + (word & kMostShare);
  }
  return end - (sums.spares[tile] - n);
}

// The hits that spilled to the list. Begins beside number_kernel, since most of what it reads is there
// already. Leaves the groups of tiles as they were before the search.
template <SlotKind Kind, bool Wide>
__global__ void __launch_bounds__(kFillThreads, 5) move_kernel(const __grid_constant__ Task task) {
  const TileSums& sums = task.sums;
  const std::uint32_t thread = blockIdx.x * kFillThreads + threadIdx.x, threads = gridDim.x * kFillThreads;
  // A thread's next hit is asked for before its last is moved, the first before it is known to be one.
  Word hit = 0;
  if (thread < sums.room) hit = __ldg(sums.spill + thread);
  const std::uint32_t flags = task.counters->flags;
  const Word count = min(task.counters->spilled, static_cast<Word>(sums.room));
  if (flags) return;
  Spilled<Kind, Wide> mine;
  if (thread < count) mine = {task, hit};
  await_before();
  for (std::uint32_t k = thread; k < 2 * sums.all_groups; k += threads) sums.groups[k] = 0;
  const Word spares = __ldcg(sums.spares_before + sums.all_groups), behind = behind_shares(task) - spares;
  for (Word from = thread; from < count;) {
    const Word next = from + threads;
    if (next < count) hit = __ldg(sums.spill + next);
    const Word number = from + sums.spill_at[mine.tile];
    mine.write(task, number < spares ? spare_place(task, number) : behind + number);
    if (next < count) mine = {task, hit};
    from = next;
  }
}

}  // namespace
}  // namespace padder::detect::cuda
