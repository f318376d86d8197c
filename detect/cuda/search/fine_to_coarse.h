// SPDX-License-Identifier: MIT
// The search of a warp where levels are hashed, or differ too much to look down: each sphere looks at its own
// level and up at the coarser ones. Candidates of a row of bins lie side by side; their verdicts are bits of
// a mask, and hits go to a queue of the warp. Only search.cu includes this.
#pragma once
#include "detect/cuda/search/exact_test.h"

namespace padder::detect::cuda {
namespace {

// Must stay in registers: no function that is not inlined may see `this`. Not careful: notes in `doubt` that
// a candidate came near the threshold, and the warp is searched again carefully; a few in a thousand are.
template <SlotKind Kind, bool Careful>
struct Searcher {
  using Slot = typename SlotOf<Kind>::Type;
  static constexpr std::uint32_t kAtOnce = 2;  // candidates that a lane asks for
  const Task& task;
  const Grid& grid;
  WarpMemory<Way::up>& memory;
  std::uint32_t lane, first, place, hits = 0;
  bool valid, doubt = false;
  const Target* target = nullptr;  // where hits are written instead of being queued
  std::uint32_t base = 0;
  Slot slot;
  float wide = 0, near = 0;

  __device__ __forceinline__ Searcher(const Task& t, const Grid& g, WarpMemory<Way::up>& m, std::uint32_t f)
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
  }
  __device__ __forceinline__ std::uint32_t start(std::uint32_t key) const {
    return __ldg(task.spheres.table + key);
  }

  __device__ __forceinline__ float near_of(const Level& l, float r) const {
    const float most =
        r + static_cast<float>(Kind == SlotKind::fixed_point ? l.radius_max * l.units : l.radius_max);
    return most * most * kNear * 1.001f + 4 * kAbsoluteBand<Slot>;
  }

  __device__ __forceinline__ void search() {
    const Sphere sphere = sphere_at<Kind>(task, place);
    const int own = valid ? level_of(grid, sphere) : kMaxLevels;
    for (int level = __reduce_min_sync(kAll, own); level < grid.levels; level++) {
      const Level& l = grid.level[level];
      const bool active = own <= level, same = own == level;
      const Split sx = split(l, sphere.x), sy = split(l, sphere.y), sz = split(l, sphere.z);
      const Reach rx = reach_of(l, sx, sphere.r), ry = reach_of(l, sy, sphere.r),
                  rz = reach_of(l, sz, sphere.r);
      Slot here = slot;
      if constexpr (Kind == SlotKind::fixed_point)
        here = {fixed_point_of(l, sx), fixed_point_of(l, sy), fixed_point_of(l, sz),
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
      const std::uint32_t span = (min(longest - done, 32u) + kAtOnce - 1) & ~(kAtOnce - 1),
                          left = count > done ? count - done : 0;
      const Slot* candidate = slots_of<Kind>(task) + (left ? begin + done : 0);
      std::uint32_t mask = 0;
      float nearest = INFINITY;
      for (std::uint32_t k = 0; k < span; k += kAtOnce, candidate += kAtOnce) {
        Slot c[kAtOnce];
#pragma unroll
        for (std::uint32_t u = 0; u < kAtOnce; u++) c[u] = load_slot(candidate + u);
#pragma unroll
        for (std::uint32_t u = 0; u < kAtOnce; u++) {
          const float e = excess(self, c[u]);
          mask = __funnelshift_l(__float_as_uint(e), mask, 1);
          nearest = fminf(nearest, fabsf(e));
        }
      }
      mask <<= 32 - span;
      mask &= left >= 32 ? ~0u : ~(~0u >> left);
      if constexpr (Careful) {
        if (mask && (task.judge_all || !(nearest > near))) mask = judged(mask, begin + done, self, where);
      } else {
        doubt |= !(nearest > near);
      }
      push(mask, begin + done);
    }
  }

  __device__ __forceinline__ std::uint32_t judged(std::uint32_t mask, std::uint32_t from, const Slot& self,
                                                  Where where) const {
    for (std::uint32_t rest = mask; rest;) {
      const int k = __clz(rest);
      const std::uint32_t bit = 0x80000000u >> k;
      rest ^= bit;
      if (!contact<Kind, Way::up>(task, grid, place, self, from + k, where, !target)) mask ^= bit;
    }
    return mask;
  }

  // Hits to the queue, one of each lane at a time: the same order in every run.
  __device__ __forceinline__ void push(std::uint32_t mask, std::uint32_t from) {
    for (std::uint32_t has = __ballot_sync(kAll, mask != 0); has; has = __ballot_sync(kAll, mask != 0)) {
      if (mask) {
        const int k = __clz(mask);
        mask ^= 0x80000000u >> k;
        const std::uint32_t at = hits + __popc(has & ((1u << lane) - 1));
        if (Careful && target)
          put<Kind>(task, *target, base + at, place, from + k);
        else if (at < kQueue<Way::up>)
          memory.at[at] = from + k, memory.lane[at] = static_cast<unsigned char>(lane);
      }
      hits += __popc(has);
    }
  }
};

// Judges every hit that asks for it. With a target, writes the hits as those from `base` on of the tile.
template <SlotKind Kind>
__device__ __noinline__ std::uint32_t search_carefully(const Task& task, const Grid& grid,
                                                       WarpMemory<Way::up>& memory, std::uint32_t first,
                                                       const Target* target, std::uint32_t base) {
  Searcher<Kind, true> s(task, grid, memory, first);
  s.target = target, s.base = base;
  s.search();
  return s.hits;
}
template <SlotKind Kind>
__device__ __forceinline__ std::uint32_t search_up(const Task& task, const Grid& grid,
                                                   WarpMemory<Way::up>& memory, std::uint32_t first) {
  bool careful = task.judge_all;
  std::uint32_t hits = 0;
  if (!careful) {
    Searcher<Kind, false> s(task, grid, memory, first);
    s.search();
    hits = s.hits, careful = __any_sync(kAll, s.doubt);
  }
  if (careful) hits = search_carefully<Kind>(task, grid, memory, first, nullptr, 0);
  __syncwarp();
  return hits;
}

}  // namespace
}  // namespace padder::detect::cuda
