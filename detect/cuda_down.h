// Several levels of dense bins: the spheres of each level look down at the rows of finer bins that come near
// them. What a coarse sphere meets there are mostly contacts, while a fine sphere that looks up meets mostly
// strangers. A warp takes a unit: some spheres of one level (or some rows of one large sphere) and one finer
// level. Rows are dealt to lanes, then their candidates are, so that lanes stay busy however short the rows.
// Only cuda_search.cu includes this.
#pragma once
#include <algorithm>
#include <cmath>

#include "detect/cuda_judge.h"

namespace padder::detect::cuda {
namespace {

// A pair of levels. A sphere of the coarser one meets at most `side` bins of the finer one on an axis, and
// `side` * `side` rows.
struct Down {
  std::uint32_t first_unit, first, end;    // spheres `first` to `end` - 1 of the order
  std::uint32_t side, group, parts, rows;  // a unit: `group` spheres, of each `rows` rows
  std::uint32_t per_side, per_rows;        // 2^32 / side, 2^32 / rows, rounded up
  std::int32_t coarse, fine;
};
struct Downs {
  static constexpr int kMost = kMaxLevels * (kMaxLevels - 1) / 2;
  std::uint32_t count = 0, units = 0;
  Down pair[kMost];
};
struct NoDowns {
  std::uint32_t units = 0;
};
template <Way W>
struct DownsOf {
  using Type = NoDowns;
};
template <>
struct DownsOf<Way::down> {
  using Type = Downs;
};

// Lengths in bins of the finer level are floats; this much more covers their rounding, twice.
constexpr float kReachShare = 1 + 0x1p-16f, kReachMore = 0x1p-14f;

// How the levels are looked through; none where it cannot be done downwards: not where levels are hashed,
// where sizes differ so much that fixed-point slots of one level say nothing at another, or where it would be
// too many rows.
inline Downs plan_downs(const Grid& grid, SlotKind kind) {
  constexpr double kWidest = 100, kHits = 128, kRows = 2048;
  Downs downs;
  std::uint64_t first = 0, spheres = 0, units = 0;
  for (int c = 0; c < grid.levels; c++) spheres += grid.level[c].spheres;
  for (int c = 0; c < grid.levels; c++) {
    const Level& coarse = grid.level[c];
    if (coarse.hashed) return {};
    for (int f = 0; f < c; f++) {
      const Level& fine = grid.level[f];
      const double reach = (coarse.radius_max + fine.radius_max) * fine.per_size * kReachShare + kReachMore;
      if (reach > (kind == SlotKind::fixed ? kWidest : 8 * kWidest)) return {};
      Down d{};
      d.coarse = c, d.fine = f;
      d.side = static_cast<std::uint32_t>(2 * reach) + 2;
      const std::uint32_t all = d.side * d.side;
      // Of a sphere of three quarters of the largest radius: most are smaller.
      const double usual = (0.75 * coarse.radius_max + fine.radius_max) * fine.per_size;
      double hits = 4.19 * usual * usual * usual * static_cast<double>(fine.spheres) + 1e-9;
      for (const std::uint32_t side : fine.count) hits /= side;
      const double rows = std::min(kRows, std::max(2.0, all * std::min(1.0, kHits / hits)));
      d.group = hits < kHits
                    ? static_cast<std::uint32_t>(std::clamp(std::min(kHits / hits, kRows / all), 1.0, 32.0))
                    : 1;
      d.rows = std::min(all, static_cast<std::uint32_t>(rows));
      d.parts = (all + d.rows - 1) / d.rows;
      d.per_side = 0xffffffffu / d.side + 1, d.per_rows = 0xffffffffu / d.rows + 1;
      d.first = static_cast<std::uint32_t>(first),
      d.end = d.first + static_cast<std::uint32_t>(coarse.spheres);
      d.first_unit = static_cast<std::uint32_t>(units);
      units += (coarse.spheres + d.group - 1) / d.group * d.parts;
      // At most some hundred rows a sphere of the scene.
      if (units > spheres / 2 + 65536) return {};
      downs.pair[downs.count++] = d;
    }
    first += coarse.spheres;
  }
  downs.units = static_cast<std::uint32_t>(units);
  return downs;
}
inline std::uint32_t down_tiles(const Downs& downs) { return (downs.units + kWarps - 1) / kWarps; }

// The spheres of a unit, as the finer level sees them.
template <SlotKind Kind>
struct Lookers {
  typename SlotOf<Kind>::Type slot[32];
  float4 within[32];  // place within its bin, in bins, and its reach
  int4 bin[32];       // from the level's first
};

// Hits of a unit, to the queue; with a target, written as those from `base` on of the tile. `first`: place of
// the unit's first sphere.
template <SlotKind Kind>
__device__ __forceinline__ std::uint32_t search_down(const Task& task, const Grid& grid, const Downs& downs,
                                                     WarpMemory<Way::down>& memory, Lookers<Kind>& lookers,
                                                     std::uint32_t unit, const Target* target,
                                                     std::uint32_t base, std::uint32_t& first) {
  using Slot = typename SlotOf<Kind>::Type;
  const std::uint32_t lane = threadIdx.x & 31;
  std::uint32_t which = 0;
  for (std::uint32_t k = lane; k - lane < downs.count; k += 32)
    which += __popc(__ballot_sync(kAll, k < downs.count && downs.pair[k].first_unit <= unit));
  const Down& d = downs.pair[which - 1];
  const Level& l = grid.level[d.fine];
  const std::uint32_t number = (unit - d.first_unit) / d.parts,
                      from_row = (unit - d.first_unit - number * d.parts) * d.rows,
                      to_row = min(from_row + d.rows, d.side * d.side);
  first = d.first + number * d.group;
  // The bins may be those of another scene (backend_cuda.cu): places and radii are held within bounds.
  const std::uint32_t members =
      first < task.spheres.count ? min(min(d.group, d.end - first), task.spheres.count - first) : 0;
  __syncwarp();
  if (lane < members) {
    const Sphere s = sphere_at<Kind>(task, first + lane);
    const Split x = split(l, s.x), y = split(l, s.y), z = split(l, s.z);
    Slot slot;
    if constexpr (Kind == SlotKind::fixed)
      slot = {fixed_of(l, x), fixed_of(l, y), fixed_of(l, z), static_cast<float>(mul(s.r, l.units))};
    else
      slot = load_slot(slots_of<Kind>(task) + first + lane);
    lookers.slot[lane] = slot;
    const double r = smaller(s.r, grid.level[d.coarse].radius_max) + l.radius_max;
    lookers.within[lane] =
        make_float4(static_cast<float>(x.rest * l.per_size), static_cast<float>(y.rest * l.per_size),
                    static_cast<float>(z.rest * l.per_size),
                    static_cast<float>(r * l.per_size) * kReachShare + kReachMore);
    const auto near = [](std::int64_t bin) {
      return static_cast<int>(min(max(bin, -(std::int64_t(1) << 30)), std::int64_t(1) << 30));
    };
    lookers.bin[lane] =
        make_int4(near(x.bin - l.first[0]), near(y.bin - l.first[1]), near(z.bin - l.first[2]), 0);
  }
  __syncwarp();
  const int count_x = static_cast<int>(l.count[0]), count_y = static_cast<int>(l.count[1]),
            count_z = static_cast<int>(l.count[2]);
  const Slot* const slots = slots_of<Kind>(task);
  const std::uint32_t* const table = task.spheres.table + l.offset + 1;
  const std::uint32_t items = members * d.rows, side = d.side, rows = d.rows, per_side = d.per_side,
                      per_rows = d.per_rows;
  std::uint32_t hits = 0;
#pragma unroll 1
  for (std::uint32_t at = lane; at - lane < items; at += 32) {
    const std::uint32_t who = rows == 1 ? at : __umulhi(at, per_rows), row = from_row + at - who * rows;
    std::uint32_t begin = 0, count = 0;
    if (at < items && row < to_row) {
      const float4 p = lookers.within[who];
      const int4 bin = lookers.bin[who];
      const std::uint32_t iz = __umulhi(row, per_side), iy = row - iz * side;
      const int dy = __float2int_rd(p.y - p.w) + static_cast<int>(iy),
                dz = __float2int_rd(p.z - p.w) + static_cast<int>(iz), y = bin.y + dy, z = bin.z + dz;
      const float gap_y = fmaxf(fmaxf(dy - p.y, p.y - (dy + 1)), 0.f),
                  gap_z = fmaxf(fmaxf(dz - p.z, p.z - (dz + 1)), 0.f),
                  rest = fmaf(p.w, p.w, fmaf(-gap_y, gap_y, -gap_z * gap_z));
      if (rest >= 0 && y >= 0 && y < count_y && z >= 0 && z < count_z) {
        const float half = sqrtf(rest);
        const int low = max(bin.x + __float2int_rd(p.x - half), 0),
                  high = min(bin.x + __float2int_rd(p.x + half), count_x - 1);
        if (low <= high) {
          const std::uint32_t key = static_cast<std::uint32_t>((z + 1) * (count_y + 2) + y + 1) *
                                        static_cast<std::uint32_t>(count_x + 2) +
                                    static_cast<std::uint32_t>(low);
          begin = __ldg(table + key), count = __ldg(table + key + (high - low + 1)) - begin;
        }
      }
    }
    std::uint32_t upto = count;
#pragma unroll
    for (int k = 1; k < 32; k <<= 1) {
      const std::uint32_t u = __shfl_up_sync(kAll, upto, k);
      if (static_cast<int>(lane) >= k) upto += u;
    }
    const std::uint32_t total = __shfl_sync(kAll, upto, 31), shift = begin + count - upto;
#pragma unroll 1
    for (std::uint32_t t = lane; t - lane < total; t += 32) {
      int owner = 0;  // the lane whose row has candidate t
#pragma unroll
      for (int k = 16; k; k >>= 1)
        if (__shfl_sync(kAll, upto, owner + k - 1) <= t) owner += k;
      const std::uint32_t j = t + __shfl_sync(kAll, shift, owner), i = __shfl_sync(kAll, who, owner);
      bool hit = false;
      if (t < total) {
        const Slot a = lookers.slot[i], b = load_slot(slots + j);
        const float3 x = difference(a, b);
        float s2 = task.s2;
        if constexpr (Kind != SlotKind::equal) s2 = (a.r + b.r) * (a.r + b.r);
        const float e =
            fmaf(x.z, x.z, fmaf(x.y, x.y, fmaf(x.x, x.x, fmaf(-kWide, s2, -2 * kAbsoluteBand<Slot>))));
        hit = e < 0;
        if (hit && (task.judge_all || !(e < -(s2 * (kNear * 1.001f) + 4 * kAbsoluteBand<Slot>))))
          hit = contact<Kind, Way::down>(task, grid, first + i, a, j, {}, !target);
      }
      const std::uint32_t has = __ballot_sync(kAll, hit);
      if (hit) {
        const std::uint32_t to = hits + __popc(has & ((1u << lane) - 1));
        if (target)
          put<Kind>(task, *target, base + to, first + i, j);
        else if (to < kQueue<Way::down>)
          memory.at[to] = j, memory.lane[to] = static_cast<unsigned char>(i);
      }
      hits += __popc(has);
    }
  }
  return hits;
}

// The same out of line, for the few units with more hits than the queue holds.
template <SlotKind Kind>
__device__ __noinline__ void write_down(const Task& task, const Grid& grid, const Downs& downs,
                                        WarpMemory<Way::down>& memory, Lookers<Kind>& lookers,
                                        std::uint32_t unit, const Target* target, std::uint32_t base) {
  std::uint32_t first;
  search_down<Kind>(task, grid, downs, memory, lookers, unit, target, base, first);
}

}  // namespace
}  // namespace padder::detect::cuda
