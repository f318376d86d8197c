// The search: one warp for 32 consecutive spheres of the order, one lane for each. Candidates of a row of
// bins lie side by side; their verdicts are bits of a mask, hits go to a queue of the warp, and records are
// computed and written by full warps. Places in the list are given out tile by tile, 128 spheres
// (cuda_place.h).
#include <algorithm>

#include "detect/cuda_down.h"
#include "detect/cuda_place.h"

namespace padder::detect::cuda {
namespace {

constexpr int kStep = 2;
// Blocks an SM must be able to hold: few registers and many warps pay more than the opposite here.
template <Way W>
constexpr int kBlocks = W == Way::single ? 10
                        : W == Way::down ? 8
                                         : 6;

// Must stay in registers: no function that is not inlined may see `this`. Not careful: notes in `doubt` that
// a candidate came near the threshold, and the warp is searched again carefully; a few in a thousand are.
template <SlotKind Kind, Way W, bool Careful>
struct Searcher {
  using Slot = typename SlotOf<Kind>::Type;
  const Task& task;
  const Grid& grid;
  WarpMemory<W>& memory;
  std::uint32_t lane, first, place, hits = 0;
  bool valid, doubt = false;
  const Target* target = nullptr;  // where hits are written instead of being queued
  std::uint32_t base = 0;
  Slot slot;
  float wide = 0, near = 0;

  __device__ __forceinline__ Searcher(const Task& t, const Grid& g, WarpMemory<W>& m, std::uint32_t f)
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
      near = near_of(grid.level[level()], slot.r);
  }
  __device__ __forceinline__ int level() const {
    int level = 0;
    if constexpr (W == Way::down) {
      const std::uint32_t key = __ldg(task.spheres.keys + place);
      while (level + 1 < grid.levels && key >= grid.level[level + 1].offset) level++;
    }
    return level;
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
    if constexpr (W == Way::up)
      search_levels();
    else
      search_level();
  }

  // A level of dense bins: the rows lie at fixed distances from the sphere's own key.
  __device__ __forceinline__ void search_level() {
    std::uint32_t key, row, plane, reach = 1;
    const FloatBins& bins = task.spheres.bins;
    if (Kind != SlotKind::fixed && bins.on) {
      key_of(bins, slot.x, slot.y, slot.z, key);
      row = bins.row, plane = bins.plane, reach = bins.fine;
    } else {
      const Level& l = grid.level[level()];
      key = __ldg(task.spheres.keys + place), row = l.count[0] + 2, plane = row * (l.count[1] + 2);
    }
    const int m = task.spheres.merge;
    std::uint32_t begin = place + 1, end = start(((key + reach) >> m) + 1), at = key;
#pragma unroll 1
    for (int q = 0; q < 5; q++) {
      // The next row's place is asked for before this one's candidates are looked at.
      at = q == 1 ? key + plane - row : at + row;
      std::uint32_t next_begin = 0, next_end = 0;
      if (q < 4) next_begin = start((at - reach) >> m), next_end = start(((at + reach) >> m) + 1);
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
          mask = judged<Kind, W>(task, grid, mask, begin + done, place, self, where, !target);
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
        if (Careful && target)
          put<Kind>(task, *target, base + at, place, from + k);
        else if (at < kQueue<W>)
          memory.at[at] = from + k, memory.lane[at] = static_cast<unsigned char>(lane);
      }
      hits += __popc(has);
    }
  }
};

// Judges every hit that asks for it. With a target, writes the hits as those from `base` on of the tile.
template <SlotKind Kind, Way W>
__device__ __noinline__ std::uint32_t search_carefully(const Task& task, const Grid& grid,
                                                       WarpMemory<W>& memory, std::uint32_t first,
                                                       const Target* target, std::uint32_t base) {
  Searcher<Kind, W, true> s(task, grid, memory, first);
  s.target = target, s.base = base;
  s.search();
  return s.hits;
}

template <SlotKind Kind, Way W>
using Group = std::conditional_t<W == Way::down, Lookers<Kind>, char>;

// A tile of spheres, or units that look down, a block.
template <SlotKind Kind, Way W>
__global__ void __launch_bounds__(kThreads, kBlocks<W>)
    search_kernel(const __grid_constant__ Task task, const __grid_constant__ Grid grid,
                  const __grid_constant__ typename DownsOf<W>::Type downs) {
  __shared__ WarpMemory<W> memory[kWarps];
  __shared__ Group<Kind, W> group[kWarps];
  __shared__ std::uint32_t sums[kWarps];
  __shared__ Target target;
  if (task.counters->flags) return;  // the table is not whole; the caller orders the spheres in another way
  const std::uint32_t warp = threadIdx.x >> 5, lane = threadIdx.x & 31, number = blockIdx.x;
  const bool own = W != Way::down || number < task.own_tiles;
  const std::uint32_t unit = (number - task.own_tiles) * kWarps + warp;
  std::uint32_t first = (number * kWarps + warp) * 32, hits = 0;
  if (own) {
    if (first < task.spheres.count) {
      bool careful = task.judge_all;
      if (!careful) {
        Searcher<Kind, W, false> s(task, grid, memory[warp], first);
        s.search();
        hits = s.hits, careful = __any_sync(kAll, s.doubt);
      }
      if (careful) hits = search_carefully<Kind, W>(task, grid, memory[warp], first, nullptr, 0);
    }
  } else if constexpr (W == Way::down) {
    if (unit < downs.units)
      hits = search_down<Kind>(task, grid, downs, memory[warp], group[warp], unit, nullptr, 0, first);
  }
  if (lane == 0) sums[warp] = hits;
  __syncthreads();
  std::uint32_t sum = 0, before = 0;
#pragma unroll
  for (std::uint32_t k = 0; k < kWarps; k++) sum += sums[k], before += k < warp ? sums[k] : 0;
  if (threadIdx.x == 0) target = take_place(task, number, sum);
  __syncthreads();
  if (target.place + min(sum, target.limit) > task.output.capacity)
    return;  // counted; the list is made longer and the search repeated
  if (hits > kQueue<W>) {
    if constexpr (W == Way::down)
      if (!own) {
        write_down<Kind>(task, grid, downs, memory[warp], group[warp], unit, &target, before);
        return;
      }
    search_carefully<Kind, W>(task, grid, memory[warp], first, &target, before);
    return;
  }
  const std::uint32_t kept = before < target.limit ? min(hits, target.limit - before) : 0;
  for (std::uint32_t k = lane; k < kept; k += 32)
    write_record<Kind>(task, first + memory[warp].lane[k], memory[warp].at[k], target.place + before + k);
  for (std::uint32_t k = kept + lane; k < hits; k += 32)
    spill(task, target, before + k, first + memory[warp].lane[k], memory[warp].at[k]);
}

std::uint32_t own_tiles(std::uint32_t spheres) {
  return static_cast<std::uint32_t>((std::uint64_t(spheres) + kThreads - 1) / kThreads);
}

template <SlotKind Kind, Way W>
void launch(const Task& task, const Grid& grid, const typename DownsOf<W>::Type& downs, cudaStream_t stream) {
  search_kernel<Kind, W><<<task.tiles, kThreads, 0, stream>>>(task, grid, downs);
  if (!task.options.fixed_order) return;
  count_places_kernel<<<(task.tiles + kGroupTiles - 1) / kGroupTiles, kGroupTiles, 0, stream>>>(task);
  // Tiles that look down may spill much: more blocks for them, while that is not too many blocks.
  const std::uint32_t fills = (task.tiles + kFillTiles - 1) / kFillTiles;
  const dim3 blocks(fills, W == Way::down ? std::clamp(24000 / fills, 1u, 8u) : 1);
  fill_kernel<Kind><<<blocks, 32 * kFillTiles, 0, stream>>>(task);
}

template <SlotKind Kind>
void launch(Task& task, const Grid& grid, const Downs& downs, cudaStream_t stream) {
  if (grid.levels == 1 && !grid.level[0].hashed)
    launch<Kind, Way::single>(task, grid, NoDowns{}, stream);
  else if (downs.count)
    launch<Kind, Way::down>(task, grid, downs, stream);
  else
    launch<Kind, Way::up>(task, grid, NoDowns{}, stream);
}

}  // namespace

Share share_for(const Counters& found, std::uint32_t spheres, const Grid& grid, SlotKind kind) {
  const auto share = [](unsigned long long contacts, std::uint32_t tiles) -> std::uint32_t {
    const double mean = static_cast<double>(contacts) / std::max(tiles, 1u);
    if (mean < 1) return 0;
    return static_cast<std::uint32_t>(std::min(std::exp2(std::floor(16 * std::log2(mean)) / 16), 0x1p24));
  };
  return {share(found.own, own_tiles(spheres)),
          share(found.contacts - found.own, down_tiles(plan_downs(grid, kind)))};
}

void search(const Source& source, const Grid& grid, const Ordered& spheres, const SearchOptions& options,
            const Output& output, Counters* counters, SearchMemory& memory, cudaStream_t stream) {
  Task task{source, spheres, output, options, counters};
  const Downs downs = plan_downs(grid, spheres.kind);
  task.own_tiles = own_tiles(spheres.count), task.tiles = task.own_tiles + down_tiles(downs);
  task.radius = static_cast<float>(options.radius);
  task.s2 = (task.radius + task.radius) * (task.radius + task.radius);
  task.judge_all = source.filtered || !options.owns_all;
  for (int k = 0; k < grid.levels; k++) task.judge_all = task.judge_all || grid.level[k].hashed;
  if (options.fixed_order) {
    const std::uint64_t tiles = task.tiles, groups = (tiles + kGroupTiles - 1) / kGroupTiles;
    auto* p = memory.sums.reserve(4 * tiles + 2 + 2 * groups);
    task.sums.groups = p, task.sums.spares = p + 2 * groups, task.sums.spills = task.sums.spares + tiles + 1,
    task.sums.spill_at = task.sums.spills + tiles;
    task.sums.counts = reinterpret_cast<std::uint32_t*>(task.sums.spill_at + tiles);
    task.sums.spill = memory.spill.data(), task.sums.room = memory.spill.data() ? memory.spill.capacity() : 0;
    cuda_check(cudaMemsetAsync(p, 0, 16 * groups, stream), "clear the counters");
  }
  if (spheres.kind == SlotKind::equal) launch<SlotKind::equal>(task, grid, downs, stream);
  if (spheres.kind == SlotKind::unequal) launch<SlotKind::unequal>(task, grid, downs, stream);
  if (spheres.kind == SlotKind::fixed) launch<SlotKind::fixed>(task, grid, downs, stream);
  cuda_launched("search for contacts");
}

}  // namespace padder::detect::cuda
