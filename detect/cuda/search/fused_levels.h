// SPDX-License-Identifier: MIT
// Several levels and many spheres: warps take work as long as there is any, units that look down (down.h) and
// tiles of spheres at their own level (level.h). What may touch flows through one row of pairs of the warp,
// in shared memory, whatever it comes from: candidates wait at its end until there are enough for full warps
// to judge them, contacts at its front until there are enough to write. For a list of fixed order it runs dry
// after each unit and tile, which have places of their own (expect.h, place.h). Only search.cu includes this.
#pragma once
#include "detect/cuda/output/output_slots.h"
#include "detect/cuda/search/coarse_to_fine.h"
#include "detect/cuda/search/same_level.h"

namespace padder::detect::cuda {
namespace {

// Blocks an SM must be able to hold: more would spill registers and leave too little of the first cache.
constexpr int kFlowBlocks = 9;
// From so many spheres on.
constexpr std::uint64_t kFlowSpheres = 140000;

// Pairs of a warp, and the spheres of a unit in bins of the finer level.
struct FlowMemory {
  static constexpr std::uint32_t kPairs = 256, kWrite = 64;  // kWrite: contacts that are enough to write
  uint2 pair[kPairs];
  float4 within[32];  // centre: x within its bin, y and z from the middle of the first row; reach squared
  uint4 rows[32];     // x of its bin, entry of its first row, its first item, 2^32 / rows along y
  uint2 side[32];     // rows along y, its place
  uint4 level;        // entries of a row, of a plane; the last bin along x
  // Fixed order: of the tile or unit, the places of its own. Of a unit: the word of place.h, of its group.
  unsigned long long place;
  std::uint32_t share;
};

__device__ __forceinline__ void store_pair(std::uint32_t address, std::uint32_t i, std::uint32_t j) {
  asm volatile("st.shared.v2.u32 [%0], {%1, %2};" ::"r"(address), "r"(i), "r"(j) : "memory");
}
__device__ __forceinline__ uint2 load_pair(std::uint32_t address) {
  uint2 v;
  asm volatile("ld.shared.v2.u32 {%0, %1}, [%2];" : "=r"(v.x), "=r"(v.y) : "r"(address) : "memory");
  return v;
}
// From global to shared memory, while the warp works on; await_copies: of the same lane.
template <int Bytes>
__device__ __forceinline__ void copy(void* to, const void* from) {
  asm volatile("cp.async.ca.shared.global [%0], [%1], %2;" ::"r"(
                   static_cast<std::uint32_t>(__cvta_generic_to_shared(to))),
               "l"(from), "n"(Bytes)
               : "memory");
}
__device__ __forceinline__ void await_copies() { asm volatile("cp.async.wait_all;" ::: "memory"); }
__device__ __forceinline__ float root(float v) {
  float r;
  asm("sqrt.approx.ftz.f32 %0, %1;" : "=f"(r) : "f"(v));
  return r;
}

// Must stay in registers: no function that is not inlined may be called, or what lives across the call lies
// in local memory everywhere.
template <bool Fixed>
struct Flow {
  static constexpr SlotKind kKind = SlotKind::unequal;
  static constexpr std::uint32_t kAtOnce = 2, kStep = 32 * kAtOnce;
  const Task& task;
  const Grid& grid;
  const Downs& downs;
  FlowMemory& memory;
  std::uint32_t lane, address;                 // of the pairs
  std::uint32_t hits = 0, from = 0, upto = 0;  // candidates: `from` to `upto` - 1
  // Fixed order: the number of the tile or unit among both, and its contacts so far.
  std::uint32_t tile = 0, told = 0;

  __device__ __forceinline__ Flow(const Task& t, const Grid& g, const Downs& d, FlowMemory& m)
      : task(t),
        grid(g),
        downs(d),
        memory(m),
        lane(held(threadIdx.x & 31)),
        address(held(shared_address(m.pair))) {}
  // By a shuffle: then it is not found again each time.
  static __device__ __forceinline__ std::uint32_t held(std::uint32_t v) {
    return __shfl_sync(kAll, v, threadIdx.x);
  }

  __device__ __forceinline__ std::uint32_t below() const { return (1u << lane) - 1; }
  __device__ __forceinline__ const FloatSlot* slots() const { return slots_of<kKind>(task); }

  static __device__ __forceinline__ void prefetch(const void* p) {
    asm volatile("prefetch.global.L1 [%0];" ::"l"(p));
  }

  // Judges the next candidates: kStep of them, or what there is.
  __device__ __forceinline__ void judge() {
    uint2 pair[kAtOnce];
    FloatSlot a[kAtOnce], b[kAtOnce];
    bool hit[kAtOnce], doubt = false;
#pragma unroll
    for (int u = 0; u < kAtOnce; u++) {
      const std::uint32_t at = from + 32 * u + lane;
      hit[u] = at < upto;
      pair[u] = load_pair(address + 8 * min(at, upto - 1));
    }
#pragma unroll
    for (int u = 0; u < kAtOnce; u++)
      a[u] = load_slot(slots() + pair[u].x), b[u] = load_slot(slots() + pair[u].y);
#pragma unroll
    for (int u = 0; u < kAtOnce; u++) {
      bool sure;
      hit[u] = within<kKind>(task, a[u], b[u], sure) && hit[u];
      doubt = doubt || (hit[u] && !sure);
    }
    if (__any_sync(kAll, doubt)) {
#pragma unroll
      for (int u = 0; u < kAtOnce; u++) hit[u] = hit[u] && meets_closely(a[u], b[u]);
    }
#pragma unroll
    for (int u = 0; u < kAtOnce; u++) {
      const std::uint32_t has = __ballot_sync(kAll, hit[u]);
      if (u == 0) __syncwarp();  // all have read what is written over
      if (hit[u]) store_pair(address + 8 * (hits + __popc(has & below())), pair[u].x, pair[u].y);
      hits += __popc(has);
    }
    from += kStep;
    __syncwarp();
  }

  // What float is not sure of; nothing but distance counts here.
  __device__ __forceinline__ bool meets_closely(const FloatSlot& a, const FloatSlot& b) const {
    const Measured m = measured(a, b);
    const Verdict v = verdict<FloatSlot>(m);
    if (v != Verdict::doubt) return v != Verdict::apart;
    note_doubt(task);
    return task.options.exact ? touching({a.x, a.y, a.z, a.r}, {b.x, b.y, b.z, b.r}) : m.d2 <= m.s2;
  }

  // Contacts to the list; of a fixed order those beyond the tile's places to the spill.
  __device__ __forceinline__ void write() {
    if constexpr (Fixed) {
      // Asked for when the unit began and not looked at before something is written.
      await_copies();
      __syncwarp();
      const std::uint32_t share = memory.share, limit = share & most(),
                          here = told < limit ? min(hits, limit - told) : 0;
      write_records(memory.place + ((share & ~most()) >> kShareBits) + told, here);
      if (here < hits) {
        Word begin = 0;
        if (lane == 0) begin = atomicAdd(&task.counters->spilled, 2 * static_cast<Word>(hits - here));
        begin = __shfl_sync(kAll, begin, 0);
#pragma unroll 1
        for (std::uint32_t k = here + lane; k < hits; k += 32) {
          const uint2 pair = load_pair(address + 8 * k);
          const Word to = begin + 2 * (k - here);
          if (to + 1 < task.sums.room)
            reinterpret_cast<uint4*>(task.sums.spill)[to / 2] =
                make_uint4(pair.x, pair.y, tile, told + k - limit);
        }
      }
      told += hits;
    } else {
      Word place = 0;
      if (lane == 0) place = atomicAdd(&task.counters->contacts, static_cast<Word>(hits));
      write_records(place, hits);
    }
    hits = 0;
    __syncwarp();
  }
  // One body for all widths: what instructions there are must fit the cache that they come from.
  __device__ __forceinline__ void write_records(Word at, std::uint32_t count) {
    constexpr int kRecords = 2;
#pragma unroll 1
    for (std::uint32_t k = 0; k < count; k += 32 * kRecords) {
      uint2 pair[kRecords];
      Both both[kRecords];
#pragma unroll
      for (int u = 0; u < kRecords; u++) {
        pair[u] = load_pair(address + 8 * min(k + 32 * u + lane, count - 1));
        both[u] = load_both<kKind>(task, pair[u].x, pair[u].y);
      }
      if (k == 0) {  // the place comes while records are asked for
        if (!Fixed) at = __shfl_sync(kAll, at, 0);
        if (at + count > task.output.capacity) break;  // counted; the search is repeated
      }
#pragma unroll
      for (int u = 0; u < kRecords; u++)
        if (k + 32 * u + lane < count)
          write_both<kKind>(task, both[u], pair[u].x, pair[u].y, at + (k + 32 * u + lane));
    }
  }

  // Fixed order. The bits of the share that say how many places; the others say where.
  __device__ __forceinline__ std::uint32_t most() const { return tile < task.own_tiles ? ~0u : kMostShare; }
  __device__ __forceinline__ void begin_tile(std::uint32_t number) {
    tile = number, told = 0;
    const PlacesOfTile places = places_of_tile(task, number);
    if (lane == 0) memory.place = places.first, memory.share = places.count;
  }
  __device__ __forceinline__ void begin_unit(std::uint32_t number) {
    tile = task.own_tiles + number, told = 0;
    await_before();
    if (lane == 0) {
      copy<8>(&memory.place, task.sums.bases + number / kShareUnits);
      copy<4>(&memory.share, task.sums.shares + number);
    }
  }
  // It ends: nothing of it waits any more.
  __device__ __forceinline__ void end() {
    if (lane == 0) {
      await_copies();
      note_net(task, tile, static_cast<std::int32_t>(told - (memory.share & most())));
    }
  }

  // Judges and writes while there is enough for full warps; `all`: until nothing waits.
  __device__ __forceinline__ void drain(bool all) {
    const std::uint32_t judged = all ? 1 : kStep, written = all ? 1 : FlowMemory::kWrite;
#pragma unroll 1
    while (from < upto && upto - from >= judged) judge();
    if (all) from = upto = 0;
    if (hits >= written) write();
  }
  // Candidates have been put at the end, up to `end`.
  __device__ __forceinline__ void put(std::uint32_t end, bool all) {
    upto = end;
    __syncwarp();
    drain(all);
  }
  // Moves what waits together; then there is room for kRoom.
  static constexpr std::uint32_t kRoom = FlowMemory::kPairs - FlowMemory::kWrite - kStep;
  __device__ __forceinline__ void make_room() {
    const std::uint32_t left = upto - from;  // less than kStep
    uint2 pair[kAtOnce];
#pragma unroll
    for (int u = 0; u < kAtOnce; u++)
      if (32 * u + lane < left) pair[u] = load_pair(address + 8 * (from + 32 * u + lane));
    __syncwarp();
#pragma unroll
    for (int u = 0; u < kAtOnce; u++)
      if (32 * u + lane < left) store_pair(address + 8 * (hits + 32 * u + lane), pair[u].x, pair[u].y);
    from = hits, upto = hits + left;
  }
  __device__ __forceinline__ void finish() { drain(true); }
  __device__ __forceinline__ bool waits() const { return from < upto || hits > 0; }

  // Some consecutive candidates of each lane to the end of the row, for sphere i, as many as there is room
  // for; leaves the others. Returns the new end.
  __device__ __forceinline__ std::uint32_t put_runs(std::uint32_t i, std::uint32_t& begin,
                                                    std::uint32_t end) {
    const std::uint32_t count = min(end - begin, FlowMemory::kPairs);
    std::uint32_t total;
    const std::uint32_t start = sum_before(count, total);
    if (upto + total > FlowMemory::kPairs) make_room();
    const std::uint32_t room = FlowMemory::kPairs - upto, n = min(count, room - min(start, room));
    std::uint32_t to = address + 8 * (upto + start);
#pragma unroll 1
    for (std::uint32_t k = 0; __any_sync(kAll, k < n); k += 4, to += 32)
#pragma unroll
      for (std::uint32_t u = 0; u < 4; u++)
        if (k + u < n) store_pair(to + 8 * u, i, begin + k + u);
    begin += n;
    return upto + min(total, room);
  }

  // What a tile or unit still has to offer, a piece at a time, so that candidates are judged and contacts
  // written at one place: what instructions there are must fit the cache that they come from. Of a tile:
  // spheres `at` to `behind` - 1, 32 a piece. Of a unit: rows, 32 a piece; `row` is the lane's, of those
  // before `at`.
  struct Row {
    std::uint32_t i, begin, end;
  };
  std::uint32_t at = 0, behind = 0;
  Row row{0, 0, 0};
  std::uint32_t start = 0, begun = 0;  // of the lane's sphere, its first row; spheres whose rows have begun
  bool alone = false;                  // one sphere

  // Where rows have too many candidates for one look: of the row that is looked at.
  struct Slowly {
    std::uint32_t mask = 0, base = 0, row = 0, done = 0;  // done: candidates of the row
    bool longer = true;
  };

  // Dry: until nothing waits.
  __device__ __forceinline__ void take_all(bool down, bool finest, bool dry) {
    int slow = -1;  // unless below zero: so many candidates of each row have been looked at, then row by row
    Slowly slowly;
    for (bool last = false; !last;) {
      std::uint32_t end;
      if (down) {
        end = put_runs(row.i, row.begin, row.end);
        if (!__any_sync(kAll, row.begin != row.end)) {
          last = at >= behind;
          if (!last) row = find(at), at += 32;  // asked for while what waits is judged
        }
      } else {
        bool longer = false, done = true;
        if (slow < 0) {
          const bool few = look_at_rows(at, finest, end, longer);
          if (!few || longer) slow = few ? 32 : 0, done = false, slowly = {};
          if (!few) end = upto;
        } else if (look_at_row(at, finest, slow, slowly, end)) {
          done = false;
        } else {
          end = upto;
        }
        if (done) slow = -1, at += 32, last = at >= behind;
      }
      put(end, dry && last);
    }
  }
  __device__ __forceinline__ void begin_around(std::uint32_t first, std::uint32_t end) {
    at = first, behind = end;
  }
  // 32 spheres at their own level, the first 32 candidates of each row; false where those are too many.
  // Longer: a row has more.
  __device__ __forceinline__ bool look_at_rows(std::uint32_t first, bool finest, std::uint32_t& end,
                                               bool& longer) {
    Own<kKind> own = own_of<kKind>(task, grid, downs, first, finest);
    const std::uint32_t soon = min(first + 32 + lane, task.spheres.count - 1);
    prefetch(task.spheres.codes + soon), prefetch(slots() + soon);
#pragma unroll
    for (int q = 0; q < 5; q++) prefetch(task.spheres.codes + own.begin[q]);
    std::uint32_t mask[5], base[5], most = 0;
    // Counts of five rows side by side, no more than 32 * 32 each in the warp.
    constexpr int kBits = 12;
    const auto of_row = [](std::uint64_t counts, int q) {
      return static_cast<std::uint32_t>(counts >> kBits * q) & ((1u << kBits) - 1);
    };
    std::uint64_t counts = 0;
#pragma unroll
    for (int q = 0; q < 5; q++) {
      std::uint32_t longest;
      mask[q] = look<kKind>(task, own.seeker, own.begin[q], own.end[q], own.live, longest);
      base[q] = (own.begin[q] & ~3u) + 31;
      counts |= static_cast<std::uint64_t>(__popc(mask[q])) << kBits * q;
      most = max(most, longest);
    }
    std::uint64_t all, before = sum_before(counts, all);
    std::uint32_t total = 0;
#pragma unroll
    for (int q = 0; q < 5; q++) total += of_row(all, q);
    if (total > kRoom) return false;
    longer = most > 32;
    if (upto + total > FlowMemory::kPairs) make_room();
    // Row after row, so that neighbours ask for neighbours in memory.
    std::uint32_t row = address + 8 * upto;
#pragma unroll
    for (int q = 0; q < 5; q++) {
      std::uint32_t to = row + 8 * of_row(before, q);
      row += 8 * of_row(all, q);
      while (mask[q]) {
        const int bit = 31 - __clz(mask[q]);
        store_pair(to, own.place, base[q] - bit);
        mask[q] ^= 1u << bit, to += 8;
      }
    }
    end = upto + total;
    return true;
  }
  // Row after row, in pieces that there is room for; false behind the last.
  __device__ __forceinline__ bool look_at_row(std::uint32_t first, bool finest, std::uint32_t skipped,
                                              Slowly& s, std::uint32_t& end) {
    while (!__any_sync(kAll, s.mask != 0)) {
      if (!s.longer) s.row++, s.done = 0;
      if (s.row == 5) return false;
      const Own<kKind> own = own_of<kKind>(task, grid, downs, first, finest);
      std::uint32_t begin = 0, behind = 0, longest;
#pragma unroll
      for (std::uint32_t q = 0; q < 5; q++)
        if (q == s.row) begin = own.begin[q], behind = own.end[q];
      if (skipped + s.done) begin = min((begin & ~3u) + skipped + s.done, behind);
      s.mask = look<kKind>(task, own.seeker, begin, behind, own.live, longest);
      s.base = (begin & ~3u) + 31, s.done += 32, s.longer = longest > 32;
    }
    const std::uint32_t count = __popc(s.mask);
    std::uint32_t total;
    const std::uint32_t start = sum_before(count, total);
    if (upto + total > FlowMemory::kPairs) make_room();
    const std::uint32_t room = FlowMemory::kPairs - upto;
    std::uint32_t to = address + 8 * (upto + start);
    for (std::uint32_t n = min(count, room - min(start, room)); n; n--, to += 8) {
      const int bit = 31 - __clz(s.mask);
      store_pair(to, min(first + lane, task.spheres.count - 1), s.base - bit);
      s.mask ^= 1u << bit;
    }
    end = upto + min(total, room);
    return true;
  }

  // A piece of a unit begins; false where it has no rows.
  __device__ __forceinline__ bool begin_down(const Down& d, std::uint32_t unit_of_pair, std::uint32_t piece) {
    const Level& l = grid.level[d.fine];
    const FloatBins& bins = downs.bins.level[d.fine];
    const auto [first, part] = piece_of(d, unit_of_pair, piece);
    // The bins may be those of another scene (backend.cu): places and radii are held within bounds.
    const std::uint32_t behind_last = min(d.end, task.spheres.count),
                        members = first < behind_last ? min(d.group, behind_last - first) : 0;
    const std::uint32_t row_length = l.count[0] + 2, plane = row_length * (l.count[1] + 2);
    std::uint32_t rows = 0, skipped = 0, ny = 1, key = 0;
    float4 within;
    int x_bin = 0;
    if (lane < members) {
      const FloatSlot s = load_slot(slots() + first + lane);
      const float reach = reach_of(grid, d, s.r);
      const std::uint32_t parts = parts_of(d, reach);
      if (part < parts) {
        int bin[3];
        float p[3];
#pragma unroll
        for (int k = 0; k < 3; k++) {
          const double t = (static_cast<double>(k == 0   ? s.x
                                                : k == 1 ? s.y
                                                         : s.z) -
                            static_cast<double>(bins.origin[k])) *
                           static_cast<double>(bins.per_size[k]);
          bin[k] = min(max(__double2int_rd(t), -(1 << 30)), 1 << 30);
          p[k] = __saturatef(static_cast<float>(t - bin[k]));
        }
        const int y0 = max(bin[1] + __float2int_rd(p[1] - reach), 0),
                  y1 = min(bin[1] + __float2int_rd(p[1] + reach), static_cast<int>(l.count[1]) - 1),
                  z0 = max(bin[2] + __float2int_rd(p[2] - reach), 0),
                  z1 = min(bin[2] + __float2int_rd(p[2] + reach), static_cast<int>(l.count[2]) - 1);
        if (y0 <= y1 && z0 <= z1) {
          ny = static_cast<std::uint32_t>(y1 - y0 + 1);
          rows = ny * static_cast<std::uint32_t>(z1 - z0 + 1);
          if (parts > 1) {
            const std::uint32_t each = (rows + parts - 1) / parts;
            skipped = min(part * each, rows), rows = min(each, rows - skipped);
          }
          within = make_float4(p[0], p[1] + static_cast<float>(bin[1] - y0) - 0.5f,
                               p[2] + static_cast<float>(bin[2] - z0) - 0.5f, reach * reach);
          x_bin = bin[0];
          key = l.offset + 1 + static_cast<std::uint32_t>(z0 + 1) * plane +
                static_cast<std::uint32_t>(y0 + 1) * row_length;
        }
      }
    }
    const std::uint32_t some = __ballot_sync(kAll, rows != 0);
    if (!some) return false;
    std::uint32_t items = rows;
    start = 0;
    if (members > 1)
      start = sum_before(rows, items);
    else
      items = __shfl_sync(kAll, rows, 0);
    __syncwarp();  // all have read what is written over
    if (rows) {
      const int to = __popc(some & below());
      memory.within[to] = within;
      memory.side[to] = make_uint2(ny, first + lane);
      memory.rows[to] =
          make_uint4(static_cast<std::uint32_t>(x_bin), key, start - skipped, 0xffffffffu / ny + 1);
    } else {
      start = ~0u;  // begins in no window
    }
    if (lane == 0) memory.level = make_uint4(row_length, plane, l.count[0] - 1, 0);
    __syncwarp();
    alone = some == 1, begun = 0, at = 0, behind = items, row = {0, 0, 0};
    return true;
  }
  // Row `item` of the unit, one a lane: whose, and its candidates.
  __device__ __forceinline__ Row find(std::uint32_t window) {
    Row r{0, 0, 0};
    std::uint32_t who = 0;
    if (!alone) {
      const std::uint32_t from_here = start - window,
                          news = __reduce_or_sync(kAll, from_here < 32 ? 1u << from_here : 0u);
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
    const float half = root(rest);  // no number where the row is too far
    const int x = static_cast<int>(q.x), low = max(x + __float2int_rd(p.x - half), 0),
              high = min(x + __float2int_rd(p.x + half), static_cast<int>(of_level.z));
    const std::uint32_t* const t =
        task.spheres.table + (q.y + iz * of_level.y + iy * of_level.x + static_cast<std::uint32_t>(low));
    if (item < behind && rest >= 0 && low <= high) r.begin = __ldg(t), r.end = __ldg(t + (high - low + 1));
    return r;
  }
};

// The order in which work is taken: tiles of the coarser levels, whose rows may be long, then of each pair of
// levels and of the tiles of the finest one part in 2^bits after the other, so that what is near in space, as
// the orders of all levels are much alike, is done at one time. For a list of fixed order of fewer spheres
// all tiles, since units must wait for their shares, then pairs from those of the largest spheres to those of
// the smallest, whose units take least, in few parts: what is begun last should not take long.
struct Work {
  std::uint32_t items, first, tiles;  // first: tiles to begin with
  std::uint32_t count[Downs::kMost + 1];
};
__device__ __forceinline__ std::uint32_t part_bits(const Task& task, bool tiles_first) {
  const bool whole = task.spheres.count >= 600000 && task.spheres.count < 1500000;  // as measured
  return !tiles_first ? 8 : whole ? 0 : 2;
}
struct Item {
  std::uint32_t pair, unit;  // pair: downs.count: a tile
};
__device__ __forceinline__ Item item_of(const Work& work, std::uint32_t pairs, std::uint32_t number,
                                        std::uint32_t lane, std::uint32_t bits) {
  if (number < work.first) return {pairs, work.tiles - 1 - number};
  number -= work.first;
  const auto begin = [&](std::uint32_t count, std::uint32_t round) {
    return static_cast<std::uint32_t>(static_cast<std::uint64_t>(count) * round >> bits);
  };
  auto round = static_cast<std::uint32_t>(static_cast<float>(number) * static_cast<float>(1 << bits) /
                                          static_cast<float>(work.items - work.first) * 0.99999f);
  std::uint32_t before = 0;
  for (bool more = true; more; round += more) {
    std::uint32_t next = 0;
    before = 0;
    for (std::uint32_t p = lane; p <= pairs; p += 32)
      before += begin(work.count[p], round), next += begin(work.count[p], round + 1);
    before = __reduce_add_sync(kAll, before), next = __reduce_add_sync(kAll, next);
    more = next <= number;
  }
  std::uint32_t left = number - before;
  for (std::uint32_t p0 = 0;; p0 += 32) {
    const std::uint32_t n = p0 + lane <= pairs ? work.count[p0 + lane] : 0, first = begin(n, round),
                        here = begin(n, round + 1) - first;
    std::uint32_t all, start = sum_before(here, all);
    if (left < all) {
      const std::uint32_t who = 31 - __clz(__ballot_sync(kAll, left - start < here));
      return {p0 + who, __shfl_sync(kAll, first + left - start, who)};
    }
    left -= all;
  }
}

template <bool Fixed>
__global__ void __launch_bounds__(kThreads, kFlowBlocks)
    flow_kernel(const __grid_constant__ Task task, const __grid_constant__ Grid grid,
                const __grid_constant__ Downs downs) {
  __shared__ FlowMemory memory[kWarps];
  __shared__ Work work;
  constexpr std::uint32_t kTile = kFlowTile;
  if (Fixed) begin_next();  // which waits for the end of this
  // The table is not whole: the caller orders the spheres in another way.
  if (task.counters->flags) return;
  const bool tiles_first = Fixed && task.spheres.count < kManyPieces;  // and pairs backwards
  for (std::uint32_t p = threadIdx.x; p <= downs.count; p += kThreads) {
    const std::uint32_t tiles = (task.spheres.count + kTile - 1) / kTile,
                        finest = static_cast<std::uint32_t>(
                            min(grid.level[0].spheres / kTile, static_cast<std::uint64_t>(tiles)));
    const std::uint32_t first = tiles_first ? tiles : tiles - finest,
                        at = tiles_first && p < downs.count ? downs.count - 1 - p : p;
    if (p == downs.count) work.tiles = tiles, work.first = first, work.items = downs.warps + tiles;
    work.count[at] = p == downs.count       ? tiles - first
                     : p + 1 == downs.count ? downs.warps - downs.pair[p].first_warp
                                            : downs.pair[p + 1].first_warp - downs.pair[p].first_warp;
  }
  __syncthreads();
  const std::uint32_t warp = __shfl_sync(kAll, threadIdx.x >> 5, 0), items = work.items;
  Flow<Fixed> flow(task, grid, downs, memory[warp]);
  std::uint32_t number = blockIdx.x * kWarps + warp;
#pragma unroll 1
  while (number < items) {
    // Asked for long before it is needed.
    std::uint32_t next = 0;
    if (flow.lane == 0) next = atomicAdd(task.next, 1u);
    Item item = item_of(work, downs.count, number, flow.lane, part_bits(task, tiles_first));
    if (tiles_first && item.pair < downs.count) item.pair = downs.count - 1 - item.pair;
    const bool down = item.pair < downs.count;
    const Down& d = downs.pair[down ? item.pair : 0];
    if constexpr (Fixed) {
      if (down)
        flow.begin_unit(d.first_unit + item.unit);
      else
        flow.begin_tile(item.unit);
    }
    const bool finest = !Fixed && item.unit < work.tiles - work.first;  // Fixed: more would spill
    if (!down) flow.begin_around(item.unit * kTile, min(item.unit * kTile + kTile, task.spheres.count));
    std::uint32_t piece = 0;
    for (bool last = false; !last;) {
      const bool some = !down || flow.begin_down(d, item.unit, piece++);
      // Of a sphere's pieces those behind an empty one are empty.
      last = !Fixed || !down || piece >= d.pieces || (!some && d.parts > 1);
      if (some || (Fixed && last && flow.waits())) flow.take_all(down, finest, Fixed && last);
    }
    if (Fixed) flow.end();
    // The last to find nothing leaves the counter as it was.
    if (flow.lane == 0 && next + 1 == items) *task.next = 0;
    number = __shfl_sync(kAll, next, 0) + gridDim.x * kWarps;
  }
  if (!Fixed) flow.finish();
}

}  // namespace
}  // namespace padder::detect::cuda
