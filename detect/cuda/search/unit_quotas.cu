// SPDX-License-Identifier: MIT
// Quotas of units: how many output slots each has to itself in a list of stable order. A unit's quota is
// proportional to the contacts that its spheres can be expected to find, from their radii and from how many
// spheres of the searched level there are in a bin. Where spheres are spread evenly, nine in ten contacts are
// then written where they stay; the compaction moves the others (compaction.h).
#include <cub/block/block_scan.cuh>

#include "detect/cuda/device/overlapped_launch.h"
#include "detect/cuda/device/ptx.h"
#include "detect/cuda/device/warp.h"
#include "detect/cuda/search/launch.h"

namespace padder::detect::cuda {
namespace {

constexpr float kBall = 4.18879f;  // volume of the unit ball
// The part of a ball of radius 1 / `per_reach` around p that lies between 0 and n of an axis.
__device__ __forceinline__ float part_inside(float p, float n, float per_reach) {
  const float low = fmaxf(-p * per_reach, -1.f), high = fminf((n - p) * per_reach, 1.f);
  return fmaxf(0.25f * (high * (3 - high * high) - low * (3 - low * low)), 0.f);
}
// The integral of 2 sqrt(1 - t^2), to two thousandths.
__device__ __forceinline__ float disc(float t) {
  t = fminf(fmaxf(t, -1.f), 1.f);
  const float t2 = t * t, t4 = t2 * t2;
  return t * (2 - t2 * (1 / 3.f + t2 * (0.05f + 0.0459f * t4)));
}

// Volumes of a warp's spheres: of 32 units of 32 spheres. One entry in 33 stays unused, so that lanes whose
// units lie 8, 16 or 32 spheres apart do not meet at a bank.
constexpr std::uint32_t kWarpSpheres = 32 * 32;
__device__ __forceinline__ std::uint32_t padded(std::uint32_t k) { return k + k / 32; }
struct VolumeMemory {
  float volume[kWarpSpheres + kWarpSpheres / 32];
};

// The rows of a part, layer by layer. `p`: centre in bins of the searched level, `n`: how many bins there
// are. `reach`: search radius of the usual sphere there, `widest`: of the largest.
__device__ __forceinline__ float volume_of_rows(const float (&p)[3], const float (&n)[3], float reach,
                                                float widest, std::uint32_t part, std::uint32_t parts) {
  const float y0 = fmaxf(floorf(p[1] - widest), 0.f), y1 = fminf(floorf(p[1] + widest), n[1] - 1),
              z0 = fmaxf(floorf(p[2] - widest), 0.f), z1 = fminf(floorf(p[2] + widest), n[2] - 1);
  if (!(y0 <= y1 && z0 <= z1)) return 0;
  const auto side = static_cast<std::uint32_t>(y1 - y0) + 1,
             all = side * (static_cast<std::uint32_t>(z1 - z0) + 1), each = (all + parts - 1) / parts;
  const float y_at = p[1] - y0, z_at = p[2] - z0;
  float sum = 0;
  const std::uint32_t from = min(part * each, all);
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
  return sum;
}

// The volume that one sphere reaches, or that a part of its rows covers of it, in bins. `fine`: radius of the
// usual sphere there.
template <SlotKind Kind>
__device__ __forceinline__ float volume_of_part(const SearchTask& task, const Grid& grid,
                                                const LevelPairs& pairs, const LevelPair& d,
                                                std::uint32_t unit_of_pair, float fine) {
  const Level& l = grid.level[d.at];
  const std::uint32_t warp = d.warp_units == 1 ? unit_of_pair : unit_of_pair / d.warp_units;
  const auto [number, part] = work_of_unit(d, warp, unit_of_pair - warp * d.warp_units);
  const SpheresOfLevel spheres = spheres_of(task, d);
  if (number >= spheres.count) return 0;
  const Sphere s = sphere_of_slot<Kind>(task, spheres.first + number);
  const float widest = search_radius(grid, pairs.bins, d.from, d.at, s.r),
              per_size = static_cast<float>(l.per_size);
  const std::uint32_t parts = parts_of(d, l, widest);
  if (part >= parts) return 0;
  float p[3], n[3];
#pragma unroll
  for (int k = 0; k < 3; k++) {
    const double x = k == 0 ? s.x : k == 1 ? s.y : s.z;
    p[k] = static_cast<float>(x * l.per_size - static_cast<double>(l.first[k]));
    n[k] = static_cast<float>(l.count[k]);
  }
  const float reach = (static_cast<float>(s.r) + fine) * per_size, per_reach = __frcp_rn(reach),
              inside = part_inside(p[0], n[0], per_reach);
  if (parts == 1)
    return kBall * reach * reach * reach * inside * part_inside(p[1], n[1], per_reach) *
           part_inside(p[2], n[2], per_reach);
  return inside * volume_of_rows(p, n, reach, widest, part, parts);
}

// The same of groups of spheres, for lanes `from` to `upto` - 1 of the warp; `mine`: the lane is one of them.
// Lanes read the radii side by side.
template <SlotKind Kind>
__device__ __forceinline__ float volume_of_groups(const SearchTask& task, const Grid& grid,
                                                  const LevelPair& d, VolumeMemory& memory,
                                                  std::uint32_t unit_of_pair, std::uint32_t from,
                                                  std::uint32_t upto, bool mine, float fine) {
  const std::uint32_t lane = threadIdx.x & 31;
  const float unit_of_slot =
                  Kind == SlotKind::fixed_point ? static_cast<float>(1 / grid.level[d.from].units) : 1.f,
              per_size = static_cast<float>(grid.level[d.at].per_size);
  const SpheresOfLevel of_level = spheres_of(task, d);
  const std::uint32_t number = unit_of_pair * d.group,
                      spheres = of_level.left(number, (upto - from) * d.group);
  const auto* const slots = slots_of<Kind>(task) + of_level.first + number;
  constexpr std::uint32_t kAtOnce = 16;
  for (std::uint32_t k0 = lane; k0 - lane < spheres; k0 += 32 * kAtOnce) {
    float r[kAtOnce];
#pragma unroll
    for (std::uint32_t u = 0; u < kAtOnce; u++) r[u] = __ldg(&slots[min(k0 + 32 * u, spheres - 1)].r);
#pragma unroll
    for (std::uint32_t u = 0; u < kAtOnce; u++) {
      const float reach = fmaf(r[u], unit_of_slot, fine) * per_size;
      if (k0 + 32 * u < spheres) memory.volume[padded(k0 + 32 * u)] = kBall * reach * reach * reach;
    }
  }
  __syncwarp();
  float volume = 0;
  if (mine)
    for (std::uint32_t k = (lane - from) * d.group, n = min(k + d.group, spheres); k < n; k++)
      volume += memory.volume[padded(k)];
  __syncwarp();  // all have read what is written over
  return volume;
}

// Contacts that a unit can be expected to find, in 16ths; none behind the last unit. By all lanes, whose
// units follow each other. Spheres of the searched level are taken for 0.68 of the largest.
template <SlotKind Kind>
__device__ __forceinline__ float expected_contacts(const SearchTask& task, const Grid& grid,
                                                   const LevelPairs& pairs, VolumeMemory& memory,
                                                   std::uint32_t unit) {
  const std::uint32_t lane = threadIdx.x & 31, lowest = unit - lane;
  std::uint32_t which = 0;  // neighbours are mostly of the same pair of levels
  for (std::uint32_t k = lane; k - lane < pairs.count; k += 32)
    which += __popc(__ballot_sync(kFullWarp, k < pairs.count && pairs.pair[k].first_unit <= lowest));
  which--;
  float contacts = 0;
  for (std::uint32_t from = 0; from < 32 && lowest + from < task.units;) {
    const LevelPair& d = pairs.pair[which];
    const Level& l = grid.level[d.at];
    const std::uint32_t end = which + 1 < pairs.count ? pairs.pair[which + 1].first_unit : task.units,
                        // Of the pair, lanes `from` to `upto` - 1, as many as there is memory for.
        upto = min(min(end - lowest, 32u), from + kWarpSpheres / d.group);
    const bool mine = lane >= from && lane < upto;
    const float grown = static_cast<float>(l.grown_by),
                fine = 0.68f * (static_cast<float>(l.radius_max) - grown) + 2 * grown;
    float volume = 0;
    if (d.group > 1)
      volume =
          volume_of_groups<Kind>(task, grid, d, memory, lowest + from - d.first_unit, from, upto, mine, fine);
    else if (mine)
      volume = volume_of_part<Kind>(task, grid, pairs, d, unit - d.first_unit, fine);
    if (mine) contacts = 16 * d.density * volume;
    from = upto;
    if (lowest + from == end) which++;
  }
  return contacts;
}

// By a warp: the slots of all groups before `group`, which has `own`, by looking back. A word of a group says
// in its upper bits whether it holds the slots of that group or of all groups up to it. Groups start in the
// order of their numbers, and the kernel has no more blocks than run at once, so that each word is written
// sooner or later.
__device__ __forceinline__ Word slots_before_group(Word* words, std::uint32_t group, Word own) {
  constexpr Word kOne = Word(1) << 62, kAllUpto = Word(1) << 63, kSlots = kOne - 1;
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
    const std::uint32_t whole = __ballot_sync(kFullWarp, word >= kAllUpto);
    Word sum = (whole & ((1u << lane) - 1)) == 0 ? word & kSlots : 0;
#pragma unroll
    for (int d = 16; d; d >>= 1) sum += __shfl_xor_sync(kFullWarp, sum, d);
    before += sum, more = whole == 0;
  }
  if (lane == 0) of_groups[group] = kAllUpto | (before + own);
  return before;
}

// Computes the quotas of groups of units, and the first output slot of each group. The search starts when all
// blocks of this run; who needs a quota waits for the end of this.
template <SlotKind Kind>
__global__ void __launch_bounds__(kQuotaUnits, 4)
    unit_quota_kernel(const __grid_constant__ SearchTask task, const __grid_constant__ Grid grid,
                      const __grid_constant__ LevelPairs pairs) {
  using Scan = cub::BlockScan<std::uint32_t, kQuotaUnits>;
  __shared__ VolumeMemory of_warp[kQuotaUnits / 32];
  __shared__ typename Scan::TempStorage memory;
  wait_for_previous_kernel();  // the search must not start before the spheres are in order
  allow_next_kernel();
  if (task.counters->flags) return;
  const StableOutput& stable = task.stable;
  std::uint32_t expected = 0;
  for (std::uint32_t group = blockIdx.x; group < stable.quota_groups; group += gridDim.x) {
    const std::uint32_t unit = group * kQuotaUnits + threadIdx.x;
    const auto contacts = static_cast<std::uint32_t>(  // in 16ths
        fminf(expected_contacts<Kind>(task, grid, pairs, of_warp[threadIdx.x / 32], unit),
              16.f * kMostQuota));
    const std::uint32_t quota =
        min(static_cast<std::uint32_t>(static_cast<float>(contacts) * task.quota.unit), kMostQuota);
    std::uint32_t before, all;
    Scan(memory).ExclusiveSum(quota, before, all);
    if (unit < task.units) stable.unit_quotas[unit] = before << kQuotaBits | quota;
    if (threadIdx.x < 32) {
      const Word base =
          task.tile_quotas.slot[task.tile_quotas.levels] + slots_before_group(stable.quota_sums, group, all);
      if (threadIdx.x == 0) stable.quota_bases[group] = base;
      if (threadIdx.x == 0 && group + 1 == stable.quota_groups) stable.quota_bases[group + 1] = base + all;
    }
    expected += contacts;
    if (group + gridDim.x < stable.quota_groups) __syncthreads();  // the scan's memory is used again
  }
  expected = __reduce_add_sync(kFullWarp, expected);
  if ((threadIdx.x & 31) == 0 && expected) atomicAdd(&task.counters->expected, static_cast<Word>(expected));
}

}  // namespace

void launch_unit_quotas(const SearchTask& task, const Grid& grid, const LevelPairs& pairs, bool overlapped,
                        int processors, cudaStream_t stream) {
  with_kind(task.spheres.kind, [&](auto kind) {
    const auto kernel = unit_quota_kernel<kind()>;
    // Groups wait for those before them, so all blocks must run at once.
    const unsigned resident =
                       resident_blocks(reinterpret_cast<const void*>(kernel), kQuotaUnits, 0, processors),
                   blocks = std::min(task.stable.quota_groups, resident);
    if (overlapped)
      launch_overlapped(kernel, {blocks, kQuotaUnits}, stream, task, grid, pairs);
    else
      kernel<<<blocks, kQuotaUnits, 0, stream>>>(task, grid, pairs);
  });
  cuda_launched("search for contacts");
}

}  // namespace padder::detect::cuda
