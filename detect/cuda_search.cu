// The search: one warp for 32 consecutive spheres of the order, one lane for each. Candidates of a row of
// bins lie side by side; their verdicts are bits of a mask, hits go to a queue of the warp, and records are
// computed and written by full warps. Places in the list are given out tile by tile (128 spheres): for any
// order by one atomic addition; for a fixed order by a block that does nothing but sum up the tiles' counts
// as they come, while each of the others searches its next tile before it asks for the place of the one
// before.
#include <algorithm>

#include "detect/cuda_search.h"

namespace padder::detect::cuda {
namespace {

constexpr int kWarps = 4, kThreads = 32 * kWarps, kQueue = 192, kStep = 2;
// Blocks an SM must be able to hold: few registers and many warps pay more than the opposite here.
constexpr int kDense = 10, kLevels = 6;
constexpr std::uint32_t kAll = ~0u;

// The filter of contact.h, in a shape that costs one operation less a candidate: the sign of d2 - kWide * s2
// collects in a mask, and the smallest magnitude tells whether any candidate is near the threshold. 2^-18
// leaves room for the band of 2^-20 and for its own rounding (2^-21); what it lets through is judged by
// verdict().
constexpr float kWide = 1 + 0x1p-18f, kNear = 0x1p-17f;

struct Task {
  Source source;
  Ordered spheres;
  Output output;
  SearchOptions options;
  Counters* counters;
  TileSums sums;
  std::uint32_t tiles = 0;
  float radius = 0, s2 = 0;  // SlotKind::equal
  bool judge_all = false;    // every hit is asked for its filter, owner or bin
};

template <SlotKind Kind>
struct SlotOf {
  using Type = FloatSlot;
};
template <>
struct SlotOf<SlotKind::fixed> {
  using Type = FixedSlot;
};

__device__ __forceinline__ FloatSlot load_slot(const FloatSlot* p) {
  const float4 v = __ldg(reinterpret_cast<const float4*>(p));
  return {v.x, v.y, v.z, v.w};
}
__device__ __forceinline__ FixedSlot load_slot(const FixedSlot* p) {
  const int4 v = __ldg(reinterpret_cast<const int4*>(p));
  return {v.x, v.y, v.z, __int_as_float(v.w)};
}
__device__ __forceinline__ float3 difference(const FloatSlot& a, const FloatSlot& b) {
  return make_float3(b.x - a.x, b.y - a.y, b.z - a.z);
}
__device__ __forceinline__ float3 difference(const FixedSlot& a, const FixedSlot& b) {
  return make_float3(static_cast<float>(wrapped_difference(a.x, b.x)),
                     static_cast<float>(wrapped_difference(a.y, b.y)),
                     static_cast<float>(wrapped_difference(a.z, b.z)));
}
template <SlotKind Kind>
__device__ __forceinline__ const typename SlotOf<Kind>::Type* slots_of(const Task& task) {
  return static_cast<const typename SlotOf<Kind>::Type*>(task.spheres.slots);
}
template <SlotKind Kind>
__device__ __forceinline__ std::uint32_t id_at(const Task& task, std::uint32_t place) {
  if constexpr (Kind == SlotKind::equal)
    return __float_as_uint(load_slot(slots_of<Kind>(task) + place).r);
  else
    return __ldg(task.spheres.ids + place);
}
template <SlotKind Kind>
__device__ __forceinline__ Sphere sphere_at(const Task& task, std::uint32_t place) {
  if constexpr (Kind == SlotKind::fixed) {
    return task.source.sphere(__ldg(task.spheres.ids + place));
  } else {
    const FloatSlot s = load_slot(slots_of<Kind>(task) + place);
    return {s.x, s.y, s.z, Kind == SlotKind::equal ? task.options.radius : double(s.r)};
  }
}

// Where a row of candidates was looked for: level and offset of its bin from the sphere's own, for hashed
// levels.
struct Where {
  int level = 0, dx = 0, dy = 0, dz = 0;
};

// What the mask let through and what must be asked more than its distance. Rare, or slow anyway: kept out of
// line.
template <SlotKind Kind, bool General>
__device__ bool contact(const Task& task, const Grid& grid, std::uint32_t place,
                        typename SlotOf<Kind>::Type slot, std::uint32_t j, Where where, bool count_doubt) {
  const auto other = load_slot(slots_of<Kind>(task) + j);
  if constexpr (General) {
    const Level& l = grid.level[where.level];
    if (l.hashed) {
      const Bin b = bin_of(l, sphere_at<Kind>(task, place));
      if (!in_row(l, sphere_at<Kind>(task, j), b.x + where.dx, b.x + where.dx, b.y + where.dy,
                  b.z + where.dz))
        return false;
    }
  }
  Measured m;
  if constexpr (Kind == SlotKind::equal) {
    const float3 d = difference(slot, other);
    m = {d.x * d.x + d.y * d.y + d.z * d.z, task.s2};
  } else {
    m = measured(slot, other);
  }
  const Verdict v = verdict<typename SlotOf<Kind>::Type>(m);
  if (v == Verdict::apart) return false;
  if (v == Verdict::doubt) {
    if (count_doubt) atomicAdd(&task.counters->doubtful, 1ull);
    if (task.options.exact ? !touching(sphere_at<Kind>(task, place), sphere_at<Kind>(task, j))
                           : !(m.d2 <= m.s2))
      return false;
  }
  const std::uint32_t ia = id_at<Kind>(task, place), ib = id_at<Kind>(task, j);
  if (task.source.filtered && !admitted(task.source.filter(ia), task.source.filter(ib))) return false;
  if (!task.options.owns_all) {
    const bool swap = ib < ia;
    const Sphere a = sphere_at<Kind>(task, swap ? j : place), b = sphere_at<Kind>(task, swap ? place : j);
    if (!owns(task.options.own, midpoint(a, b))) return false;
  }
  return true;
}
template <SlotKind Kind, bool General>
__device__ __forceinline__ std::uint32_t judged(const Task& task, const Grid& grid, std::uint32_t mask,
                                                std::uint32_t from, std::uint32_t place,
                                                typename SlotOf<Kind>::Type slot, Where where,
                                                bool count_doubt) {
  for (std::uint32_t rest = mask; rest;) {
    const int k = __clz(rest);
    const std::uint32_t bit = 0x80000000u >> k;
    rest ^= bit;
    if (!contact<Kind, General>(task, grid, place, slot, from + k, where, count_doubt)) mask ^= bit;
  }
  return mask;
}

template <SlotKind Kind>
__device__ __noinline__ void write_wide(const Task& task, std::uint32_t pi, std::uint32_t pj,
                                        std::uint64_t at) {
  const std::uint32_t ia = id_at<Kind>(task, pi), ib = id_at<Kind>(task, pj);
  const bool swap = ib < ia;
  task.output.pairs[at] = {min(ia, ib), max(ia, ib)};
  put_geometry(task.output, at, sphere_at<Kind>(task, swap ? pj : pi), sphere_at<Kind>(task, swap ? pi : pj));
}

// Float records of float input, from the slots: differences are exact or off by one rounding, the square root
// is corrected by a step of Newton's method.
template <SlotKind Kind>
__device__ __forceinline__ void write_record(const Task& task, std::uint32_t pi, std::uint32_t pj,
                                             std::uint64_t at) {
  const Output& out = task.output;
  if (Kind == SlotKind::fixed || (out.scalar == Scalar::f64 && out.width != Width::pairs)) {
    write_wide<Kind>(task, pi, pj, at);
    return;
  }
  if constexpr (Kind != SlotKind::fixed) {
    const FloatSlot a = load_slot(slots_of<Kind>(task) + pi), b = load_slot(slots_of<Kind>(task) + pj);
    const std::uint32_t ia = Kind == SlotKind::equal ? __float_as_uint(a.r) : __ldg(task.spheres.ids + pi),
                        ib = Kind == SlotKind::equal ? __float_as_uint(b.r) : __ldg(task.spheres.ids + pj);
    const bool swap = ib < ia;
    __stcs(reinterpret_cast<uint2*>(out.pairs + at), make_uint2(min(ia, ib), max(ia, ib)));
    if (out.width == Width::pairs) return;
    const float3 d = difference(a, b);
    const float d2 = d.x * d.x + d.y * d.y + d.z * d.z;
    if (d2 < 0x1p-80f) {  // squares underflow, or equal centres
      write_wide<Kind>(task, pi, pj, at);
      return;
    }
    const float ra = Kind == SlotKind::equal ? task.radius : a.r,
                rb = Kind == SlotKind::equal ? task.radius : b.r;
    const float inverse = rsqrtf(d2), s = swap ? -inverse : inverse, root = d2 * inverse;
    const float distance = fmaf(0.5f * inverse, fmaf(-root, root, d2), root);
    const float4 n = make_float4(d.x * s, d.y * s, d.z * s, ra + rb - distance);
    __stcs(static_cast<float4*>(out.normals) + at, n);
    if (out.width == Width::normals) return;
    const FloatSlot i = swap ? b : a, j = swap ? a : b;
    const float ri = swap ? rb : ra, rj = swap ? ra : rb;
    auto* p = static_cast<float2*>(out.points) + 3 * at;
    __stcs(p, make_float2(fmaf(ri, n.x, i.x), fmaf(ri, n.y, i.y)));
    __stcs(p + 1, make_float2(fmaf(ri, n.z, i.z), fmaf(-rj, n.x, j.x)));
    __stcs(p + 2, make_float2(fmaf(-rj, n.y, j.y), fmaf(-rj, n.z, j.z)));
  }
}

struct WarpMemory {
  std::uint32_t at[kQueue];    // place of j
  unsigned char lane[kQueue];  // lane of i
};

// Must stay in registers: no function that is not inlined may see `this`. Not careful: notes in `doubt` that
// a candidate came near the threshold, and the warp is searched again carefully; a few in a thousand are.
template <SlotKind Kind, bool General, bool Careful>
struct Searcher {
  using Slot = typename SlotOf<Kind>::Type;
  const Task& task;
  const Grid& grid;
  WarpMemory& memory;
  std::uint32_t lane, first, place, hits = 0;
  bool valid, write = false, doubt = false;
  std::uint64_t base = 0;
  Slot slot;
  float wide = 0, near = 0;

  __device__ __forceinline__ Searcher(const Task& t, const Grid& g, WarpMemory& m, std::uint32_t f)
      : task(t),
        grid(g),
        memory(m),
        lane(threadIdx.x & 31),
        first(f),
        place(f + lane),
        valid(place < t.spheres.count) {
    if (!valid) place = task.spheres.count - 1;
    slot = load_slot(slots_of<Kind>(task) + place);
    if constexpr (Kind == SlotKind::equal)
      wide = task.s2 * kWide + 2 * kAbsoluteBand<Slot>, near = task.s2 * kNear + 4 * kAbsoluteBand<Slot>;
    else
      near = near_of(grid.level[0], slot.r);
  }
  __device__ __forceinline__ std::uint32_t start(std::uint32_t key) const {
    return __ldg(task.spheres.table + key);
  }

  __device__ __forceinline__ float near_of(const Level& l, float r) const {
    const float most =
        r + static_cast<float>(Kind == SlotKind::fixed ? l.radius_max * l.units : l.radius_max);
    return most * most * kNear * 1.001f + 4 * kAbsoluteBand<Slot>;
  }

  __device__ __forceinline__ void search() {
    if constexpr (General)
      search_levels();
    else
      search_level();
  }

  // One level of dense bins: the rows lie at fixed distances from the sphere's own key.
  __device__ __forceinline__ void search_level() {
    const Level& l = grid.level[0];
    const std::uint32_t key = __ldg(task.spheres.keys + place), row = l.count[0] + 2,
                        plane = row * (l.count[1] + 2);
    const int m = task.spheres.merge;
    std::uint32_t begin = place + 1, end = start(((key + 1) >> m) + 1), at = key;
#pragma unroll 1
    for (int q = 0; q < 5; q++) {
      // The next row's place is asked for before this one's candidates are looked at.
      at = q == 1 ? key + plane - row : at + row;
      std::uint32_t next_begin = 0, next_end = 0;
      if (q < 4) next_begin = start((at - 1) >> m), next_end = start(((at + 1) >> m) + 1);
      search_row(begin, valid ? end : begin, slot, {});
      begin = next_begin, end = next_end;
    }
  }

  __device__ __forceinline__ void search_levels() {
    const Sphere sphere = sphere_at<Kind>(task, place);
    const int own = valid ? level_of(grid, sphere) : kMaxLevels;
    for (int level = __reduce_min_sync(kAll, own); level < grid.levels; level++) {
      const Level& l = grid.level[level];
      const bool active = own <= level, same = own == level;
      const Split sx = split(l, sphere.x), sy = split(l, sphere.y), sz = split(l, sphere.z);
      const Reach rx = reach_of(l, sx, sphere.r), ry = reach_of(l, sy, sphere.r),
                  rz = reach_of(l, sz, sphere.r);
      Slot here = slot;
      if constexpr (Kind == SlotKind::fixed)
        here = {fixed_of(l, sx), fixed_of(l, sy), fixed_of(l, sz),
                static_cast<float>(mul(sphere.r, l.units))};
      if constexpr (Kind != SlotKind::equal) near = near_of(l, here.r);
      for (int dz = -1; dz <= 1; dz++)
        for (int dy = -1; dy <= 1; dy++) {
          const bool own_row = same && dy == 0 && dz == 0;
          bool wanted = active && dz >= rz.low && dz <= rz.high && dy >= ry.low && dy <= ry.high;
          if (same && (dz < 0 || (dz == 0 && dy < 0))) wanted = false;
          if (!__any_sync(kAll, wanted)) continue;
          const std::int64_t y = sy.bin + dy, z = sz.bin + dz;
          if (!l.hashed) {
            std::int64_t x_low = sx.bin + (own_row ? 0 : rx.low), x_high = sx.bin + rx.high;
            std::uint32_t begin = 0, end = 0;
            if (wanted && cut_row(l, x_low, x_high, y, z)) {
              const std::uint32_t row = row_of(l, y, z);
              begin = own_row ? place + 1 : start(key_in_row(l, row, x_low));
              end = start(key_in_row(l, row, x_high) + 1);
            }
            search_row(begin, end, here, {level, 0, dy, dz});
          } else {
            for (int dx = -1; dx <= 1; dx++) {
              std::uint32_t begin = 0, end = 0;
              if (wanted && dx >= rx.low && dx <= rx.high && !(own_row && dx < 0)) {
                const std::uint32_t key = key_in_row(l, row_of(l, y, z), sx.bin + dx);
                begin = own_row && dx == 0 ? place + 1 : start(key), end = start(key + 1);
              }
              search_row(begin, end, here, {level, dx, dy, dz});
            }
          }
        }
    }
  }

  __device__ __forceinline__ float excess(const Slot& a, const Slot& b) const {
    const float3 d = difference(a, b);
    if constexpr (Kind == SlotKind::equal) {
      return fmaf(d.z, d.z, fmaf(d.y, d.y, fmaf(d.x, d.x, -wide)));
    } else {
      const float s = a.r + b.r;
      return fmaf(d.z, d.z, fmaf(d.y, d.y, fmaf(d.x, d.x, fmaf(-kWide * s, s, -2 * kAbsoluteBand<Slot>))));
    }
  }

  // Candidates begin to end - 1, other ones in each lane. Verdicts of 32 at a time; candidate k is bit 31 -
  // k.
  __device__ __forceinline__ void search_row(std::uint32_t begin, std::uint32_t end, const Slot& self,
                                             Where where) {
    const std::uint32_t count = end > begin ? end - begin : 0, longest = __reduce_max_sync(kAll, count);
    for (std::uint32_t done = 0; done < longest; done += 32) {
      const std::uint32_t span = (min(longest - done, 32u) + kStep - 1) & ~(kStep - 1u),
                          left = count > done ? count - done : 0;
      const Slot* candidate = slots_of<Kind>(task) + (left ? begin + done : 0);
      std::uint32_t mask = 0;
      float nearest = INFINITY;
      for (std::uint32_t k = 0; k < span; k += kStep, candidate += kStep) {
        Slot c[kStep];
#pragma unroll
        for (int u = 0; u < kStep; u++) c[u] = load_slot(candidate + u);
#pragma unroll
        for (int u = 0; u < kStep; u++) {
          const float e = excess(self, c[u]);
          mask = __funnelshift_l(__float_as_uint(e), mask, 1);
          nearest = fminf(nearest, fabsf(e));
        }
      }
      mask <<= 32 - span;
      mask &= left >= 32 ? ~0u : ~(~0u >> left);
      if constexpr (Careful) {
        if (mask && (task.judge_all || !(nearest > near)))
          mask = judged<Kind, General>(task, grid, mask, begin + done, place, self, where, !write);
      } else {
        doubt |= !(nearest > near);
      }
      push(mask, begin + done);
    }
  }

  // Hits to the queue, one of each lane at a time: the same order in every run.
  __device__ __forceinline__ void push(std::uint32_t mask, std::uint32_t from) {
    for (std::uint32_t has = __ballot_sync(kAll, mask != 0); has; has = __ballot_sync(kAll, mask != 0)) {
      if (mask) {
        const int k = __clz(mask);
        mask ^= 0x80000000u >> k;
        const std::uint32_t at = hits + __popc(has & ((1u << lane) - 1));
        if (Careful && write)
          write_record<Kind>(task, place, from + k, base + at);
        else if (at < kQueue)
          memory.at[at] = from + k, memory.lane[at] = static_cast<unsigned char>(lane);
      }
      hits += __popc(has);
    }
  }
};

// Judges every hit that asks for it. With `write`, writes the hits from `base` on instead of queueing them.
template <SlotKind Kind, bool General>
__device__ __noinline__ std::uint32_t search_carefully(const Task& task, const Grid& grid, WarpMemory& memory,
                                                       std::uint32_t first, bool write, std::uint64_t base) {
  Searcher<Kind, General, true> s(task, grid, memory, first);
  s.write = write, s.base = base;
  s.search();
  return s.hits;
}

// Sums up the counts of the tiles as they come, a thousand a step, and tells each tile its place.
__device__ void sum_tiles(const Task& task) {
  constexpr std::uint32_t kEach = 8;
  __shared__ std::uint32_t sums[kWarps], takens[kWarps];
  const std::uint32_t lane = threadIdx.x & 31, warp = threadIdx.x >> 5;
  volatile std::uint32_t* const counts = task.sums.counts;
  unsigned long long before = 0;
  for (std::uint32_t at = 0; at < task.tiles;) {
    // Thread t looks at kEach neighbouring tiles; only those before the first missing one are taken.
    std::uint32_t v[kEach], here = 0, sum = 0;
    const std::uint32_t from = at + threadIdx.x * kEach;
#pragma unroll
    for (std::uint32_t k = 0; k < kEach; k++) v[k] = from + k < task.tiles ? counts[from + k] : 0;
#pragma unroll
    for (std::uint32_t k = 0; k < kEach; k++)
      if (here == k && v[k]) here++, sum += v[k] - 1;
    const std::uint32_t full = __ballot_sync(kAll, here == kEach), stop = ~full ? __ffs(~full) - 1 : 32;
    if (lane > stop) sum = 0, here = 0;
    std::uint32_t upto = sum;
#pragma unroll
    for (int d = 1; d < 32; d <<= 1) {
      const std::uint32_t u = __shfl_up_sync(kAll, upto, d);
      if (static_cast<int>(lane) >= d) upto += u;
    }
    const std::uint32_t taken = __reduce_add_sync(kAll, here);
    if (lane == 31) sums[warp] = upto;
    if (lane == 0) takens[warp] = taken;
    __syncthreads();
    unsigned long long mine = before + upto - sum;
    bool open = true;  // no warp before stopped short
    for (std::uint32_t w = 0; w < kWarps; w++) {
      if (w == warp && !open) here = 0;
      if (!open) continue;
      if (w < warp) mine += sums[w];
      before += sums[w], at += takens[w];
      open = takens[w] == 32 * kEach;
    }
#pragma unroll
    for (std::uint32_t k = 0; k < kEach; k++)
      if (k < here) {
        *static_cast<volatile unsigned long long*>(task.sums.places + from + k) = mine + 1;
        mine += v[k] - 1;
      }
    __syncthreads();
  }
  if (threadIdx.x == 0) task.counters->contacts = before;
}

// A tile that has been searched and not written.
struct Tile {
  WarpMemory memory[kWarps];
  std::uint32_t sums[kWarps];
  unsigned long long place;
};

// Returns the tile's contacts.
template <SlotKind Kind, bool General>
__device__ __forceinline__ std::uint32_t search_tile(const Task& task, const Grid& grid, Tile& tile,
                                                     std::uint32_t number) {
  const std::uint32_t warp = threadIdx.x >> 5, first = (number * kWarps + warp) * 32;
  std::uint32_t hits = 0;
  if (first < task.spheres.count) {
    bool careful = task.judge_all;
    if (!careful) {
      Searcher<Kind, General, false> s(task, grid, tile.memory[warp], first);
      s.search();
      hits = s.hits, careful = __any_sync(kAll, s.doubt);
    }
    if (careful) hits = search_carefully<Kind, General>(task, grid, tile.memory[warp], first, false, 0);
  }
  if ((threadIdx.x & 31) == 0) tile.sums[warp] = hits;
  __syncthreads();
  std::uint32_t sum = 0;
#pragma unroll
  for (std::uint32_t k = 0; k < kWarps; k++) sum += tile.sums[k];
  return sum;
}

template <SlotKind Kind, bool General>
__device__ __forceinline__ void write_tile(const Task& task, const Grid& grid, Tile& tile,
                                           std::uint32_t number) {
  const std::uint32_t warp = threadIdx.x >> 5, lane = threadIdx.x & 31;
  std::uint32_t sum = 0, before = 0;
#pragma unroll
  for (std::uint32_t k = 0; k < kWarps; k++) sum += tile.sums[k], before += k < warp ? tile.sums[k] : 0;
  if (tile.place + sum > task.output.capacity)
    return;  // counted; the list is made longer and the search repeated
  const std::uint64_t at = tile.place + before;
  const std::uint32_t hits = tile.sums[warp], first = (number * kWarps + warp) * 32;
  if (hits > kQueue) {
    search_carefully<Kind, General>(task, grid, tile.memory[warp], first, true, at);
    return;
  }
  const WarpMemory& m = tile.memory[warp];
  for (std::uint32_t k = lane; k < hits; k += 32)
    write_record<Kind>(task, first + m.lane[k], m.at[k], at + k);
}

template <SlotKind Kind, bool General>
__global__ void __launch_bounds__(kThreads, General ? kLevels : kDense)
    search_any_kernel(const __grid_constant__ Task task, const __grid_constant__ Grid grid) {
  __shared__ Tile tile;
  if (task.counters->flags) return;  // the table is not whole; the caller orders the spheres in another way
  const std::uint32_t sum = search_tile<Kind, General>(task, grid, tile, blockIdx.x);
  if (threadIdx.x == 0)
    tile.place = sum ? atomicAdd(&task.counters->contacts, static_cast<unsigned long long>(sum)) : 0;
  __syncthreads();
  write_tile<Kind, General>(task, grid, tile, blockIdx.x);
}

// All blocks run at once (the launch sees to it), or waiting for another's tile could be for ever.
template <SlotKind Kind, bool General>
__global__ void __launch_bounds__(kThreads, General ? kLevels : kDense)
    search_fixed_kernel(const __grid_constant__ Task task, const __grid_constant__ Grid grid) {
  __shared__ Tile tiles[2];
  if (task.counters->flags) return;
  if (blockIdx.x == 0) {
    sum_tiles(task);
    return;
  }
  std::uint32_t number = blockIdx.x - 1, number_before = 0;
  bool waiting = false;
  int now = 0;
#pragma unroll 1
  for (; number < task.tiles; now ^= 1) {
    Tile &tile = tiles[now], &last = tiles[now ^ 1];
    const std::uint32_t sum = search_tile<Kind, General>(task, grid, tile, number);
    if (threadIdx.x == 0) *static_cast<volatile std::uint32_t*>(task.sums.counts + number) = sum + 1;
    if (waiting) {
      if (threadIdx.x == 0) {
        unsigned long long place;
        while ((place = *static_cast<volatile unsigned long long*>(task.sums.places + number_before)) == 0)
          __nanosleep(64);
        last.place = place - 1;
      }
      __syncthreads();
      write_tile<Kind, General>(task, grid, last, number_before);
    }
    waiting = true, number_before = number, number += gridDim.x - 1;
    __syncthreads();
  }
  if (!waiting) return;
  Tile& last = tiles[now ^ 1];
  if (threadIdx.x == 0) {
    unsigned long long place;
    while ((place = *static_cast<volatile unsigned long long*>(task.sums.places + number_before)) == 0)
      __nanosleep(64);
    last.place = place - 1;
  }
  __syncthreads();
  write_tile<Kind, General>(task, grid, last, number_before);
}

template <SlotKind Kind, bool General>
void launch(Task& task, const Grid& grid, bool fixed_order, cudaStream_t stream) {
  if (!fixed_order) {
    search_any_kernel<Kind, General><<<task.tiles, kThreads, 0, stream>>>(task, grid);
    return;
  }
  cuda_check(cudaMemsetAsync(task.sums.counts, 0, task.tiles * sizeof(*task.sums.counts), stream),
             "clear the counters");
  cuda_check(cudaMemsetAsync(task.sums.places, 0, task.tiles * sizeof(*task.sums.places), stream),
             "clear the counters");
  auto* const kernel = search_fixed_kernel<Kind, General>;
  int device = 0, processors = 0, each = 0;
  cuda_check(cudaGetDevice(&device), "ask for the device");
  cuda_check(cudaDeviceGetAttribute(&processors, cudaDevAttrMultiProcessorCount, device),
             "ask for the device's size");
  cuda_check(cudaOccupancyMaxActiveBlocksPerMultiprocessor(&each, kernel, kThreads, 0),
             "ask for the occupancy");
  const auto blocks = std::min<unsigned>(task.tiles + 1, static_cast<unsigned>(processors * each));
  void* arguments[] = {&task, const_cast<Grid*>(&grid)};
  cuda_check(cudaLaunchCooperativeKernel(kernel, dim3(blocks), dim3(kThreads), arguments, 0, stream),
             "search for contacts");
}

}  // namespace

std::uint64_t search_tiles(std::uint32_t spheres) {
  return (std::uint64_t(spheres) + kThreads - 1) / kThreads;
}

void search(const Source& source, const Grid& grid, const Ordered& spheres, const SearchOptions& options,
            const Output& output, Counters* counters, TileSums sums, cudaStream_t stream) {
  Task task{source, spheres, output, options, counters, sums};
  const bool general = grid.levels > 1 || grid.level[0].hashed;
  task.tiles = static_cast<std::uint32_t>(search_tiles(spheres.count));
  task.radius = static_cast<float>(options.radius);
  task.s2 = (task.radius + task.radius) * (task.radius + task.radius);
  task.judge_all = source.filtered || !options.owns_all;
  for (int k = 0; k < grid.levels; k++) task.judge_all = task.judge_all || grid.level[k].hashed;
  cuda_check(cudaMemsetAsync(counters, 0, offsetof(Counters, flags), stream), "clear the counters");
  const bool fixed = options.fixed_order;
  if (spheres.kind == SlotKind::equal)
    general ? launch<SlotKind::equal, true>(task, grid, fixed, stream)
            : launch<SlotKind::equal, false>(task, grid, fixed, stream);
  if (spheres.kind == SlotKind::unequal)
    general ? launch<SlotKind::unequal, true>(task, grid, fixed, stream)
            : launch<SlotKind::unequal, false>(task, grid, fixed, stream);
  if (spheres.kind == SlotKind::fixed)
    general ? launch<SlotKind::fixed, true>(task, grid, fixed, stream)
            : launch<SlotKind::fixed, false>(task, grid, fixed, stream);
  cuda_launched("search for contacts");
}

}  // namespace padder::detect::cuda
