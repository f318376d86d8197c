// SPDX-License-Identifier: MIT
// Places in the list for units that look down, where its order is fixed: each has about as many to itself as
// its spheres can be expected to meet there, from their radii and how many spheres of the finer level there
// are in a bin. Where those lie evenly, nine in ten hits are then written where they stay; what is wrong is
// put right afterwards (fill_flow.h, number.h). Only search.cu includes this.
#pragma once
#include <cmath>

#include "detect/cuda/output/output_slots.h"
#include "detect/cuda/search/coarse_to_fine.h"

namespace padder::detect::cuda {
namespace {

constexpr float kBall = 4.18879f;
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

// Where the radii of a warp's spheres are put together: of 32 units of 32 spheres, so that lanes whose units
// lie 8, 16, 32 spheres apart do not meet at a bank.
constexpr std::uint32_t kShareSpheres = 32 * 32;
__device__ __forceinline__ std::uint32_t apart(std::uint32_t k) { return k + k / 32; }
struct ShareMemory {
  float volume[kShareSpheres + kShareSpheres / 32];
};

// Hits of one sphere, or of a part of its rows.
template <SlotKind Kind>
__device__ __forceinline__ float expected_of_part(const Task& task, const Grid& grid, const Down& d,
                                                  std::uint32_t number_of_unit, float fine) {
  const Level& l = grid.level[d.fine];
  const std::uint32_t warp = d.turns == 1 ? number_of_unit : number_of_unit / d.turns;
  const auto [first, part] = piece_of(d, warp, number_of_unit - warp * d.turns);
  if (first >= min(d.end, task.spheres.count)) return 0;
  const Sphere s = sphere_at<Kind>(task, first);
  const float widest = reach_of(grid, d, s.r), per_size = static_cast<float>(l.per_size);
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
    return kBall * reach * reach * reach * volume * cut(p[1], n[1], per_reach) * cut(p[2], n[2], per_reach);
  // The part's rows, layer by layer.
  const float y0 = fmaxf(floorf(p[1] - widest), 0.f), y1 = fminf(floorf(p[1] + widest), n[1] - 1),
              z0 = fmaxf(floorf(p[2] - widest), 0.f), z1 = fminf(floorf(p[2] + widest), n[2] - 1);
  if (!(y0 <= y1 && z0 <= z1)) return 0;
  const auto side = static_cast<std::uint32_t>(y1 - y0) + 1,
             all = side * (static_cast<std::uint32_t>(z1 - z0) + 1), each = (all + parts - 1) / parts;
  const float y_at = p[1] - y0, z_at = p[2] - z0;
  float sum = 0;
#pragma unroll 1
  for (std::uint32_t piece = 0, of = part; piece < d.pieces && of < parts; piece++, of += d.step) {
    const std::uint32_t from = min(of * each, all);
    std::uint32_t z = from / side, y = from - z * side;
#pragma unroll 1
    for (std::uint32_t left = min(each, all - from); left; z++) {
      const std::uint32_t upto = min(y + left, side);
      const float dz = static_cast<float>(z) + 0.5f - z_at, rest = fmaf(reach, reach, -dz * dz) - 1 / 12.f;
      if (rest > 0) {
        const float per = rsqrtf(rest);
        sum += rest *
               (disc((static_cast<float>(upto) - y_at) * per) - disc((static_cast<float>(y) - y_at) * per));
      }
      left -= upto - y, y = 0;
    }
  }
  return volume * sum;
}

// Hits of a unit, in 16ths, none behind the last unit; by all lanes, whose units follow each other. Spheres
// of the finer level are taken for 0.68 of the largest.
template <SlotKind Kind>
__device__ __forceinline__ float expected_hits(const Task& task, const Grid& grid, const Downs& downs,
                                               ShareMemory& memory, std::uint32_t unit) {
  const std::uint32_t lane = threadIdx.x & 31, lowest = unit - lane;
  // Neighbours are mostly of the same pair of levels.
  std::uint32_t which = 0;
  for (std::uint32_t k = lane; k - lane < downs.count; k += 32)
    which += __popc(__ballot_sync(kAll, k < downs.count && downs.pair[k].first_unit <= lowest));
  which--;
  float hits = 0;
  for (std::uint32_t from = 0; from < 32 && lowest + from < task.units;) {
    const Down& d = downs.pair[which];
    const Level& l = grid.level[d.fine];
    const std::uint32_t end = which + 1 < downs.count ? downs.pair[which + 1].first_unit : task.units,
                        // Of the pair, lanes `from` to `upto` - 1, as many as there is memory for.
        upto = min(min(end - lowest, 32u), from + kShareSpheres / d.wide);
    const bool mine = lane >= from && lane < upto;
    const float fine = 0.68f * static_cast<float>(l.radius_max);
    float found = 0;
    if (d.wide > 1) {
      const float unit_of_slot = Kind == SlotKind::fixed_point
                                     ? static_cast<float>(1 / grid.level[d.coarse].units)
                                     : 1.f,
                  per_size = static_cast<float>(l.per_size);
      const std::uint32_t first = d.first + (lowest + from - d.first_unit) * d.wide,
                          behind = min(d.end, task.spheres.count),
                          spheres = first < behind ? min((upto - from) * d.wide, behind - first) : 0;
      const auto* const slots = slots_of<Kind>(task) + first;
      constexpr std::uint32_t kAtOnce = 16;
      for (std::uint32_t k0 = lane; k0 - lane < spheres; k0 += 32 * kAtOnce) {
        float r[kAtOnce];
#pragma unroll
        for (std::uint32_t u = 0; u < kAtOnce; u++) r[u] = __ldg(&slots[min(k0 + 32 * u, spheres - 1)].r);
#pragma unroll
        for (std::uint32_t u = 0; u < kAtOnce; u++) {
          const float reach = fmaf(r[u], unit_of_slot, fine) * per_size;
          if (k0 + 32 * u < spheres) memory.volume[apart(k0 + 32 * u)] = kBall * reach * reach * reach;
        }
      }
      __syncwarp();
      if (mine)
        for (std::uint32_t k = (lane - from) * d.wide, n = min(k + d.wide, spheres); k < n; k++)
          found += memory.volume[apart(k)];
      __syncwarp();  // all have read what is written over
    } else if (mine) {
      found = expected_of_part<Kind>(task, grid, d, unit - d.first_unit, fine);
    }
    if (mine) hits = 16 * d.density * found;
    from = upto;
    if (lowest + from == end) which++;
  }
  return hits;
}

// Host. Places for `tiles` tiles of flow.h, `places` in all and never more: what is left spare must not
// exceed what spills. At each level in proportion to how many of its spheres are within reach of one.
inline TileShares tile_shares(const Grid& grid, std::uint64_t places, std::uint32_t tiles) {
  TileShares s;
  double weight[kMaxLevels], sum = 0;
  std::uint64_t first = 0;
  s.levels = grid.levels;
  for (int k = 0; k < grid.levels; k++) {
    const Level& l = grid.level[k];
    weight[k] = static_cast<double>(l.spheres) * std::pow(l.radius_max * l.per_size, 3) /
                    (static_cast<double>(l.count[0]) * l.count[1] * l.count[2]) +
                1e-30;
    if (k) weight[k] = std::clamp(weight[k], 0x1p-5 * weight[0], 0x1p5 * weight[0]);
    s.first[k] = std::min(static_cast<std::uint32_t>((first + kFlowTile - 1) / kFlowTile), tiles),
    first += l.spheres;
  }
  const auto end = [&](int k) { return k + 1 < grid.levels ? s.first[k + 1] : tiles; };
  for (int k = 0; k < grid.levels; k++) sum += weight[k] * (end(k) - s.first[k]);
  for (int k = 0; k < grid.levels; k++) {
    s.share[k] = static_cast<std::uint32_t>(static_cast<double>(places) / sum * weight[k]);
    s.place[k + 1] = s.place[k] + static_cast<std::uint64_t>(s.share[k]) * (end(k) - s.first[k]);
  }
  return s;
}

// By a warp: the places of all groups before `group`, which has `own`. Groups begin in the order of their
// numbers, so that those before it have theirs soon, whatever else the device does. A word tells in its upper
// bits whether it holds the places of one group or of all up to it.
__device__ __forceinline__ Word places_before(Word* words, std::uint32_t group, Word own) {
  constexpr Word kOne = Word(1) << 62, kAllUpto = Word(1) << 63, kPlaces = kOne - 1;
  const std::uint32_t lane = threadIdx.x & 31;
  volatile Word* const of_groups = words;
  if (lane == 0) of_groups[group] = kOne | own;
  Word before = 0;
  bool more = true;
#pragma unroll 1
  for (std::int64_t end = group; more && end > 0; end -= 32) {
    const std::int64_t g = end - 1 - lane;
    Word word = kAllUpto;
    while (g >= 0 && (word = of_groups[g]) == 0) {
    }
    const std::uint32_t whole = __ballot_sync(kAll, word >= kAllUpto);
    Word sum = (whole & ((1u << lane) - 1)) == 0 ? word & kPlaces : 0;
#pragma unroll
    for (int d = 16; d; d >>= 1) sum += __shfl_xor_sync(kAll, sum, d);
    before += sum, more = whole == 0;
  }
  if (lane == 0) of_groups[group] = kAllUpto | (before + own);
  return before;
}

// Groups of units: their shares, and where those begin in the list. The search may begin when all blocks of
// this have begun; who needs the shares waits for the end of it.
template <SlotKind Kind>
__global__ void __launch_bounds__(kShareUnits, 4)
    share_kernel(const __grid_constant__ Task task, const __grid_constant__ Grid grid,
                 const __grid_constant__ Downs downs) {
  using Scan = cub::BlockScan<std::uint32_t, kShareUnits>;
  __shared__ ShareMemory of_warp[kShareUnits / 32];
  __shared__ typename Scan::TempStorage memory;
  await_before();  // what comes next must not begin before the spheres are in order
  begin_next();
  if (task.counters->flags) return;
  const TileSums& sums = task.sums;
  // Behind the last tile, so that eight can be read at a time.
  if (sums.eights && blockIdx.x == 0 && threadIdx.x < 8)
    sums.counts[task.own_tiles + task.units + threadIdx.x] = 0;
  std::uint32_t expected = 0;
  for (std::uint32_t group = blockIdx.x; group < sums.share_groups; group += gridDim.x) {
    const std::uint32_t unit = group * kShareUnits + threadIdx.x;
    const auto hits = static_cast<std::uint32_t>(  // in 16ths
        fminf(expected_hits<Kind>(task, grid, downs, of_warp[threadIdx.x / 32], unit), 16.f * kMostShare));
    const std::uint32_t share =
        min(static_cast<std::uint32_t>(static_cast<float>(hits) * task.options.share.unit), kMostShare);
    std::uint32_t before, all;
    Scan(memory).ExclusiveSum(share, before, all);
    if (unit < task.units) sums.shares[unit] = before << kShareBits | share;
    if (threadIdx.x < 32) {
      const Word base = task.shares.place[task.shares.levels] + places_before(sums.share_sums, group, all);
      if (threadIdx.x == 0) sums.bases[group] = base;
      if (threadIdx.x == 0 && group + 1 == sums.share_groups) sums.bases[group + 1] = base + all;
    }
    expected += hits;
    if (group + gridDim.x < sums.share_groups) __syncthreads();  // the scan's memory is used again
  }
  expected = __reduce_add_sync(kAll, expected);
  if ((threadIdx.x & 31) == 0 && expected) atomicAdd(&task.counters->expected, static_cast<Word>(expected));
}

}  // namespace
}  // namespace padder::detect::cuda
