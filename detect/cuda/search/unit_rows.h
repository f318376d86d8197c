// SPDX-License-Identifier: MIT
// The rows of a unit: up to 32 spheres of a level are queries; each reaches some rows of the searched level's
// bins. Rows are dealt to lanes, then their candidates are, so that lanes stay busy however short the rows
// are. Only .cu files include this.
#pragma once
#include "detect/cuda/device/warp.h"
#include "detect/cuda/output/output_slots.h"
#include "detect/cuda/search/level_pairs.h"
#include "detect/cuda/search/long_rows.h"
#include "detect/cuda/search/search_task.h"

namespace padder::detect::cuda {

// The queries of a unit that reach rows, in shared memory. Lengths are in bins of the searched level.
template <SlotKind Kind>
struct UnitQueries {
  typename SlotOf<Kind>::Type slot[32];
  float4 within[32];  // centre: x within its bin, y and z from the first row; search radius
  int4 rows[32];      // x of its bin, key of its first row, its first row's number in the unit, 2^32 / side
  std::uint32_t side[32];     // rows along y; above 16 bits the sphere's number in the unit
  uint2 span[64];             // rows with candidates: index of the first less the first's number; the query
  std::uint32_t unit, first;  // the unit's number, its first sphere
  std::uint32_t left, more;   // units that the warp has after it; whether one of them may have rows
  OutputRange range;
  __device__ __forceinline__ std::uint32_t index(std::uint32_t query) const {
    return first + (side[query] >> 16);
  }
};

// A coordinate among the searched level's bins: in which bin, counted from the first, and how far in it, in
// bins. `bins`: in float, where the order is by these. Of a hashed level the bin is that of grid.h, also
// where the order is by bins in float; along an axis that is not bounded it is counted from 0, modulo 2^32.
struct BinPosition {
  int bin;
  float rest;
};
__device__ __forceinline__ BinPosition bin_position(const Level& l, const FloatBins* bins, int axis,
                                                    double x) {
  constexpr std::int64_t kFar = std::int64_t(1) << 30;
  if (bins && !l.hashed) {
    const double t = (x - static_cast<double>(bins->origin[axis])) *
                     static_cast<double>(bins->per_size[axis]),
                 bin = fmin(fmax(whole_below(t), -static_cast<double>(kFar)), static_cast<double>(kFar));
    return {static_cast<int>(bin), static_cast<float>(t - bin)};
  }
  const Split s = split(l, x);
  if (!bounded(l, axis)) return {static_cast<int>(s.bin), static_cast<float>(s.rest * l.per_size)};
  return {static_cast<int>(min(max(s.bin - l.first[axis], -kFar), kFar)),
          static_cast<float>(s.rest * l.per_size)};
}

// The slot of sphere number `index` at a level that is not its own. `s`: sphere_of_slot().
template <SlotKind Kind>
__device__ __forceinline__ typename SlotOf<Kind>::Type slot_at(const SearchTask& task, const Level& l,
                                                               std::uint32_t index, const Sphere& s) {
  if constexpr (Kind == SlotKind::fixed_point)
    return {fixed_point_of(l, split(l, s.x)), fixed_point_of(l, split(l, s.y)),
            fixed_point_of(l, split(l, s.z)), static_cast<float>(mul(add(s.r, l.grown_by), l.units))};
  else
    return load_slot(slots_of<Kind>(task) + index);
}

// Which rows a lane's sphere reaches.
template <SlotKind Kind>
struct QueryRows {
  typename SlotOf<Kind>::Type slot;  // at the searched level
  float4 within;
  int x_bin = 0;
  std::uint32_t key = 0, side = 1, rows = 0, skipped = 0, parts = 1;  // skipped: rows of the parts before
};
template <SlotKind Kind>
__device__ __forceinline__ void find_rows(const SearchTask& task, const Grid& grid, const LevelPairs& pairs,
                                          const LevelPair& d, std::uint32_t index, std::uint32_t part,
                                          QueryRows<Kind>& q) {
  const Level& l = grid.level[d.at];
  const std::uint32_t row_length = l.count[0] + 2, plane = row_length * (l.count[1] + 2);
  const Sphere s = sphere_of_slot<Kind>(task, index);
  const float reach = search_radius(grid, pairs.bins, d.from, d.at, s.r);
  q.parts = parts_of(d, l, reach);
  if (part >= q.parts) return;
  q.slot = slot_at<Kind>(task, l, index, s);
  const FloatBins* const bins = pairs.bins.on ? pairs.bins.level + d.at : nullptr;
  const BinPosition x = bin_position(l, bins, 0, s.x), y = bin_position(l, bins, 1, s.y),
                    z = bin_position(l, bins, 2, s.z);
  int y0 = y.bin + __float2int_rd(y.rest - reach), y1 = y.bin + __float2int_rd(y.rest + reach),
      z0 = z.bin + __float2int_rd(z.rest - reach), z1 = z.bin + __float2int_rd(z.rest + reach);
  if (bounded(l, 1)) y0 = max(y0, 0), y1 = min(y1, static_cast<int>(l.count[1]) - 1);
  if (bounded(l, 2)) z0 = max(z0, 0), z1 = min(z1, static_cast<int>(l.count[2]) - 1);
  if ((bounded(l, 1) && y0 > y1) || (bounded(l, 2) && z0 > z1)) return;
  q.side = static_cast<std::uint32_t>(y1 - y0 + 1);
  q.rows = q.side * static_cast<std::uint32_t>(z1 - z0 + 1);
  if (q.parts > 1) {
    const std::uint32_t each = (q.rows + q.parts - 1) / q.parts;
    q.skipped = min(part * each, q.rows), q.rows = min(each, q.rows - q.skipped);
  }
  q.within = make_float4(x.rest, y.rest - static_cast<float>(y0 - y.bin),
                         z.rest - static_cast<float>(z0 - z.bin), reach);
  q.x_bin = x.bin;
  const auto first = [&](int axis) {
    return bounded(l, axis) ? static_cast<std::uint32_t>(l.first[axis]) : 0u;
  };
  q.key = l.hashed
              ? (static_cast<std::uint32_t>(z0) + first(2)) * l.plane +
                    (static_cast<std::uint32_t>(y0) + first(1)) * l.row + first(0)
              : static_cast<std::uint32_t>(z0 + 1) * plane + static_cast<std::uint32_t>(y0 + 1) * row_length;
}

// Of something that begins at number `begin`: its bit in the window of 32 numbers from `window` on.
__device__ __forceinline__ std::uint32_t bit_in_window(std::uint32_t count, std::uint32_t begin,
                                                       std::uint32_t window) {
  return count && begin - window < 32 ? 1u << (begin - window) : 0u;
}

// What search_rows() keeps in registers. `rows`, `start`: of the lane's own query, its rows and the number of
// the first. `queries`: the lanes that have some. `begun`: queries whose rows have begun.
struct RowWindow {
  std::uint32_t lane, upto_me, rows, start, queries, items, begun;
  bool second, split;  // rows over the end of a ring: it is their second parts' turn; there are some
};

// Row number window.lane + `first` of the unit: its candidates, and whose query it is.
template <SlotKind Kind>
__device__ __forceinline__ void find_span(const SearchTask& task, const Level& l,
                                          const UnitQueries<Kind>& queries, RowWindow& window,
                                          std::uint32_t first, std::uint32_t& begin, std::uint32_t& count,
                                          std::uint32_t& who) {
  who = 0;
  if (window.queries != 1) {
    const std::uint32_t news = __reduce_or_sync(kFullWarp, bit_in_window(window.rows, window.start, first));
    who = window.begun + __popc(news & window.upto_me) - 1, window.begun += __popc(news);
  }
  const std::uint32_t item = first + window.lane;
  if (item >= window.items) return;
  const std::uint32_t row_length = l.count[0] + 2, plane = row_length * (l.count[1] + 2);
  const float4 p = queries.within[who];
  const int4 q = queries.rows[who];
  const std::uint32_t row = item - static_cast<std::uint32_t>(q.z), side = queries.side[who] & 0xffff,
                      iz = side == 1 ? row : __umulhi(row, static_cast<std::uint32_t>(q.w)),
                      iy = row - iz * side;
  const float y = static_cast<float>(static_cast<int>(iy)), z = static_cast<float>(static_cast<int>(iz)),
              gap_y = fmaxf(fmaxf(y - p.y, p.y - (y + 1)), 0.f),
              gap_z = fmaxf(fmaxf(z - p.z, p.z - (z + 1)), 0.f),
              rest = fmaf(p.w, p.w, fmaf(-gap_y, gap_y, -gap_z * gap_z));
  if (!(rest >= 0)) return;
  const float half = sqrtf(rest);
  int low = q.x + __float2int_rd(p.x - half), high = q.x + __float2int_rd(p.x + half);
  if (bounded(l, 0)) {
    low = max(low, 0), high = min(high, static_cast<int>(l.count[0]) - 1);
    if (low > high) return;
  }
  if (l.hashed) {
    const std::uint32_t mask = l.ring - 1,
                        from = (static_cast<std::uint32_t>(q.y) + iz * l.plane + iy * l.row +
                                static_cast<std::uint32_t>(low)) &
                               mask,
                        upto = from + static_cast<std::uint32_t>(high - low);
    const std::uint32_t* const ring = task.spheres.table + l.offset;
    window.split = window.split || upto > mask;
    if (window.second && upto <= mask) return;
    begin = __ldg(ring + (window.second ? 0 : from));
    count = __ldg(ring + (window.second ? upto - mask : min(upto, mask) + 1));
    return;
  }
  const std::uint32_t* const t =
      task.spheres.table + l.offset + 1 +
      (static_cast<std::uint32_t>(q.y) + iz * plane + iy * row_length + static_cast<std::uint32_t>(low));
  begin = __ldg(t), count = __ldg(t + (high - low + 1));
}

// Deals the candidates of 64 rows, two a lane, to the lanes: take(valid, query, j, slot of j).
template <SlotKind Kind, class Take>
__device__ __forceinline__ void deal_candidates(const SearchTask& task, UnitQueries<Kind>& queries,
                                                const RowWindow& window, const std::uint32_t (&begin)[2],
                                                const std::uint32_t (&count)[2],
                                                const std::uint32_t (&who)[2], Take take) {
  using Slot = typename SlotOf<Kind>::Type;
  const Slot* const slots = slots_of<Kind>(task);
  const std::uint32_t lane = window.lane, upto_me = window.upto_me;
  std::uint32_t upto = count[0] + count[1];
#pragma unroll
  for (int k = 1; k < 32; k <<= 1) {
    const std::uint32_t u = __shfl_up_sync(kFullWarp, upto, k);
    if (static_cast<int>(lane) >= k) upto += u;
  }
  const std::uint32_t total = __shfl_sync(kFullWarp, upto, 31), start1 = upto - count[1],
                      start0 = start1 - count[0];
  if (total == 0) return;
  const std::uint32_t has0 = __ballot_sync(kFullWarp, count[0] != 0),
                      has1 = __ballot_sync(kFullWarp, count[1] != 0),
                      before = __popc(has0 & (upto_me >> 1)) + __popc(has1 & (upto_me >> 1));
  __syncwarp();
  if (count[0]) queries.span[before] = make_uint2(begin[0] - start0, who[0]);
  if (count[1]) queries.span[before + (count[0] != 0)] = make_uint2(begin[1] - start1, who[1]);
  __syncwarp();
  std::uint32_t seen = 0;
#pragma unroll 1
  for (std::uint32_t t = lane; t - lane < total; t += 64) {
    std::uint32_t i[2], j[2];
    Slot b[2];
#pragma unroll
    for (int h = 0; h < 2; h++) {
      const std::uint32_t first = t - lane + 32 * h;
      const std::uint32_t news = __reduce_or_sync(
          kFullWarp, bit_in_window(count[0], start0, first) | bit_in_window(count[1], start1, first));
      const uint2 span = queries.span[seen + __popc(news & upto_me) - 1];
      seen += __popc(news);
      i[h] = span.y, j[h] = t + 32 * h + span.x;
      b[h] = load_slot(slots + j[h]);  // behind the last candidate too: kSlack slots may be read
    }
    take(t < total, i[0], j[0], b[0]);
    if (t - lane + 32 < total) take(t + 32 < total, i[1], j[1], b[1]);
  }
}

// How many candidates are left of each of 64 rows, two a lane, without long rows. The first time these go to
// the list of long_rows.h.
template <SlotKind Kind>
__device__ __noinline__ uint2 without_long_rows(const SearchTask& task, const UnitQueries<Kind>& queries,
                                                uint2 begin, uint2 count, uint2 who, std::uint32_t at,
                                                bool first_pass) {
  constexpr std::uint32_t most = tuning::kLongRowOfUnit;
  if (!first_pass) return {count.x > most ? 0 : count.x, count.y > most ? 0 : count.y};
  return {defer_long_row(task, queries.index(who.x), begin.x, begin.x + count.x, most, at) - begin.x,
          defer_long_row(task, queries.index(who.y), begin.y, begin.y + count.y, most, at) - begin.y};
}

__device__ __forceinline__ const LevelPair& pair_of_warp(const LevelPairs& pairs, std::uint32_t warp) {
  const std::uint32_t lane = threadIdx.x & 31;
  std::uint32_t upto = 0;
  for (std::uint32_t k = lane; k - lane < pairs.count; k += 32)
    upto += __popc(__ballot_sync(kFullWarp, k < pairs.count && pairs.pair[k].first_warp <= warp));
  return pairs.pair[upto - 1];
}

// Unit number `nth` of those of a warp: its candidates, 32 at a time, to take(valid, query, j, slot of j).
// `first_pass`: of a unit that is searched several times the first puts long rows on their list.
template <SlotKind Kind, class Take>
__device__ __forceinline__ void search_rows(const SearchTask& task, const Grid& grid, const LevelPairs& pairs,
                                            UnitQueries<Kind>& queries, std::uint32_t warp, std::uint32_t nth,
                                            bool first_pass, Take take) {
  const std::uint32_t lane = threadIdx.x & 31;
  RowWindow window{lane, ~0u >> (31 - lane), 0, 0, 0, 0, 0, false, false};
  const LevelPair& d = pair_of_warp(pairs, warp);
  const Level& l = grid.level[d.at];
  const std::uint32_t at = warp - d.first_warp;
  const auto [at_sphere, part] = work_of_unit(d, at, nth);
  const SpheresOfLevel spheres = spheres_of(task, d);
  const std::uint32_t members = spheres.left(at_sphere, d.group), first = spheres.first + at_sphere;
  QueryRows<Kind> mine;
  if (lane < members) find_rows<Kind>(task, grid, pairs, d, first + lane, part, mine);
  __syncwarp();
  if (lane == 0) {
    queries.unit = d.first_unit + at * d.warp_units + nth, queries.first = first,
    queries.left = d.warp_units - 1 - nth;
    queries.more = nth + 1 < d.warp_units && part + d.step < mine.parts;
  }
  window.rows = mine.rows, window.queries = __ballot_sync(kFullWarp, mine.rows != 0);
  if (!window.queries) {
    __syncwarp();
    return;
  }
  std::uint32_t start = mine.rows;
  if (window.queries != 1) {
#pragma unroll
    for (int k = 1; k < 32; k <<= 1) {
      const std::uint32_t u = __shfl_up_sync(kFullWarp, start, k);
      if (static_cast<int>(lane) >= k) start += u;
    }
  }
  window.items = __shfl_sync(kFullWarp, start, 31 - __clz(window.queries));
  window.start = start - mine.rows;
  if (mine.rows) {
    const int to = __popc(window.queries & window.upto_me) - 1;
    queries.slot[to] = mine.slot, queries.within[to] = mine.within;
    queries.side[to] = mine.side | lane << 16;
    queries.rows[to] =
        make_int4(mine.x_bin, static_cast<int>(mine.key), static_cast<int>(window.start - mine.skipped),
                  static_cast<int>(0xffffffffu / mine.side + 1));
  }
  __syncwarp();
  std::uint32_t taken = 0;  // candidates so far
#pragma unroll 1
  for (std::uint32_t w = 0; w < window.items; w += 64) {
    std::uint32_t begin[2] = {}, count[2] = {}, who[2] = {};
#pragma unroll
    for (int h = 0; h < 2; h++) {
      if (w + 32 * h >= window.items) break;
      find_span<Kind>(task, l, queries, window, w + 32 * h, begin[h], count[h], who[h]);
    }
    count[0] -= begin[0], count[1] -= begin[1];
    if (task.defers && (taken += __reduce_add_sync(kFullWarp, count[0] + count[1])) > tuning::kLongUnit) {
      const uint2 left = without_long_rows<Kind>(task, queries, {begin[0], begin[1]}, {count[0], count[1]},
                                                 {who[0], who[1]}, d.at, first_pass);
      count[0] = left.x, count[1] = left.y;
    }
    deal_candidates<Kind>(task, queries, window, begin, count, who, take);
    if (w + 64 >= window.items && !window.second && __any_sync(kFullWarp, window.split))
      window.second = true, window.begun = 0, w = 0u - 64;
  }
}

}  // namespace padder::detect::cuda
