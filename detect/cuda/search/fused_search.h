// SPDX-License-Identifier: MIT
// The fused search, second half: where a warp's candidates come from, tiles of spheres at their own level or
// units that search another level. Both offer their candidates a portion at a time, so that testing and
// writing stand in one place (fused_queue.h). Only .cu files include this.
#pragma once
#include "detect/cuda/search/fused_queue.h"
#include "detect/cuda/search/level_rows.h"
#include "detect/cuda/search/long_rows.h"

namespace padder::detect::cuda {

// As FusedQueue, the members must stay in registers.
template <bool Stable, bool Hashed, bool Given, bool Owned>
struct FusedSearch : FusedQueue<Stable, Given, Owned> {
  using Queue = FusedQueue<Stable, Given, Owned>;
  using Queue::address, Queue::below, Queue::kKind, Queue::kRoom, Queue::lane, Queue::make_room,
      Queue::memory, Queue::put, Queue::put_runs, Queue::slots, Queue::task, Queue::upto;
  const Grid& grid;
  const LevelPairs& pairs;

  __device__ __forceinline__ FusedSearch(const SearchTask& t, const Grid& g, const LevelPairs& p,
                                         FusedMemory& m)
      : Queue(t, m), grid(g), pairs(p) {}

  // What the producer still offers. Of a tile: spheres `at` to `behind` - 1, 32 at a time. Of a unit: rows,
  // 32 at a time; `row` is the lane's row of those before `at`.
  struct Row {
    std::uint32_t i, begin, end;
  };
  std::uint32_t at = 0, behind = 0;
  Row row{0, 0, 0};
  std::uint32_t start = 0,
                begun = 0;  // the number of the lane's query's first row; queries whose rows have begun
  bool alone = false;       // the unit has one query
  // Rows over the end of a ring: it is their second parts' turn; there are some.
  bool second = false, split = false;

  // Of the row of bins that is searched, where 32 spheres have too many candidates to be looked at together.
  struct LongRow {
    std::uint32_t mask = 0, base = 0, row = 0, done = 0;  // done: candidates of the row
    bool longer = true;
  };

  // Offers all candidates of a tile, or (of_unit) of a unit. Dry: goes on until none waits.
  __device__ __forceinline__ void take_all(bool of_unit, bool dry) {
    int slow = -1;  // from 0 on: row by row, after this many candidates of each row have been looked at
    LongRow long_row;
    std::uint32_t taken = 0;  // candidates of the unit so far
    for (bool last = false; !last;) {
      std::uint32_t end;
      if (of_unit) {
        const std::uint32_t waits = __reduce_add_sync(kFullWarp, row.end - row.begin);
        bool some = waits != 0;
        end = upto;
        if (taken + waits > tuning::kFusedLongUnit && task.defers)
          row.end = defer_long_row(task, row.i, row.begin, row.end, tuning::kLongRowOfUnit);
        if (some) {
          end = put_runs(row.i, row.begin, row.end);
          taken += end - upto;
          some = __any_sync(kFullWarp, row.begin != row.end);
        }
        if (!some) {
          if (Hashed && at >= behind && !second && __any_sync(kFullWarp, split))
            second = true, begun = 0, at = 0;
          last = at >= behind;
          if (!last) row = find_row(at), at += 32;  // loaded while what waits is tested
        }
      } else {
        bool longer = false, done = true;
        if (slow < 0) {
          const bool fits = take_rows(at, end, longer);
          if (!fits || longer) slow = fits ? 32 : 0, done = false, long_row = {};
          if (!fits) end = upto;
        } else if (take_long_row(at, slow, long_row, end)) {
          done = false;
        } else {
          end = upto;
        }
        if (done) slow = -1, at += 32, last = at >= behind;
      }
      put(end, dry && last);
    }
  }
  __device__ __forceinline__ void begin_spheres(std::uint32_t first, std::uint32_t end) {
    at = first, behind = end;
  }
  // The first 32 candidates of each row of 32 spheres at their own level; false where those are too many.
  // `longer`: a row has more.
  __device__ __forceinline__ bool take_rows(std::uint32_t first, std::uint32_t& end, bool& longer) {
    LevelQuery<kKind> query = level_query<kKind, Hashed>(task, grid, pairs, first);
    const std::uint32_t soon = min(first + 32 + lane, task.spheres.count - 1);
    prefetch_l1(task.spheres.codes + soon), prefetch_l1(slots() + soon);
#pragma unroll
    for (int q = 0; q < kRows; q++) prefetch_l1(task.spheres.codes + query.begin[q]);
    std::uint32_t mask[kRows], base[kRows], most = 0;
    std::uint64_t counts = 0;
#pragma unroll
    for (int q = 0; q < kRows; q++) {
      std::uint32_t longest;
      mask[q] = code_mask<kKind>(task, query.seeker, query.begin[q], query.end[q], query.valid, longest);
      base[q] = (query.begin[q] & ~3u) + 31;
      counts |= RowCounts::put(__popc(mask[q]), q);
      most = max(most, longest);
    }
    std::uint64_t all, before = sum_before(counts, all);
    std::uint32_t total = 0;
#pragma unroll
    for (int q = 0; q < kRows; q++) total += RowCounts::get(all, q);
    if (total > kRoom || query.split) return false;
    longer = most > 32;
    if (upto + total > FusedMemory::kPairs) make_room();
    // Row after row, so that neighbours in the queue read neighbours in memory.
    std::uint32_t to_row = address + 8 * upto;
#pragma unroll
    for (int q = 0; q < kRows; q++) {
      std::uint32_t to = to_row + 8 * RowCounts::get(before, q);
      to_row += 8 * RowCounts::get(all, q);
      while (mask[q]) {
        const int bit = 31 - __clz(mask[q]);
        store_shared(to, query.index, base[q] - bit);
        mask[q] ^= 1u << bit, to += 8;
      }
    }
    end = upto + total;
    return true;
  }
  // One row after the other, as much as there is room for; false behind the last row. `skipped`: candidates
  // of each row that take_rows() has taken.
  __device__ __forceinline__ bool take_long_row(std::uint32_t first, std::uint32_t skipped, LongRow& s,
                                                std::uint32_t& end) {
    while (!__any_sync(kFullWarp, s.mask != 0)) {
      if (!s.longer) s.row++, s.done = 0;
      if (s.row > kRows) return false;
      const LevelQuery<kKind> query = level_query<kKind, Hashed>(task, grid, pairs, first);
      if (s.row == kRows && !query.split) return false;
      std::uint32_t begin = 0, row_end = 0, longest;
#pragma unroll
      for (std::uint32_t q = 0; q < kRows; q++)
        if (q == s.row) begin = query.begin[q], row_end = query.end[q];
      if (s.row == kRows) begin = query.rest_begin, row_end = query.rest_end;
      if (skipped) begin = min((begin & ~3u) + skipped, row_end);
      if (task.defers) {
        if (!query.valid) row_end = begin;
        if (s.done == 0)
          row_end = defer_long_row(task, query.index, begin, row_end, tuning::kLongRow);
        else if (row_end > begin + tuning::kLongRow)
          row_end = begin;
      }
      if (s.done) begin = min((begin & ~3u) + s.done, row_end);
      s.mask = code_mask<kKind>(task, query.seeker, begin, row_end, query.valid, longest);
      s.base = (begin & ~3u) + 31, s.done += 32, s.longer = longest > 32;
    }
    const std::uint32_t count = __popc(s.mask);
    std::uint32_t total;
    const std::uint32_t before = sum_before(count, total);
    if (upto + total > FusedMemory::kPairs) make_room();
    const std::uint32_t room = FusedMemory::kPairs - upto;
    std::uint32_t to = address + 8 * (upto + before);
    for (std::uint32_t n = min(count, room - min(before, room)); n; n--, to += 8) {
      const int bit = 31 - __clz(s.mask);
      store_shared(to, min(first + lane, task.spheres.count - 1), s.base - bit);
      s.mask ^= 1u << bit;
    }
    end = upto + min(total, room);
    return true;
  }

  // Which rows a lane's sphere reaches.
  struct Query {
    std::uint32_t rows = 0, skipped = 0, side = 1, entry = 0;  // skipped: rows of the parts before
    int x_bin = 0;
    float4 within;
  };
  __device__ __forceinline__ void find_rows(const LevelPair& d, std::uint32_t index, std::uint32_t part,
                                            Query& q) {
    const Level& l = grid.level[d.at];
    const FloatBins& bins = pairs.bins.level[d.at];
    const std::uint32_t row_length = l.count[0] + 2, plane = row_length * (l.count[1] + 2);
    const FloatSlot s = load_slot(slots() + index);
    const float reach = search_radius(grid, pairs.bins, d.from, d.at, s.r);
    const std::uint32_t parts = parts_of(d, l, reach);
    if (part >= parts) return;
    int bin[3];
    float p[3];
#pragma unroll
    for (int k = 0; k < 3; k++) {
      const float x = k == 0 ? s.x : k == 1 ? s.y : s.z;
      if (Hashed && bins.size > 0) {
        const FloatSplit f = float_split(x, bins.size, bins.per_size[0]);
        bin[k] = f.bin, p[k] = __saturatef(f.rest * bins.per_size[0]);
        continue;
      }
      const double t = (static_cast<double>(x) - static_cast<double>(bins.origin[k])) *
                       static_cast<double>(bins.per_size[k]);
      bin[k] = min(max(__double2int_rd(t), -(1 << 30)), 1 << 30);
      p[k] = __saturatef(static_cast<float>(t - bin[k]));
    }
    int y0 = bin[1] + __float2int_rd(p[1] - reach), y1 = bin[1] + __float2int_rd(p[1] + reach),
        z0 = bin[2] + __float2int_rd(p[2] - reach), z1 = bin[2] + __float2int_rd(p[2] + reach);
    // Bins of a hashed level are not numbered from its first.
    const bool of_ring = Hashed && bins.size > 0;
    const int y_first = of_ring ? static_cast<int>(l.first[1]) : 0,
              z_first = of_ring ? static_cast<int>(l.first[2]) : 0;
    y0 = max(y0, y_first), y1 = min(y1, y_first + static_cast<int>(l.count[1]) - 1);
    z0 = max(z0, z_first), z1 = min(z1, z_first + static_cast<int>(l.count[2]) - 1);
    if (y0 > y1 || z0 > z1) return;
    q.side = static_cast<std::uint32_t>(y1 - y0 + 1);
    q.rows = q.side * static_cast<std::uint32_t>(z1 - z0 + 1);
    if (parts > 1) {
      const std::uint32_t each = (q.rows + parts - 1) / parts;
      q.skipped = min(part * each, q.rows), q.rows = min(each, q.rows - q.skipped);
    }
    q.within = make_float4(p[0], p[1] + static_cast<float>(bin[1] - y0) - 0.5f,
                           p[2] + static_cast<float>(bin[2] - z0) - 0.5f, reach * reach);
    q.x_bin = bin[0];
    q.entry = of_ring ? static_cast<std::uint32_t>(z0) * l.plane + static_cast<std::uint32_t>(y0) * l.row
                      : l.offset + 1 + static_cast<std::uint32_t>(z0 + 1) * plane +
                            static_cast<std::uint32_t>(y0 + 1) * row_length;
  }
  // Begins with the rows of a unit; false where it has none.
  __device__ __forceinline__ bool begin_rows(const LevelPair& d, std::uint32_t unit_of_pair) {
    const Level& l = grid.level[d.at];
    const auto [at_sphere, part] = work_of_unit(d, unit_of_pair, 0);
    const SpheresOfLevel spheres = spheres_of(task, d);
    const std::uint32_t members = spheres.left(at_sphere, d.group), first = spheres.first + at_sphere;
    Query mine;
    if (lane < members) find_rows(d, first + lane, part, mine);
    const std::uint32_t some = __ballot_sync(kFullWarp, mine.rows != 0);
    if (!some) return false;
    std::uint32_t items = mine.rows;
    start = 0;
    if (members > 1)
      start = sum_before(mine.rows, items);
    else
      items = __shfl_sync(kFullWarp, mine.rows, 0);
    __syncwarp();  // all have read what is written over
    if (mine.rows) {
      const int to = __popc(some & below());
      memory.within[to] = mine.within;
      memory.side[to] = make_uint2(mine.side, first + lane);
      memory.rows[to] = make_uint4(static_cast<std::uint32_t>(mine.x_bin), mine.entry, start - mine.skipped,
                                   0xffffffffu / mine.side + 1);
    } else {
      start = ~0u;  // begins in no window of rows
    }
    if (lane == 0) {
      const std::uint32_t row_length = l.count[0] + 2, plane = row_length * (l.count[1] + 2);
      memory.level = Hashed && l.hashed ? make_uint4(l.row, l.plane, l.offset, l.ring - 1)
                                        : make_uint4(row_length, plane, l.count[0] - 1, 0);
      if (Hashed)
        memory.ends = make_int2(static_cast<int>(l.first[0]),
                                static_cast<int>(l.first[0]) + static_cast<int>(l.count[0]) - 1);
    }
    __syncwarp();
    alone = some == 1, begun = 0, at = 0, behind = items, row = {0, 0, 0};
    second = split = false;
    return true;
  }
  // The lane's row of the 32 from number `window` of the unit on: whose it is, and its candidates.
  __device__ __forceinline__ Row find_row(std::uint32_t window) {
    Row r{0, 0, 0};
    std::uint32_t who = 0;
    if (!alone) {
      const std::uint32_t from_here = start - window,
                          news = __reduce_or_sync(kFullWarp, from_here < 32 ? 1u << from_here : 0u);
      who = begun + __popc(news & (~0u >> (31 - lane))) - 1, begun += __popc(news);
    }
    const std::uint32_t item = window + lane;
    const float4 p = memory.within[who];
    const uint4 q = memory.rows[who], of_level = memory.level;
    const uint2 side = memory.side[who];
    const std::uint32_t line = item - q.z, iz = side.x == 1 ? line : __umulhi(line, q.w),
                        iy = line - iz * side.x;
    r.i = side.y;
    const float gap_y = fmaxf(fabsf(static_cast<float>(static_cast<int>(iy)) - p.y) - 0.5f, 0.f),
                gap_z = fmaxf(fabsf(static_cast<float>(static_cast<int>(iz)) - p.z) - 0.5f, 0.f),
                rest = fmaf(-gap_y, gap_y, fmaf(-gap_z, gap_z, p.w));
    const float half = approximate_sqrt(rest);  // not a number where the row is too far away
    const int x = static_cast<int>(q.x);
    int low = x + __float2int_rd(p.x - half), high = x + __float2int_rd(p.x + half);
    if (Hashed && of_level.w) {
      const int2 ends = memory.ends;
      low = max(low, ends.x), high = min(high, ends.y);
      const std::uint32_t mask = of_level.w,
                          from = (q.y + iz * of_level.y + iy * of_level.x + static_cast<std::uint32_t>(low)) &
                                 mask,
                          upto = from + static_cast<std::uint32_t>(high - low);
      const std::uint32_t* const ring = task.spheres.table + of_level.z;
      if (!(item < behind && rest >= 0 && low <= high)) return r;
      split = split || upto > mask;
      if (second && upto <= mask) return r;
      r.begin = __ldg(ring + (second ? 0 : from));
      r.end = __ldg(ring + (second ? upto - mask : min(upto, mask) + 1));
      return r;
    }
    low = max(low, 0), high = min(high, static_cast<int>(of_level.z));
    const std::uint32_t* const t =
        task.spheres.table + (q.y + iz * of_level.y + iy * of_level.x + static_cast<std::uint32_t>(low));
    if (item < behind && rest >= 0 && low <= high) r.begin = __ldg(t), r.end = __ldg(t + (high - low + 1));
    return r;
  }
};

}  // namespace padder::detect::cuda
