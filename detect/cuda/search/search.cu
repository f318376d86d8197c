// SPDX-License-Identifier: MIT
// The search: one warp for 32 consecutive spheres of the order, at their own level (level.h), and warps that
// look down at finer levels (down.h), of many spheres as one flow (flow.h); or all levels upwards (up.h).
// What touches waits in a queue of the warp until its tile of 128 spheres has places in the list (place.h);
// then records are computed and written by full warps.
#include <algorithm>

#include "detect/cuda/device.h"
#include "detect/cuda/output/flow_compaction.h"
#include "detect/cuda/output/output_slots.h"
#include "detect/cuda/output/slot_estimate.h"
#include "detect/cuda/output/spill_compaction.h"
#include "detect/cuda/search/fine_to_coarse.h"
#include "detect/cuda/search/fused_levels.h"
#include "detect/cuda/search/same_level.h"

namespace padder::detect::cuda {
namespace {

// Blocks an SM must be able to hold: few registers and many warps pay more than the opposite here.
template <Way W>
constexpr int kBlocks = W == Way::single || W == Way::down ? 10
                        : W == Way::few                    ? 8
                                                           : 6;

// Few tiles of one level: a kernel of their own. Up to kMostTurns of them wait for each other, if so many run
// at once.
constexpr std::uint32_t kFewTiles = 16 * kProcessors;
static_assert(kMostTurns <= kFewTiles);
// Where tiles wait for each other a warp has one unit only.
static_assert(kMostTurns * kThreads < kManySpheres);

template <SlotKind Kind, Way W>
using Group = std::conditional_t<W == Way::down, Lookers<Kind>, char>;

// The hits of a warp, from `before` on of the tile; `pair(k, i, j)` tells the places of the k-th.
template <SlotKind Kind, class PairOf>
__device__ __forceinline__ void write_hits(const Task& task, const Target& target, std::uint32_t hits,
                                           std::uint32_t before, PairOf pair) {
  const std::uint32_t lane = kept(threadIdx.x & 31), limit = target.limit,
                      most = before < limit ? min(hits, limit - before) : 0;
  std::uint32_t i, j;
  const Word to = target.place + before;
  if (is_wide<Kind>(task)) {
#pragma unroll 1
    for (std::uint32_t k = lane; k < most; k += 32) pair(k, i, j), write_wide<Kind>(task, i, j, to + k);
  } else if constexpr (Kind != SlotKind::fixed_point) {
    const auto write = [&](auto normals) {
      constexpr int kAtOnce = 2;
#pragma unroll 1
      for (std::uint32_t k = lane; k < most; k += 32 * kAtOnce) {
        std::uint32_t is[kAtOnce], js[kAtOnce];
        Both both[kAtOnce];
#pragma unroll
        for (int u = 0; u < kAtOnce; u++) {
          pair(k + 32 * u < most ? k + 32 * u : k, is[u], js[u]);
          both[u] = load_both<Kind>(task, is[u], js[u]);
        }
#pragma unroll
        for (int u = 0; u < kAtOnce; u++)
          if (k + 32 * u < most)
            write_both<Kind, decltype(normals)::value>(task, both[u], is[u], js[u], to + k + 32 * u);
      }
    };
    if (task.output.width == Width::normals)
      write(std::true_type{});
    else
      write(std::false_type{});
  }
  const Word spill = target.spill + before - limit;
#pragma unroll 1
  for (std::uint32_t k = most + lane; k < hits; k += 32) {
    pair(k, i, j);
    if (spill + k < task.sums.room) task.sums.spill[spill + k] = static_cast<Word>(i) << 32 | j;
  }
}

// The warp takes units that look down, one after the other, as long as there are any.
template <SlotKind Kind>
__device__ __forceinline__ void look_down(const Task& task, const Grid& grid, const Downs& downs,
                                          WarpMemory<Way::down>& memory, Lookers<Kind>& lookers) {
  const std::uint32_t lane = threadIdx.x & 31;
  const bool fixed = task.options.stable_order;
  if (task.sums.shares) await_before();
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
      const std::uint32_t found = search_down<Kind>(task, grid, downs, memory, lookers, warp, turn),
                          hits = found & ~kLate;
      __syncwarp();  // other lanes' hits are read below
      Word at = 0;
      if (lane == 0) {
        const Target t = take_unit(task, lookers.unit, lookers.first, hits);
        lookers.target = t, at = t.place;
      }
      // By a shuffle and not through shared memory: lanes 1 to 31 wait here, or the warp stays split.
      at = __shfl_sync(kAll, at, 0);
      __syncwarp();  // the target is read below
      const bool more = lookers.more;
      // Those that are empty: nothing was expected of them.
      if (fixed && !more && lane < lookers.left)
        task.sums.counts[task.own_tiles + lookers.unit + 1 + lane] = 0;
      const std::uint32_t most = fixed ? min(hits, lookers.target.limit) : hits;
      if (at + most > task.output.capacity) {
        // Counted; the list is made longer and the search repeated.
      } else if (found & kLate) {
        search_down_unqueued<Kind>(task, grid, downs, lookers, warp, turn, &lookers.target, 0);
      } else {
        for (std::uint32_t k = lane; k < most; k += 32)
          write_record<Kind>(task, lookers.place(memory.lane[k]), memory.at[k], at + k);
        for (std::uint32_t k = most + lane; k < hits; k += 32)
          spill(task, lookers.target, k, lookers.place(memory.lane[k]), memory.at[k]);
      }
      __syncwarp();
      if (!more) break;
    }
  } while (task.next);
}

template <SlotKind Kind, Way W>
struct BlockMemory {
  WarpMemory<W> warp[kWarps];
  Group<Kind, W> group[kWarps];
  std::uint32_t sums[kWarps];
  Target targets[kWarps];
  Word before;
  std::uint32_t turn;
};

// A tile of spheres, or (where tiles wait for those before them) of units that look down.
template <SlotKind Kind, Way W>
__device__ __forceinline__ void search_tile(const Task& task, const Grid& grid,
                                            const typename DownsOf<W>::Type& downs,
                                            BlockMemory<Kind, W>& memory, std::uint32_t number, bool turns,
                                            std::uint32_t flags) {
  // By a shuffle: then the compiler knows that all lanes agree.
  const std::uint32_t warp = __shfl_sync(kAll, threadIdx.x >> 5, 0);
  const bool own = W != Way::down || number < task.own_tiles;
  {
    const std::uint32_t first = (number * kWarps + warp) * 32;
    std::uint32_t hits = 0;
    if (own) {
      if (first < task.spheres.count) {
        if constexpr (W == Way::up) {
          hits = search_up<Kind>(task, grid, memory.warp[warp], first);
          if (hits > kQueue<W>) hits |= kLate;
        } else {
          const Queue queue{shared_address(memory.warp[warp].at), first};
          const Own<Kind> mine = own_of<Kind>(task, grid, downs, first);
          if (flags) return;
          const std::uint32_t queued = search_level<Kind, W>(task, mine, queue);
          hits = queued > kQueue<W> ? search_unqueued<Kind, W>(task, grid, downs, first, nullptr, 0) | kLate
                                    : settle<Kind, W>(task, grid, queue, queued);
        }
      }
    } else if constexpr (W == Way::down) {
      const std::uint32_t looker = (number - task.own_tiles) * kWarps + warp;
      if (looker < downs.warps)
        hits = search_down<Kind>(task, grid, downs, memory.warp[warp], memory.group[warp], looker, 0);
    }
    if ((threadIdx.x & 31) == 0) memory.sums[warp] = hits;
  }
  __syncthreads();
  std::uint32_t sum = 0, before = 0;
#pragma unroll
  for (std::uint32_t k = 0; k < kWarps; k++) {
    const std::uint32_t count = memory.sums[k] & ~kLate;
    sum += count, before += k < warp ? count : 0;
  }
  if (turns) {
    const Word place = take_turn(task, memory.turn, sum, &memory.before);
    if ((threadIdx.x & 31) == 0) memory.targets[warp] = {place, 0, ~0u, 0, 0};
    __syncwarp();
  } else {
    if (threadIdx.x == 0) memory.targets[0] = take_place(task, number, sum);
    __syncthreads();
  }
  const Target& target = memory.targets[turns ? warp : 0];
  if (target.place + min(sum, target.limit) > task.output.capacity)
    return;  // counted; the list is made longer and the search repeated
  const std::uint32_t first = (number * kWarps + warp) * 32, hits = memory.sums[warp];
  if (!(hits & kLate) && W != Way::up && own) {
    const Queue queue{shared_address(memory.warp[warp].at), first};
    write_hits<Kind>(task, target, hits, before, [&](std::uint32_t k, std::uint32_t& i, std::uint32_t& j) {
      const std::uint32_t word = queue.get(k);
      i = queue.i(word), j = queue.j(word);
    });
  } else if (!(hits & kLate)) {
    if constexpr (W == Way::up || W == Way::down) {
      write_hits<Kind>(task, target, hits, before, [&](std::uint32_t k, std::uint32_t& i, std::uint32_t& j) {
        i = memory.warp[warp].lane[k], j = memory.warp[warp].at[k];
        if constexpr (W == Way::down)
          i = memory.group[warp].place(i);
        else
          i += first;
      });
    }
  } else if constexpr (W == Way::up) {
    search_carefully<Kind>(task, grid, memory.warp[warp], first, &target, before);
  } else if (own) {
    search_unqueued<Kind, W>(task, grid, downs, first, &target, before);
  } else if constexpr (W == Way::down) {
    search_down_unqueued<Kind>(task, grid, downs, memory.group[warp],
                               (number - task.own_tiles) * kWarps + warp, 0, &target, before);
  }
}

// A tile of spheres a block; behind those, blocks of warps that look down.
template <SlotKind Kind, Way W>
__global__ void __launch_bounds__(kThreads, kBlocks<W>)
    search_kernel(const __grid_constant__ Task task, const __grid_constant__ Grid grid,
                  const __grid_constant__ typename DownsOf<W>::Type downs) {
  __shared__ BlockMemory<Kind, W> memory;
  const bool turns = W != Way::single && task.sums.turns;  // few spheres go the way of the few
  if (turns && threadIdx.x == 0) memory.turn = begin_turn(task);
  // The table is not whole: the caller orders the spheres in another way. Single: asked when there is
  // something else to wait for, too.
  const std::uint32_t flags = task.counters->flags;
  if (W != Way::single && flags) return;
  // From the last tile on, whose spheres were put in order last and are still in L2. Of unequal radii that
  // gained nothing.
  constexpr bool kBackwards = W == Way::single && Kind == SlotKind::equal;
  const std::uint32_t number = kept(kBackwards ? gridDim.x - 1 - blockIdx.x : blockIdx.x);
  if constexpr (W == Way::down) {
    if (!turns && number >= task.own_tiles) {
      const std::uint32_t warp = threadIdx.x >> 5;
      look_down<Kind>(task, grid, downs, memory.warp[warp], memory.group[warp]);
      return;
    }
  }
  search_tile<Kind, W>(task, grid, downs, memory, number, turns, flags);
}

std::uint32_t over(std::uint64_t n, std::uint32_t each) {
  return static_cast<std::uint32_t>((n + each - 1) / each);
}

std::uint32_t own_tiles(std::uint32_t spheres) { return over(spheres, kThreads); }

struct Shape {
  unsigned blocks, threads, bytes = 0;  // bytes: of shared memory, asked for at the launch
};
// Begins once all blocks of the kernel before have said that it may (begin_next); that one is waited for by
// await_before.
template <class... Given, class... Arguments>
void launch_beside(void (*kernel)(Given...), Shape shape, cudaStream_t stream,
                   const Arguments&... arguments) {
  cudaLaunchAttribute beside{};
  beside.id = cudaLaunchAttributeProgrammaticStreamSerialization;
  beside.val.programmaticStreamSerializationAllowed = 1;
  cudaLaunchConfig_t config{};
  config.gridDim = shape.blocks, config.blockDim = shape.threads, config.dynamicSmemBytes = shape.bytes;
  config.stream = stream;
  config.attrs = &beside, config.numAttrs = 1;
  cuda_check(cudaLaunchKernelEx(&config, kernel, Given(arguments)...), "search for contacts");
}

// Groups wait for the shares of those before them.
template <SlotKind Kind>
Shape shape_of_shares(const Task& task, int processors) {
  return {std::min(task.sums.share_groups, resident_blocks(reinterpret_cast<const void*>(share_kernel<Kind>),
                                                           kShareUnits, 0, processors)),
          kShareUnits};
}

template <SlotKind Kind, Way W>
void launch(const Task& task, const Grid& grid, const typename DownsOf<W>::Type& downs, int processors,
            cudaStream_t stream) {
  std::uint32_t blocks = task.own_tiles;
  if constexpr (W == Way::down) {
    const std::uint32_t lookers = over(downs.warps, kWarps);
    blocks += task.next ? std::min<std::uint32_t>(lookers, kProcessors * kBlocks<W>) : lookers;
    // Shares are made beside the tiles of spheres: the search begins once all blocks that make them have, and
    // units wait for them.
    if (task.sums.shares && !task.sums.turns) {
      const Shape shares = shape_of_shares<Kind>(task, processors);
      share_kernel<Kind><<<shares.blocks, shares.threads, 0, stream>>>(task, grid, downs);
      launch_beside(search_kernel<Kind, W>, {blocks, kThreads}, stream, task, grid, downs);
    } else {
      search_kernel<Kind, W><<<blocks, kThreads, 0, stream>>>(task, grid, downs);
    }
  } else {
    search_kernel<Kind, W><<<blocks, kThreads, 0, stream>>>(task, grid, downs);
  }
  if (!task.options.stable_order || task.sums.turns) return;
  const auto with_wide = [&](auto&& start) {
    if constexpr (Kind != SlotKind::fixed_point)
      if (task.output.scalar == Scalar::f32 || task.output.width == Width::pairs)
        return start(std::false_type{});
    start(std::true_type{});
  };
  if (!task.sums.groups) {
    const std::uint32_t bytes = few_bytes(few_quads(task.own_tiles + task.units));
    with_wide([&](auto wide) {
      auto* const kernel = fill_few_kernel<Kind, wide()>;
      cuda_check(cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, bytes),
                 "take shared memory");
      kernel<<<kProcessors, kFewThreads, bytes, stream>>>(task);
    });
  } else if (task.units > 0) {
    launch_beside(number_kernel<false>, {task.sums.all_groups, kFillThreads}, stream, task);
    with_wide([&](auto wide) {
      launch_beside(move_kernel<Kind, wide(), false>, {kMoveBlocks<false> * kProcessors, kFillThreads},
                    stream, task);
    });
  } else {
    with_wide([&](auto wide) {
      fill_kernel<Kind, wide()><<<over(task.own_tiles, kFillTiles), kFillThreads, 0, stream>>>(task);
    });
  }
}

void flow(const Task& task, const Grid& grid, const Downs& downs, int processors, cudaStream_t stream) {
  const std::uint32_t blocks = std::min<std::uint32_t>(
      over(std::uint64_t(downs.warps) + task.own_tiles, kWarps), kProcessors * kFlowBlocks);
  if (task.options.stable_order) {
    constexpr SlotKind kKind = SlotKind::unequal;
    launch_beside(share_kernel<kKind>, shape_of_shares<kKind>(task, processors), stream, task, grid, downs);
    launch_beside(flow_kernel<true>, {blocks, kThreads}, stream, task, grid, downs);
    if (task.sums.eights) {
      const std::uint32_t bytes = eights_of(task) * sizeof(uint2);
      cuda_check(cudaFuncSetAttribute(fill_flow_kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, bytes),
                 "take shared memory");
      launch_beside(fill_flow_kernel, {kProcessors, kFlowFillThreads, bytes}, stream, task);
    } else {
      launch_beside(number_kernel<true>, {task.sums.all_groups, kFillThreads}, stream, task);
      launch_beside(move_kernel<kKind, false, true>, {kMoveBlocks<true> * kProcessors, kFillThreads}, stream,
                    task);
    }
  } else {
    flow_kernel<false><<<blocks, kThreads, 0, stream>>>(task, grid, downs);
  }
  cuda_launched("search for contacts");
}

Way way_of(const Grid& grid, const Downs& downs, std::uint32_t own_tiles) {
  if (grid.levels == 1 && !grid.level[0].hashed) return own_tiles <= kFewTiles ? Way::few : Way::single;
  return downs.count ? Way::down : Way::up;
}

// f(kind, way), both as constants.
template <class F>
void with_way(SlotKind kind, Way way, F f) {
  const auto of_kind = [&](auto k) {
    if (way == Way::few) f(k, std::integral_constant<Way, Way::few>{});
    if (way == Way::single) f(k, std::integral_constant<Way, Way::single>{});
    if (way == Way::down) f(k, std::integral_constant<Way, Way::down>{});
    if (way == Way::up) f(k, std::integral_constant<Way, Way::up>{});
  };
  if (kind == SlotKind::equal) of_kind(std::integral_constant<SlotKind, SlotKind::equal>{});
  if (kind == SlotKind::unequal) of_kind(std::integral_constant<SlotKind, SlotKind::unequal>{});
  if (kind == SlotKind::fixed_point) of_kind(std::integral_constant<SlotKind, SlotKind::fixed_point>{});
}

// Tiles of which each waits for those before it: all must run at once.
bool takes_turns(const Task& task, const Downs& downs, Way way, int processors) {
  const std::uint32_t tiles = task.own_tiles + over(downs.warps, kWarps);
  if (tiles > kMostTurns || way == Way::single) return false;
  unsigned resident = 0;
  with_way(task.spheres.kind, way, [&](auto kind, auto w) {
    resident =
        resident_blocks(reinterpret_cast<const void*>(search_kernel<kind(), w()>), kThreads, 0, processors);
  });
  return tiles <= resident;
}

}  // namespace

Share share_for(const Counters& found, std::uint32_t spheres, const Grid& grid, SlotKind kind) {
  // In steps, so that it seldom changes from call to call, finer where chance changes the count by less; what
  // is expected, 1, is in the middle of one.
  const double steps = found.contacts >> 24 ? 64 : found.contacts >> 22 ? 32 : 16;  // of an octave
  const auto rounded = [&](double mean) {
    return std::exp2((std::floor(steps * std::log2(mean) + 0.5) - 0.5) / steps);
  };
  const std::uint32_t tiles = own_tiles(spheres);
  const Downs downs = plan_downs(grid, kind);
  if (tiles + over(downs.warps, kWarps) <= kMostTurns) return {};
  Share share;
  const double own = static_cast<double>(found.own) / std::max(tiles, 1u),
               of_units = static_cast<double>(found.contacts - found.own);
  if (own >= 1) share.own = static_cast<std::uint32_t>(std::min(rounded(own), 0x1p24));
  if (downs.units && of_units > 0 && found.expected)
    share.unit = static_cast<float>(rounded(std::min(of_units / static_cast<double>(found.expected), 1.0)));
  return share;
}

void search(const Source& source, const Grid& grid, const Ordered& spheres, const SearchOptions& options,
            const Output& output, Counters* counters, SearchMemory& memory, int processors,
            cudaStream_t stream) {
  Task task{source, spheres, output, options, counters};
  task.radius = static_cast<float>(options.radius);
  task.s2 = (task.radius + task.radius) * (task.radius + task.radius);
  task.code_limit = code_limit(grid, spheres.bins, options.radius);
  task.judge_all = source.filtered || !options.owns_all;
  for (int k = 0; k < grid.levels; k++) task.judge_all = task.judge_all || grid.level[k].hashed;
  // Many spheres in float, whose distance alone counts: another kernel.
  Downs downs;
  bool flows = spheres.count >= kFlowSpheres && spheres.float_levels && !task.judge_all &&
               (output.scalar == Scalar::f32 || output.width == Width::pairs);
  if (flows) downs = plan_downs(grid, spheres.kind, true, options.stable_order), flows = downs.count > 0;
  if (!flows) downs = plan_downs(grid, spheres.kind);
  if (spheres.float_levels) downs.bins = level_bins(grid, spheres.kind);
  task.own_tiles = flows ? over(spheres.count, kFlowTile) : own_tiles(spheres.count);
  task.units = downs.units;
  const Way way = way_of(grid, downs, task.own_tiles);
  const std::uint32_t own_groups = over(task.own_tiles, kGroupTiles),
                      all_groups = own_groups + over(task.units, kGroupTiles),
                      share_groups = over(task.units, kShareUnits);
  // Eights are read four at a time, also the last.
  const std::uint64_t words_of_groups =
                          std::max<std::uint64_t>(2 * std::uint64_t(all_groups), eights_of(task) + 3),
                      marks = kGroupsAt + words_of_groups + share_groups;
  if (options.stable_order || downs.warps) {
    const bool fresh = memory.marks.capacity() < marks;
    auto* const p = memory.marks.reserve(marks);
    if (fresh) cuda_check(cudaMemsetAsync(p, 0, marks * 8, stream), "clear the counters");
    if (flows || spheres.count >= kManySpheres) task.next = reinterpret_cast<unsigned int*>(p);
    task.sums.fills = reinterpret_cast<unsigned int*>(p) + 1;
    task.sums.turn = p + 2, task.sums.groups = p + kGroupsAt;
    task.sums.share_sums = task.sums.groups + words_of_groups;
  }
  if (options.stable_order) {
    TileSums& sums = task.sums;
    const std::uint64_t tiles = std::uint64_t(task.own_tiles) + task.units;
    sums.turns = !flows && takes_turns(task, downs, way, processors);
    sums.own_groups = own_groups, sums.all_groups = all_groups;
    const std::uint64_t units = task.units;
    const bool shares = units && (flows || spheres.count >= kManySpheres);  // of few, moving all costs less
    sums.share_groups = shares ? share_groups : 0;
    const std::uint64_t words = (tiles + sums.share_groups + 3) & ~std::uint64_t(1);
    sums.spill = memory.spill.data(), sums.room = memory.spill.data() ? memory.spill.capacity() : 0;
    sums.index_room = units ? sums.room / kSpares + 1 : 0;
    auto* const p = memory.sums.reserve(
        words + (tiles + 8 + (units ? tiles + 2 * units : 0) + sums.index_room + 1) / 2 + 2);
    sums.spill_at = p, sums.bases = p + tiles, sums.all_spares = sums.bases + sums.share_groups + 1;
    sums.counts = reinterpret_cast<std::uint32_t*>(p + words);  // read four or eight at a time, also the last
    sums.firsts = sums.counts + tiles + 8, sums.spares = sums.firsts + units;
    if (units) sums.index = sums.spares + tiles;
    if (shares) sums.shares = sums.index + sums.index_room;
    const std::uint64_t places = static_cast<std::uint64_t>(options.share.own) * own_tiles(spheres.count);
    task.shares.share[0] = options.share.own, task.shares.place[1] = places;
    if (flows) task.shares = tile_shares(grid, places, task.own_tiles);
    // Numbers of 32 bits are enough then.
    sums.eights = flows && eights_of(task) <= kMostEights && sums.room >> 33 == 0 && places >> 31 == 0;
    if (!shares && tiles <= kMostNumbered &&
        (sums.room | options.share.own * std::uint64_t(tiles)) >> 32 == 0)
      sums.groups = nullptr;
  }
  if (flows) return flow(task, grid, downs, processors, stream);
  with_way(spheres.kind, way, [&](auto kind, auto w) {
    if constexpr (w() == Way::down)
      launch<kind(), w()>(task, grid, downs, processors, stream);
    else
      launch<kind(), w()>(task, grid, NoDowns{}, processors, stream);
  });
  cuda_launched("search for contacts");
}

}  // namespace padder::detect::cuda
