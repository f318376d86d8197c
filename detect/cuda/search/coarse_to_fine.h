// SPDX-License-Identifier: MIT
// Several levels of dense bins: the spheres of each level look down at the rows of finer bins that come near
// them. What a coarse sphere meets there are mostly contacts, while a fine sphere that looks up meets mostly
// strangers. A warp takes a unit: some spheres of one level (or some rows of one large sphere) and one finer
// level. Rows are dealt to lanes, then their candidates are, so that lanes stay busy however short the rows.
// Only search.cu includes this.
#pragma once
#include <algorithm>
#include <cmath>

#include "detect/cuda/search/exact_test.h"

namespace padder::detect::cuda {
namespace {

// A pair of levels. A unit: `group` spheres of the coarser one and all their rows of the finer one; or one
// sphere and a part of its rows, of so many parts as its size asks for, `parts` at most. A warp takes `turns`
// units one after the other, of parts far from each other: most spheres have only the first of them. In
// flow.h a unit may be of several `pieces`: groups that follow each other, or parts far from each other.
struct Down {
  std::uint32_t first_warp, first_unit, first, end;  // spheres `first` to `end` - 1 of the order
  std::uint32_t group, parts, turns, step;           // step: parts / turns / pieces, rounded up
  std::uint32_t pieces, wide;                        // wide: spheres from one unit to the next
  float per_part;  // parts of a sphere that reaches one bin far; more with the third power of its reach
  float density;   // spheres of the finer level in a bin
  std::int32_t coarse, fine;
};
// What a warp looks at for one turn or piece: its first sphere of `group`, and which part of that one's rows.
// `warp`: of those of the pair.
struct Piece {
  std::uint32_t first, part;
};
__host__ __device__ __forceinline__ Piece piece_of(const Down& d, std::uint32_t warp, std::uint32_t piece) {
  const std::uint32_t number = d.step == 1 ? warp : warp / d.step;
  if (d.parts == 1) return {d.first + number * d.wide + piece * d.group, 0};
  return {d.first + number * d.wide, warp - number * d.step + piece * d.step};
}
struct Downs {
  static constexpr int kMost = kMaxLevels * (kMaxLevels - 1) / 2;
  static constexpr bool kLevels = true;
  std::uint32_t count = 0, warps = 0, units = 0;
  Down pair[kMost];
  LevelBins bins;  // where the order is by them
};
struct NoDowns {
  static constexpr bool kLevels = false;
};
template <Way W>
struct DownsOf {
  using Type = NoDowns;
};
template <>
struct DownsOf<Way::down> {
  using Type = Downs;
};

// From so many on a warp takes units as long as there are any, instead of one.
constexpr std::uint64_t kManySpheres = 300000;

// From so many on a unit of a flow of fixed order has two pieces: fewer hits miss its share, and the row of
// pairs runs dry less often. Of fewer spheres the last units would take too long.
constexpr std::uint64_t kManyPieces = 3000000;

// Lengths in bins of the finer level are floats; this much more covers their rounding, twice.
constexpr float kReachShare = 1 + 0x1p-16f, kReachMore = 0x1p-14f;

// How the levels are looked through; none where it cannot be done downwards: not where levels are hashed,
// where sizes differ so much that fixed-point slots of one level say nothing at another, or where it would be
// too many rows. Flows: units for flow.h, which are larger, since nothing but the work is divided into them.
inline Downs plan_downs(const Grid& grid, SlotKind kind, bool flows = false, bool stable_order = false) {
  constexpr double kWidest = 100, kRows = 2048;
  const double most_hits = flows ? 500 : 128, part_hits = flows ? 1000 : 160;
  Downs downs;
  std::uint64_t first = 0, spheres = 0, units = 0, warps = 0;
  for (int c = 0; c < grid.levels; c++) spheres += grid.level[c].spheres;
  if (spheres >= kOfUnit) return {};
  for (int c = 0; c < grid.levels; c++) {
    const Level& coarse = grid.level[c];
    if (coarse.hashed) return {};
    for (int f = 0; f < c; f++) {
      const Level& fine = grid.level[f];
      const double reach = (coarse.radius_max + fine.radius_max) * fine.per_size * kReachShare + kReachMore;
      if (reach > (kind == SlotKind::fixed_point ? kWidest : 8 * kWidest)) return {};
      Down d{};
      d.coarse = c, d.fine = f;
      const double all = (2 * reach + 2) * (2 * reach + 2);    // rows, at most
      double full = 4.19 * static_cast<double>(fine.spheres);  // hits of a sphere that reaches one bin far
      for (const std::uint32_t side : fine.count) full /= side;
      d.density = static_cast<float>(full / 4.19);
      // Of a sphere of three quarters of the largest radius: most are smaller.
      const double usual = (0.75 * coarse.radius_max + fine.radius_max) * fine.per_size,
                   hits = full * usual * usual * usual + 1e-9;
      d.group = d.parts = 1;
      if (hits < most_hits)
        d.group = static_cast<std::uint32_t>(std::clamp(std::min(most_hits / hits, kRows / all), 1.0, 32.0));
      if (d.group == 1) {
        const double parts = std::max(full / part_hits, all / kRows / (reach * reach * reach));
        d.per_part = static_cast<float>(parts);
        d.parts = static_cast<std::uint32_t>(
            std::clamp(std::ceil(parts * reach * reach * reach), 1.0, std::max(1.0, all / 2)));
      }
      d.first = static_cast<std::uint32_t>(first),
      d.end = d.first + static_cast<std::uint32_t>(coarse.spheres);
      d.turns = flows || d.parts < 8 || spheres < kManySpheres ? 1 : 3;
      d.pieces = 1;
      if (flows && stable_order && spheres >= kManyPieces)
        d.pieces = d.parts > 1 || 2 * d.group * hits <= most_hits ? 2 : 1;
      d.wide = d.parts > 1 ? 1 : d.group * d.pieces;
      d.step = d.parts == 1 ? 1 : (d.parts + d.turns * d.pieces - 1) / (d.turns * d.pieces);
      d.first_unit = static_cast<std::uint32_t>(units), d.first_warp = static_cast<std::uint32_t>(warps);
      const std::uint64_t more = (coarse.spheres + d.wide - 1) / d.wide * d.step;
      warps += more, units += more * d.turns;
      // At most some hundred rows a sphere of the scene.
      if (units > spheres / 2 + 65536 || units > kMostUnits) return {};
      downs.pair[downs.count++] = d;
    }
    first += coarse.spheres;
  }
  downs.units = static_cast<std::uint32_t>(units), downs.warps = static_cast<std::uint32_t>(warps);
  return downs;
}

// The spheres of a unit that meet rows of the finer level, in bins of that.
template <SlotKind Kind>
struct Lookers {
  typename SlotOf<Kind>::Type slot[32];
  float4 within[32];          // centre: x within its bin, y and z from the first row; reach
  int4 rows[32];              // x of its bin, key of its first row, its first item, 2^32 / rows along y
  std::uint32_t side[32];     // rows along y; its number in the unit << 16
  uint2 row[64];              // rows with candidates: place of the first less its number, looker
  std::uint32_t unit, first;  // its number, its first sphere
  std::uint32_t left, more;   // units that the warp has after it, and of those some may have rows
  Target target;
  __device__ __forceinline__ std::uint32_t place(std::uint32_t looker) const {
    return first + (side[looker] >> 16);
  }
};

// How far a sphere of radius r reaches among those of the finer level, in bins of that, and into how many
// parts its rows are divided. A unit beyond the last part is empty.
__device__ __forceinline__ float reach_of(const Grid& grid, const Down& d, double r) {
  const Level& l = grid.level[d.fine];
  r = smaller(r, grid.level[d.coarse].radius_max) + l.radius_max;
  return __fmaf_rn(static_cast<float>(r * l.per_size), kReachShare, kReachMore);
}
__device__ __forceinline__ std::uint32_t parts_of(const Down& d, float reach) {
  if (d.parts == 1) return 1;
  const float parts = __fmul_rn(__fmul_rn(d.per_part, reach), __fmul_rn(reach, reach));
  return min(d.parts, static_cast<std::uint32_t>(parts) + 1);
}

// Where a coordinate lies among the finer level's bins: in which, from the first on, and how far in it, in
// bins. `bins`: in float, if the order is by them.
struct InBins {
  int bin;
  float rest;
};
__device__ __forceinline__ InBins in_bins(const Level& l, const FloatBins* bins, int axis, double x) {
  constexpr std::int64_t kFar = std::int64_t(1) << 30;
  if (bins) {
    const double t = (x - static_cast<double>(bins->origin[axis])) *
                     static_cast<double>(bins->per_size[axis]),
                 bin = fmin(fmax(whole_below(t), -static_cast<double>(kFar)), static_cast<double>(kFar));
    return {static_cast<int>(bin), static_cast<float>(t - bin)};
  }
  const Split s = split(l, x);
  return {static_cast<int>(min(max(s.bin - l.first[axis], -kFar), kFar)),
          static_cast<float>(s.rest * l.per_size)};
}

// Unit `turn` of those of a warp: its candidates, 32 at a time, to take(valid, looker, j, slot of j).
template <SlotKind Kind, class Take>
__device__ __forceinline__ void search_rows(const Task& task, const Grid& grid, const Downs& downs,
                                            Lookers<Kind>& lookers, std::uint32_t warp, std::uint32_t turn,
                                            Take take) {
  using Slot = typename SlotOf<Kind>::Type;
  const std::uint32_t lane = threadIdx.x & 31, upto_me = ~0u >> (31 - lane);
  std::uint32_t which = 0;
  for (std::uint32_t k = lane; k - lane < downs.count; k += 32)
    which += __popc(__ballot_sync(kAll, k < downs.count && downs.pair[k].first_warp <= warp));
  const Down& d = downs.pair[which - 1];
  const Level& l = grid.level[d.fine];
  const std::uint32_t at = warp - d.first_warp;
  const auto [first, part] = piece_of(d, at, turn);
  // The bins may be those of another scene (backend.cu): places and radii are held within bounds.
  const std::uint32_t members =
      first < task.spheres.count ? min(min(d.group, d.end - first), task.spheres.count - first) : 0;
  const Slot* const slots = slots_of<Kind>(task);
  const int count_x = static_cast<int>(l.count[0]);
  const std::uint32_t row_length = l.count[0] + 2, plane = row_length * (l.count[1] + 2);
  std::uint32_t rows = 0, from = 0, parts = 1;
  Slot slot;
  float4 within;
  int x_bin = 0;
  std::uint32_t key = 0, ny = 1;
  if (lane < members) {
    const Sphere s = sphere_at<Kind>(task, first + lane);
    const float reach = reach_of(grid, d, s.r);
    parts = parts_of(d, reach);
    if (part < parts) {
      if constexpr (Kind == SlotKind::fixed_point)
        slot = {fixed_point_of(l, split(l, s.x)), fixed_point_of(l, split(l, s.y)),
                fixed_point_of(l, split(l, s.z)), static_cast<float>(mul(s.r, l.units))};
      else
        slot = load_slot(slots + first + lane);
      const FloatBins* const bins = downs.bins.on ? downs.bins.level + d.fine : nullptr;
      const InBins x = in_bins(l, bins, 0, s.x), y = in_bins(l, bins, 1, s.y), z = in_bins(l, bins, 2, s.z);
      const int at_y = y.bin, at_z = z.bin;
      const float px = x.rest, py = y.rest, pz = z.rest;
      const int y0 = max(at_y + __float2int_rd(py - reach), 0),
                y1 = min(at_y + __float2int_rd(py + reach), static_cast<int>(l.count[1]) - 1),
                z0 = max(at_z + __float2int_rd(pz - reach), 0),
                z1 = min(at_z + __float2int_rd(pz + reach), static_cast<int>(l.count[2]) - 1);
      if (y0 <= y1 && z0 <= z1) {
        const auto side = static_cast<std::uint32_t>(y1 - y0 + 1);
        rows = side * static_cast<std::uint32_t>(z1 - z0 + 1);
        if (parts > 1) {
          const std::uint32_t each = (rows + parts - 1) / parts;
          from = min(part * each, rows), rows = min(each, rows - from);
        }
        within =
            make_float4(px, py - static_cast<float>(y0 - at_y), pz - static_cast<float>(z0 - at_z), reach);
        x_bin = x.bin, ny = side;
        key = static_cast<std::uint32_t>(z0 + 1) * plane + static_cast<std::uint32_t>(y0 + 1) * row_length;
      }
    }
  }
  __syncwarp();
  if (lane == 0) {
    lookers.unit = d.first_unit + at * d.turns + turn, lookers.first = first,
    lookers.left = d.turns - 1 - turn;
    lookers.more = turn + 1 < d.turns && part + d.step < parts;
  }
  const std::uint32_t some = __ballot_sync(kAll, rows != 0);
  if (!some) {
    __syncwarp();
    return;
  }
  std::uint32_t start = rows;
  if (some != 1) {
#pragma unroll
    for (int k = 1; k < 32; k <<= 1) {
      const std::uint32_t u = __shfl_up_sync(kAll, start, k);
      if (static_cast<int>(lane) >= k) start += u;
    }
  }
  const std::uint32_t items = __shfl_sync(kAll, start, 31 - __clz(some));
  start -= rows;
  if (rows) {
    const int to = __popc(some & upto_me) - 1;
    lookers.slot[to] = slot, lookers.within[to] = within;
    lookers.side[to] = ny | lane << 16;
    lookers.rows[to] = make_int4(x_bin, static_cast<int>(key), static_cast<int>(start - from),
                                 static_cast<int>(0xffffffffu / ny + 1));
  }
  __syncwarp();
  // Numbers of those who begin in the window of 32 from `w` on, as bits.
  const auto bits = [](std::uint32_t count, std::uint32_t begin, std::uint32_t w) {
    return count && begin - w < 32 ? 1u << (begin - w) : 0u;
  };
  const std::uint32_t* const table = task.spheres.table + l.offset + 1;
  std::uint32_t begun = 0;
#pragma unroll 1
  for (std::uint32_t w = 0; w < items; w += 64) {
    std::uint32_t begin[2] = {}, count[2] = {}, who[2] = {};
#pragma unroll
    for (int h = 0; h < 2; h++) {
      const std::uint32_t window = w + 32 * h, item = window + lane;
      if (window >= items) break;
      who[h] = 0;
      if (some != 1) {
        const std::uint32_t news = __reduce_or_sync(kAll, bits(rows, start, window));
        who[h] = begun + __popc(news & upto_me) - 1, begun += __popc(news);
      }
      if (item >= items) continue;
      const float4 p = lookers.within[who[h]];
      const int4 q = lookers.rows[who[h]];
      const std::uint32_t row = item - static_cast<std::uint32_t>(q.z), side = lookers.side[who[h]] & 0xffff,
                          iz = side == 1 ? row : __umulhi(row, static_cast<std::uint32_t>(q.w)),
                          iy = row - iz * side;
      const float y = static_cast<float>(static_cast<int>(iy)), z = static_cast<float>(static_cast<int>(iz)),
                  gap_y = fmaxf(fmaxf(y - p.y, p.y - (y + 1)), 0.f),
                  gap_z = fmaxf(fmaxf(z - p.z, p.z - (z + 1)), 0.f),
                  rest = fmaf(p.w, p.w, fmaf(-gap_y, gap_y, -gap_z * gap_z));
      if (rest >= 0) {
        const float half = sqrtf(rest);
        const int low = max(q.x + __float2int_rd(p.x - half), 0),
                  high = min(q.x + __float2int_rd(p.x + half), count_x - 1);
        if (low <= high) {
          const std::uint32_t* const t = table + (static_cast<std::uint32_t>(q.y) + iz * plane +
                                                  iy * row_length + static_cast<std::uint32_t>(low));
          begin[h] = __ldg(t), count[h] = __ldg(t + (high - low + 1));
        }
      }
    }
    count[0] -= begin[0], count[1] -= begin[1];
    std::uint32_t upto = count[0] + count[1];
#pragma unroll
    for (int k = 1; k < 32; k <<= 1) {
      const std::uint32_t u = __shfl_up_sync(kAll, upto, k);
      if (static_cast<int>(lane) >= k) upto += u;
    }
    const std::uint32_t total = __shfl_sync(kAll, upto, 31), start1 = upto - count[1],
                        start0 = start1 - count[0];
    if (total == 0) continue;
    const std::uint32_t has0 = __ballot_sync(kAll, count[0] != 0), has1 = __ballot_sync(kAll, count[1] != 0),
                        before = __popc(has0 & (upto_me >> 1)) + __popc(has1 & (upto_me >> 1));
    __syncwarp();
    if (count[0]) lookers.row[before] = make_uint2(begin[0] - start0, who[0]);
    if (count[1]) lookers.row[before + (count[0] != 0)] = make_uint2(begin[1] - start1, who[1]);
    __syncwarp();
    std::uint32_t seen = 0;
#pragma unroll 1
    for (std::uint32_t t = lane; t - lane < total; t += 64) {
      std::uint32_t i[2], j[2];
      Slot b[2];
#pragma unroll
      for (int h = 0; h < 2; h++) {
        const std::uint32_t window = t - lane + 32 * h;
        const std::uint32_t news =
            __reduce_or_sync(kAll, bits(count[0], start0, window) | bits(count[1], start1, window));
        const uint2 row = lookers.row[seen + __popc(news & upto_me) - 1];
        seen += __popc(news);
        i[h] = row.y, j[h] = t + 32 * h + row.x;
        b[h] = load_slot(slots + j[h]);  // behind the last: of kSlack
      }
      take(t < total, i[0], j[0], b[0]);
      if (t - lane + 32 < total) take(t + 32 < total, i[1], j[1], b[1]);
    }
  }
}

// A unit without the queue, for the few with more hits than it holds: each candidate is judged as it comes.
// With a target, writes the hits as those from `base` on of the tile.
template <SlotKind Kind>
__device__ __noinline__ std::uint32_t search_down_unqueued(const Task& task, const Grid& grid,
                                                           const Downs& downs, Lookers<Kind>& lookers,
                                                           std::uint32_t warp, std::uint32_t turn,
                                                           const Target* target, std::uint32_t base) {
  const std::uint32_t below = (1u << (threadIdx.x & 31)) - 1;
  std::uint32_t hits = 0;
  search_rows<Kind>(task, grid, downs, lookers, warp, turn,
                    [&](bool valid, std::uint32_t looker, std::uint32_t j, const auto& b) {
                      const std::uint32_t i = lookers.place(looker);
                      const bool hit =
                          valid && meets<Kind, Way::down>(task, grid, i, lookers.slot[looker], j, b, !target);
                      const std::uint32_t has = __ballot_sync(kAll, hit);
                      if (hit && target) put<Kind>(task, *target, base + hits + __popc(has & below), i, j);
                      hits += __popc(has);
                    });
  return hits;
}

// Judges those of the queue one by one, where float is not sure of all, or all are asked for more than their
// distance; contacts are moved together, in the same order.
template <SlotKind Kind>
__device__ __noinline__ std::uint32_t settle_down(const Task& task, const Grid& grid,
                                                  WarpMemory<Way::down>& memory, const Lookers<Kind>& lookers,
                                                  std::uint32_t count) {
  const auto* const slots = slots_of<Kind>(task);
  const std::uint32_t lane = threadIdx.x & 31, below = (1u << lane) - 1;
  std::uint32_t hits = 0;
#pragma unroll 1
  for (std::uint32_t from = 0; from < count; from += 32) {
    const std::uint32_t k = min(from + lane, count - 1), j = memory.at[k], looker = memory.lane[k];
    const bool hit =
        from + lane < count && meets<Kind, Way::down>(task, grid, lookers.place(looker), lookers.slot[looker],
                                                      j, load_slot(slots + j), true);
    const std::uint32_t has = __ballot_sync(kAll, hit), to = hits + __popc(has & below);
    __syncwarp();  // all have read what is written over
    if (hit) memory.at[to] = j, memory.lane[to] = static_cast<unsigned char>(looker);
    hits += __popc(has);
    __syncwarp();
  }
  return hits;
}

// Hits of unit `turn` of those of a warp, to the queue; kLate: it does not hold them.
template <SlotKind Kind>
__device__ __forceinline__ std::uint32_t search_down(const Task& task, const Grid& grid, const Downs& downs,
                                                     WarpMemory<Way::down>& memory, Lookers<Kind>& lookers,
                                                     std::uint32_t warp, std::uint32_t turn) {
  const std::uint32_t below = (1u << (threadIdx.x & 31)) - 1;
  bool doubt = task.judge_all;
  std::uint32_t hits = 0;
  search_rows<Kind>(task, grid, downs, lookers, warp, turn,
                    [&](bool valid, std::uint32_t looker, std::uint32_t j, const auto& b) {
                      bool sure;
                      const bool hit = within<Kind>(task, lookers.slot[looker], b, sure) && valid;
                      doubt = doubt || (hit && !sure);
                      const std::uint32_t has = __ballot_sync(kAll, hit), to = hits + __popc(has & below);
                      if (hit && to < kQueue<Way::down>)
                        memory.at[to] = j, memory.lane[to] = static_cast<unsigned char>(looker);
                      hits += __popc(has);
                    });
  __syncwarp();
  if (hits > kQueue<Way::down>)
    return search_down_unqueued<Kind>(task, grid, downs, lookers, warp, turn, nullptr, 0) | kLate;
  if (__any_sync(kAll, doubt)) hits = settle_down<Kind>(task, grid, memory, lookers, hits);
  return hits;
}

}  // namespace
}  // namespace padder::detect::cuda
