// SPDX-License-Identifier: MIT
// Fine to coarse: each sphere searches its own level and the coarser ones. This is the way where levels are
// hashed and differ much, or differ too much to be searched from coarse to fine. Candidates of a row of bins
// lie side by side; float tests them, the results are bits of a mask, and contacts go to a queue of the warp.
#include "detect/cuda/device/device.h"
#include "detect/cuda/search/exact_test.h"
#include "detect/cuda/search/launch.h"
#include "detect/cuda/search/tile_search.h"
#include "detect/cuda/tuning.h"

namespace padder::detect::cuda {
namespace {

using UpQueue = ContactQueue<tuning::kFineToCoarseQueue>;

// The search of a lane's sphere. Its members must stay in registers, so no function that sees `this` may be
// called out of line. Exact: each contact that float is not sure of is tested at once. Otherwise the search
// only notes in `doubt` that a candidate came near the threshold; then the warp searches again exactly, which
// a few in a thousand do.
template <SlotKind Kind, bool Exact>
struct UpwardSearch {
  using Slot = typename SlotOf<Kind>::Type;
  static constexpr std::uint32_t kAtOnce = 2;  // candidates that a lane has under way
  const SearchTask& task;
  const Grid& grid;
  UpQueue& queue;
  std::uint32_t lane, first, index, hits = 0;
  bool valid, doubt = false;
  const OutputRange* range = nullptr;  // where contacts are emitted instead of being queued
  std::uint32_t base = 0;              // the first one's number
  Slot slot;
  float wide = 0, near = 0;

  __device__ __forceinline__ UpwardSearch(const SearchTask& t, const Grid& g, UpQueue& q, std::uint32_t f)
      : task(t),
        grid(g),
        queue(q),
        lane(threadIdx.x & 31),
        first(f),
        index(f + lane),
        valid(index < t.spheres.count) {
    if (!valid) index = task.spheres.count - 1;
    slot = load_slot(slots_of<Kind>(task) + index);
    if constexpr (Kind == SlotKind::equal)
      wide = task.sum_squared * task.wide + 2 * kAbsoluteBand<Slot>,
      near = task.sum_squared * task.near + 4 * kAbsoluteBand<Slot>;
  }

  __device__ __forceinline__ void search() {
    const Sphere sphere = sphere_of_slot<Kind>(task, index);
    const int own = valid ? level_of(grid, sphere) : kMaxLevels;
    for (int level = __reduce_min_sync(kFullWarp, own); level < grid.levels; level++)
      search_level(sphere, level, own <= level, own == level);
  }

 private:
  __device__ __forceinline__ std::uint32_t start(std::uint32_t key) const {
    return __ldg(task.spheres.table + key);
  }
  __device__ __forceinline__ float near_of(const Level& l, float r) const {
    const float most =
        r + task.margin_f32 +
        static_cast<float>(Kind == SlotKind::fixed_point ? l.radius_max * l.units : l.radius_max);
    return most * most * task.near * 1.001f + 4 * kAbsoluteBand<Slot>;
  }

  // `active`: the lane's sphere searches this level; `same`: it is the sphere's own, of which it searches the
  // rest of its bin and the forward half of the bins around.
  __device__ __forceinline__ void search_level(const Sphere& sphere, int level, bool active, bool same) {
    const Level& l = grid.level[level];
    const Split sx = split(l, sphere.x), sy = split(l, sphere.y), sz = split(l, sphere.z);
    const BinOffsets rx = neighbour_offsets(l, sx, sphere.r), ry = neighbour_offsets(l, sy, sphere.r),
                     rz = neighbour_offsets(l, sz, sphere.r);
    Slot here = slot;
    if constexpr (Kind == SlotKind::fixed_point)
      here = {fixed_point_of(l, sx), fixed_point_of(l, sy), fixed_point_of(l, sz),
              static_cast<float>(mul(add(sphere.r, l.grown_by), l.units))};
    if constexpr (Kind != SlotKind::equal) near = near_of(l, here.r);
    for (int dz = -1; dz <= 1; dz++)
      for (int dy = -1; dy <= 1; dy++) {
        const bool own_row = same && dy == 0 && dz == 0;
        bool wanted = active && dz >= rz.low && dz <= rz.high && dy >= ry.low && dy <= ry.high;
        if (same && (dz < 0 || (dz == 0 && dy < 0))) wanted = false;
        if (!__any_sync(kFullWarp, wanted)) continue;
        const std::int64_t y = sy.bin + dy, z = sz.bin + dz;
        if (!l.hashed) {
          std::int64_t x_low = sx.bin + (own_row ? 0 : rx.low), x_high = sx.bin + rx.high;
          std::uint32_t begin = 0, end = 0;
          if (wanted && cut_row(l, x_low, x_high, y, z)) {
            const std::uint32_t row = row_of(l, y, z);
            begin = own_row ? index + 1 : start(key_in_row(l, row, x_low));
            end = start(key_in_row(l, row, x_high) + 1);
          }
          search_row(begin, end, here, {level, 0, dy, dz});
        } else {
          for (int dx = -1; dx <= 1; dx++) {
            std::uint32_t begin = 0, end = 0;
            if (wanted && dx >= rx.low && dx <= rx.high && !(own_row && dx < 0)) {
              const std::uint32_t key = key_in_row(l, row_of(l, y, z), sx.bin + dx);
              begin = own_row && dx == 0 ? index + 1 : start(key), end = start(key + 1);
            }
            search_row(begin, end, here, {level, dx, dy, dz});
          }
        }
      }
  }

  // Below zero: the two may touch.
  __device__ __forceinline__ float excess(const Slot& a, const Slot& b) const {
    const float3 d = difference(a, b);
    if constexpr (Kind == SlotKind::equal) {
      return fmaf(d.z, d.z, fmaf(d.y, d.y, fmaf(d.x, d.x, -wide)));
    } else {
      const float s = radii_together<Kind>(task, a, b);
      return fmaf(d.z, d.z,
                  fmaf(d.y, d.y, fmaf(d.x, d.x, fmaf(-task.wide * s, s, -2 * kAbsoluteBand<Slot>))));
    }
  }

  // Candidates `begin` to `end` - 1, which differ from lane to lane, 32 at a time: candidate k is bit 31 - k.
  __device__ __forceinline__ void search_row(std::uint32_t begin, std::uint32_t end, const Slot& self,
                                             SearchedBin searched) {
    const std::uint32_t count = end > begin ? end - begin : 0, longest = __reduce_max_sync(kFullWarp, count);
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
      if constexpr (Exact) {
        if (mask && (task.test_all || !(nearest > near)))
          mask = exactly_tested(mask, begin + done, self, searched);
      } else {
        doubt |= !(nearest > near);
      }
      push(mask, begin + done);
    }
  }

  __device__ __forceinline__ std::uint32_t exactly_tested(std::uint32_t mask, std::uint32_t from,
                                                          const Slot& self, SearchedBin searched) const {
    for (std::uint32_t rest = mask; rest;) {
      const int k = __clz(rest);
      const std::uint32_t bit = 0x80000000u >> k;
      rest ^= bit;
      if (!is_contact<Kind, true>(task, grid, index, self, from + k, searched, !range)) mask ^= bit;
    }
    return mask;
  }

  // Contacts to the queue, one of each lane at a time, so that their order is the same in every run.
  __device__ __forceinline__ void push(std::uint32_t mask, std::uint32_t from) {
    for (std::uint32_t has = __ballot_sync(kFullWarp, mask != 0); has;
         has = __ballot_sync(kFullWarp, mask != 0)) {
      if (mask) {
        const int k = __clz(mask);
        mask ^= 0x80000000u >> k;
        const std::uint32_t at = hits + __popc(has & ((1u << lane) - 1));
        if (Exact && range)
          emit<Kind>(task, *range, base + at, index, from + k);
        else if (at < UpQueue::kCapacity)
          queue.index[at] = from + k, queue.who[at] = static_cast<unsigned char>(lane);
      }
      hits += __popc(has);
    }
  }
};

// With a range, emits the contacts as numbers `base` onwards of the tile.
template <SlotKind Kind>
__device__ __noinline__ std::uint32_t search_exactly(const SearchTask& task, const Grid& grid, UpQueue& queue,
                                                     std::uint32_t first, const OutputRange* range,
                                                     std::uint32_t base) {
  UpwardSearch<Kind, true> s(task, grid, queue, first);
  s.range = range, s.base = base;
  s.search();
  return s.hits;
}

template <SlotKind Kind>
struct FineToCoarse {
  using Pairs = NoLevelPairs;
  using Queue = UpQueue;
  using State = char;
  static __device__ __forceinline__ bool find(const SearchTask& task, const Grid& grid, const Pairs&,
                                              Queue& queue, State&, std::uint32_t number, std::uint32_t warp,
                                              std::uint32_t, std::uint32_t& found) {
    const std::uint32_t first = (number * kTileWarps + warp) * 32;
    if (first >= task.spheres.count) return true;
    bool exact = task.test_all;
    if (!exact) {
      UpwardSearch<Kind, false> s(task, grid, queue, first);
      s.search();
      found = s.hits, exact = __any_sync(kFullWarp, s.doubt);
    }
    if (exact) found = search_exactly<Kind>(task, grid, queue, first, nullptr, 0);
    __syncwarp();
    if (found > Queue::kCapacity) found |= kQueueOverflow;
    return true;
  }
  static __device__ __forceinline__ void emit(const SearchTask& task, const Grid& grid, const Pairs&,
                                              Queue& queue, State&, std::uint32_t number, std::uint32_t warp,
                                              std::uint32_t found, const OutputRange& range,
                                              std::uint32_t before) {
    const std::uint32_t first = (number * kTileWarps + warp) * 32;
    if (found & kQueueOverflow)
      search_exactly<Kind>(task, grid, queue, first, &range, before);
    else
      emit_by_warp<Kind>(task, range, found, before,
                         [&](std::uint32_t k, std::uint32_t& i, std::uint32_t& j) {
                           i = queue.who[k], j = queue.index[k], i += first;
                         });
  }
};

template <SlotKind Kind>
__global__ void __launch_bounds__(kTileSpheres, tuning::kFineToCoarseBlocks)
    fine_to_coarse_kernel(const __grid_constant__ SearchTask task, const __grid_constant__ Grid grid) {
  __shared__ TileMemory<FineToCoarse<Kind>> memory;
  const bool ordered = task.stable.ordered;
  if (ordered && threadIdx.x == 0) memory.search_number = ordered_search_number(task);
  // Where a flag is set the table is not whole, and the caller will order the spheres in another way.
  if (task.counters->flags) return;
  search_tile<FineToCoarse<Kind>>(task, grid, {}, memory, kept_in_register(blockIdx.x), ordered, 0);
}

}  // namespace

unsigned resident_fine_to_coarse(SlotKind kind, int processors) {
  unsigned blocks = 0;
  with_kind(kind, [&](auto k) {
    blocks = resident_blocks(reinterpret_cast<const void*>(fine_to_coarse_kernel<k()>), kTileSpheres, 0,
                             processors);
  });
  return blocks;
}

void launch_fine_to_coarse(const SearchTask& task, const Grid& grid, cudaStream_t stream) {
  with_kind(task.spheres.kind, [&](auto kind) {
    fine_to_coarse_kernel<kind()><<<task.tiles, kTileSpheres, 0, stream>>>(task, grid);
  });
  cuda_launched("search for contacts");
}

}  // namespace padder::detect::cuda
