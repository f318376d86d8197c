// The search: one warp for 32 consecutive spheres of the order, one lane for each. Candidates of a row of
// bins lie side by side; their verdicts are bits of a mask, hits go to a queue of the warp, and records are
// computed and written by full warps. Places in the list are given out tile by tile, 128 spheres
// (place.h).
#include <algorithm>

#include "detect/cuda/down.h"
#include "detect/cuda/place.h"

namespace padder::detect::cuda {
namespace {

// Candidates that a lane asks for at a time.
template <Way W>
constexpr int kStep = W == Way::few ? 4 : 2;
// Blocks an SM must be able to hold: few registers and many warps pay more than the opposite here.
template <Way W>
constexpr int kBlocks = W == Way::single                  ? 10
                        : W == Way::down || W == Way::few ? 8
                                                          : 6;

// Few tiles of one level: a kernel of their own. kMostTurns of them run at once, and can wait for each other.
constexpr std::uint32_t kFewTiles = 16 * kProcessors;
static_assert(kMostTurns <= kFewTiles);

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
    if constexpr (W == Way::few) {
      // The places of all rows are asked for at once.
      std::uint32_t begin[5], end[5], at = key;
#pragma unroll
      for (int q = 0; q < 5; q++) {
        begin[q] = q ? start((at - reach) >> m) : place + 1, end[q] = start(((at + reach) >> m) + 1);
        at = q == 1 ? key + plane - row : at + row;  // of the next one
      }
#pragma unroll 1
      for (int q = 0; q < 5; q++) {
        search_row(begin[0], valid ? end[0] : begin[0], slot, {});
#pragma unroll
        for (int k = 0; k < 4; k++) begin[k] = begin[k + 1], end[k] = end[k + 1];
      }
    } else {
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
      const std::uint32_t span = (min(longest - done, 32u) + kStep<W> - 1) & ~(kStep<W> - 1u),
                          left = count > done ? count - done : 0;
      const Slot* candidate = slots_of<Kind>(task) + (left ? begin + done : 0);
      std::uint32_t mask = 0;
      float nearest = INFINITY;
      for (std::uint32_t k = 0; k < span; k += kStep<W>, candidate += kStep<W>) {
        Slot c[kStep<W>];
#pragma unroll
        for (int u = 0; u < kStep<W>; u++) c[u] = load_slot(candidate + u);
#pragma unroll
        for (int u = 0; u < kStep<W>; u++) {
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

// The hits of a warp, from `before` on of the tile.
template <SlotKind Kind, Way W>
__device__ __forceinline__ void write_hits(const Task& task, const WarpMemory<W>& memory,
                                           const Target& target, std::uint32_t first, std::uint32_t hits,
                                           std::uint32_t before) {
  const std::uint32_t lane = threadIdx.x & 31,
                      kept = before < target.limit ? min(hits, target.limit - before) : 0;
  for (std::uint32_t k = lane; k < kept; k += 32)
    write_record<Kind>(task, first + memory.lane[k], memory.at[k], target.place + before + k);
  const Word spill = target.spill + before - target.limit;
  for (std::uint32_t k = kept + lane; k < hits; k += 32)
    if (spill + k < task.sums.room)
      task.sums.spill[spill + k] = static_cast<Word>(first + memory.lane[k]) << 32 | memory.at[k];
}

// The warp takes units that look down, one after the other, as long as there are any.
template <SlotKind Kind>
__device__ __forceinline__ void look_down(const Task& task, const Grid& grid, const Downs& downs,
                                          WarpMemory<Way::down>& memory, Lookers<Kind>& lookers) {
  const std::uint32_t lane = threadIdx.x & 31;
  const bool fixed = task.options.fixed_order;
  do {
    std::uint32_t warp = (blockIdx.x - task.own_tiles) * kWarps + (threadIdx.x >> 5);
    if (task.next) {
      if (lane == 0) {
        warp = atomicAdd(task.next, 1u);
        // The last to find nothing leaves the counter as it was.
        if (warp + 1 == downs.warps + (gridDim.x - task.own_tiles) * kWarps) *task.next = 0;
      }
      warp = __shfl_sync(kAll, warp, 0);
    }
    if (warp >= downs.warps) return;
    for (std::uint32_t turn = 0;; turn++) {
      const std::uint32_t hits =
          search_down<Kind>(task, grid, downs, memory, lookers, warp, turn, nullptr, 0);
      __syncwarp();  // other lanes' hits are read below
      // By shuffles and not through shared memory: lanes 1 to 31 wait here, or the warp stays split.
      Word at = 0;
      if (lane == 0) at = take_unit(task, lookers.unit, lookers.first, hits);
      at = __shfl_sync(kAll, at, 0);
      const bool more = lookers.more;
      if (fixed && !more && lane < lookers.left)  // those that are empty
        task.sums.counts[task.own_tiles + lookers.unit + 1 + lane] = 0;
      if (hits > kQueue<Way::down>) {
        const std::uint32_t limit = fixed ? 0 : ~0u;
        const Target target{at, at, limit, kOfUnit | lookers.unit << 5, lookers.first};
        if (fixed || at + hits <= task.output.capacity)
          write_down<Kind>(task, grid, downs, memory, lookers, warp, turn, target, 0);
      } else if (fixed) {
        const std::uint32_t of = kOfUnit | lookers.unit << 5;
        for (std::uint32_t k = lane; k < hits; k += 32)
          if (at + k < task.sums.room)
            task.sums.spill[at + k] = static_cast<Word>(of | memory.lane[k]) << 32 | memory.at[k];
      } else if (at + hits <= task.output.capacity) {
        const std::uint32_t first = lookers.first;
        for (std::uint32_t k = lane; k < hits; k += 32)
          write_record<Kind>(task, first + memory.lane[k], memory.at[k], at + k);
      }
      __syncwarp();
      if (!more) break;
    }
  } while (task.next);
}

// A tile of spheres a block; behind those, blocks of warps that look down.
template <SlotKind Kind, Way W>
__global__ void __launch_bounds__(kThreads, kBlocks<W>)
    search_kernel(const __grid_constant__ Task task, const __grid_constant__ Grid grid,
                  const __grid_constant__ typename DownsOf<W>::Type downs) {
  __shared__ WarpMemory<W> memory[kWarps];
  __shared__ Group<Kind, W> group[kWarps];
  __shared__ std::uint32_t sums[kWarps];
  __shared__ Target targets[kWarps];
  __shared__ Word turn, befores[kWarps];
  const bool turns = W != Way::single && task.sums.turns;  // few spheres go the way of the few
  if (turns && threadIdx.x == 0) turn = begin_turn(task);
  if (task.counters->flags) return;  // the table is not whole; the caller orders the spheres in another way
  if (turns) __syncthreads();
  const std::uint32_t warp = threadIdx.x >> 5, lane = threadIdx.x & 31,
                      number = turns ? static_cast<std::uint32_t>(turn) : blockIdx.x;
  const bool own = W != Way::down || number < task.own_tiles;
  std::uint32_t first = (number * kWarps + warp) * 32, hits = 0;
  if (own) {
    if (first < task.spheres.count) {
      if constexpr (W == Way::few) {
        Searcher<Kind, W, true> s(task, grid, memory[warp], first);
        s.search();
        hits = s.hits;
      } else {
        bool careful = task.judge_all;
        if (!careful) {
          Searcher<Kind, W, false> s(task, grid, memory[warp], first);
          s.search();
          hits = s.hits, careful = __any_sync(kAll, s.doubt);
        }
        if (careful) hits = search_carefully<Kind, W>(task, grid, memory[warp], first, nullptr, 0);
      }
    }
  } else if constexpr (W == Way::down) {
    if (!turns) {
      look_down<Kind>(task, grid, downs, memory[warp], group[warp]);
      return;
    }
    const std::uint32_t looker = (number - task.own_tiles) * kWarps + warp;
    if (looker < downs.warps) {
      hits = search_down<Kind>(task, grid, downs, memory[warp], group[warp], looker, 0, nullptr, 0);
      first = group[warp].first;
    }
  }
  if (lane == 0) sums[warp] = hits;
  __syncthreads();
  std::uint32_t sum = 0, before = 0;
#pragma unroll
  for (std::uint32_t k = 0; k < kWarps; k++) sum += sums[k], before += k < warp ? sums[k] : 0;
  if (turns) {
    const Word place = take_turn(task, turn, sum, befores);
    if (lane == 0) targets[warp] = {place, 0, ~0u, 0, 0};
    __syncwarp();
  } else {
    if (threadIdx.x == 0) targets[0] = take_place(task, number, sum);
    __syncthreads();
  }
  const Target& target = targets[turns ? warp : 0];
  if (target.place + min(sum, target.limit) > task.output.capacity)
    return;  // counted; the list is made longer and the search repeated
  if (hits <= kQueue<W>)
    write_hits<Kind, W>(task, memory[warp], target, first, hits, before);
  else if (own)
    search_carefully<Kind, W>(task, grid, memory[warp], first, &target, before);
  else if constexpr (W == Way::down)
    write_down<Kind>(task, grid, downs, memory[warp], group[warp], (number - task.own_tiles) * kWarps + warp,
                     0, target, before);
}

std::uint32_t over(std::uint64_t n, std::uint32_t each) {
  return static_cast<std::uint32_t>((n + each - 1) / each);
}

std::uint32_t own_tiles(std::uint32_t spheres) { return over(spheres, kThreads); }

template <SlotKind Kind, Way W>
void launch(const Task& task, const Grid& grid, const typename DownsOf<W>::Type& downs, cudaStream_t stream) {
  std::uint32_t blocks = task.own_tiles;
  if constexpr (W == Way::down) {
    const std::uint32_t lookers = over(downs.warps, kWarps);
    blocks += task.next ? std::min<std::uint32_t>(lookers, kProcessors * kBlocks<W>) : lookers;
  }
  search_kernel<Kind, W><<<blocks, kThreads, 0, stream>>>(task, grid, downs);
  if (!task.options.fixed_order || task.sums.turns) return;
  fill_kernel<Kind>
      <<<over(task.own_tiles, fill_tiles(task)) + over(task.units, kGroupTiles), kFillThreads, 0, stream>>>(
          task);
  if (task.units) move_kernel<Kind><<<6 * kProcessors, kFillThreads, 0, stream>>>(task);
}

template <SlotKind Kind>
void launch(Task& task, const Grid& grid, const Downs& downs, cudaStream_t stream) {
  if (grid.levels == 1 && !grid.level[0].hashed && task.own_tiles <= kFewTiles)
    launch<Kind, Way::few>(task, grid, NoDowns{}, stream);
  else if (grid.levels == 1 && !grid.level[0].hashed)
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
  const std::uint32_t tiles = own_tiles(spheres);
  if (tiles + over(plan_downs(grid, kind).warps, kWarps) <= kMostTurns) return {};
  return {share(found.own, tiles)};
}

void search(const Source& source, const Grid& grid, const Ordered& spheres, const SearchOptions& options,
            const Output& output, Counters* counters, SearchMemory& memory, cudaStream_t stream) {
  Task task{source, spheres, output, options, counters};
  const Downs downs = plan_downs(grid, spheres.kind);
  task.own_tiles = own_tiles(spheres.count), task.units = downs.units;
  task.radius = static_cast<float>(options.radius);
  task.s2 = (task.radius + task.radius) * (task.radius + task.radius);
  task.judge_all = source.filtered || !options.owns_all;
  for (int k = 0; k < grid.levels; k++) task.judge_all = task.judge_all || grid.level[k].hashed;
  const std::uint64_t groups = over(task.own_tiles, kGroupTiles) + over(task.units, kGroupTiles),
                      marks = 2 + kMostTurns + 2 * groups;
  if (options.fixed_order || downs.warps) {
    const bool fresh = memory.marks.capacity() < marks;
    auto* const p = memory.marks.reserve(marks);
    if (fresh) cuda_check(cudaMemsetAsync(p, 0, marks * 8, stream), "clear the counters");
    if (spheres.count >= kManySpheres) task.next = reinterpret_cast<unsigned int*>(p);
    task.sums.fills = reinterpret_cast<unsigned int*>(p) + 1;
    task.sums.turn = p + 1, task.sums.groups = p + 2 + kMostTurns;
  }
  if (options.fixed_order) {
    TileSums& sums = task.sums;
    const std::uint64_t tiles = std::uint64_t(task.own_tiles) + task.units;
    sums.turns = task.own_tiles + over(downs.warps, kWarps) <= kMostTurns;
    sums.own_groups = over(task.own_tiles, kGroupTiles);
    sums.all_groups = sums.own_groups + over(task.units, kGroupTiles);
    auto* p = memory.sums.reserve(2 * tiles);
    sums.spill_at = p, sums.counts = reinterpret_cast<std::uint32_t*>(p + tiles),
    sums.firsts = sums.counts + tiles;
    sums.spill = memory.spill.data(), sums.room = memory.spill.data() ? memory.spill.capacity() : 0;
  }
  if (spheres.kind == SlotKind::equal) launch<SlotKind::equal>(task, grid, downs, stream);
  if (spheres.kind == SlotKind::unequal) launch<SlotKind::unequal>(task, grid, downs, stream);
  if (spheres.kind == SlotKind::fixed) launch<SlotKind::fixed>(task, grid, downs, stream);
  cuda_launched("search for contacts");
}

}  // namespace padder::detect::cuda
