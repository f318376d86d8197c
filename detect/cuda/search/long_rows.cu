// SPDX-License-Identifier: MIT
// The parts of long rows that a search has put on a list: a warp takes one after the other. In any order it
// writes what it finds at once. For a stable order the parts are sorted and their contacts counted, and these
// follow all others in the list.
#include "detect/cuda/search/long_rows.h"

#include <algorithm>
#include <bit>
#include <cub/device/device_radix_sort.cuh>

#include "detect/cuda/device/exclusive_sum.h"
#include "detect/cuda/search/launch.h"
#include "detect/cuda/search/same_level.h"
#include "detect/cuda/search/unit_rows.h"

namespace padder::detect::cuda {
namespace {

enum class PartPass { any_order, count, write };

// Pairs that wait until there are enough for full warps.
struct PartQueue {
  static constexpr std::uint32_t kPairs = 512, kAtOnce = 4, kStep = 32 * kAtOnce;
  uint2 pair[kPairs];
};

// Out of line: it is rare, and would take registers from the loop.
template <SlotKind Kind>
__device__ __noinline__ bool test_part(const SearchTask& task, std::uint32_t i,
                                       const typename SlotOf<Kind>::Type& a, std::uint32_t j, bool counts) {
  std::uint32_t doubtful = 0;
  const bool hit = test<Kind>(task, i, a, j, load_slot(slots_of<Kind>(task) + j), doubtful);
  if (counts) count_doubtful(task, doubtful);
  return hit;
}

// Tests the candidates of a part. take(j, hit) gets one for each lane; after each kStep candidates, done() is
// called. `counts`: are doubtful pairs to be counted?
template <SlotKind Kind, class Take, class Done>
__device__ __forceinline__ void search_part(const SearchTask& task, const Grid& grid, const RowPart& part,
                                            bool counts, Take take, Done done) {
  constexpr int kAtOnce = PartQueue::kAtOnce;
  const auto* const slots = slots_of<Kind>(task);
  auto a = load_slot(slots + part.i);
  if constexpr (Kind == SlotKind::fixed_point)
    if (part.at != RowPart::kOwnLevel)
      a = slot_at<Kind>(task, grid.level[part.at], part.i, sphere_of_slot<Kind>(task, part.i));
#pragma unroll 1
  for (std::uint32_t from = 0; from < part.count; from += PartQueue::kStep) {
    const std::uint32_t k = from + (threadIdx.x & 31);
    typename SlotOf<Kind>::Type b[kAtOnce];
    bool hit[kAtOnce], doubt = false;
#pragma unroll
    for (int u = 0; u < kAtOnce; u++) b[u] = load_slot(slots + part.begin + min(k + 32 * u, part.count - 1));
#pragma unroll
    for (int u = 0; u < kAtOnce; u++) {
      bool sure;
      hit[u] = float_test<Kind>(task, a, b[u], task.spheres.rounded, sure) && k + 32 * u < part.count;
      doubt = doubt || (hit[u] && (!sure || task.test_all));
    }
    if (__any_sync(kFullWarp, doubt)) {
#pragma unroll
      for (int u = 0; u < kAtOnce; u++)
        hit[u] = hit[u] && test_part<Kind>(task, part.i, a, part.begin + k + 32 * u, counts);
    }
#pragma unroll
    for (int u = 0; u < kAtOnce; u++) take(part.begin + k + 32 * u, hit[u]);
    done();
  }
}

template <SlotKind Kind, PartPass Pass>
__global__ void __launch_bounds__(kTileSpheres, tuning::kLongRowBlocks)
    long_rows_kernel(const __grid_constant__ SearchTask task, const __grid_constant__ Grid grid) {
  constexpr bool kCounts = Pass == PartPass::count;
  __shared__ PartQueue memory[kCounts ? 1 : kTileWarps];
  const LongRows& rows = task.long_rows;
  Counters* const counters = task.counters;
  const Word parts = counters->long_rows;
  // Where a flag is set the table was not whole.
  if (counters->flags || parts > rows.room) return;
  const std::uint32_t warp = __shfl_sync(kFullWarp, threadIdx.x >> 5, 0), lane = threadIdx.x & 31,
                      below = (1u << lane) - 1;
  const WidePairQueue queue{shared_address(memory[kCounts ? 0 : warp].pair)};
  Word total = 0, slot = 0;
  std::uint32_t waiting = 0;
  const auto write = [&] {
    __syncwarp();
    const OutputRange to =
        Pass == PartPass::write ? OutputRange{slot, 0, ~0u, 0, 0} : reserve_for_warp(task, waiting);
    // Beyond the capacity they are counted alone, and the caller searches again.
    if (to.slot + waiting <= task.output.capacity) emit_queue<Kind>(task, queue, waiting, to, 0);
    __syncwarp();
    slot += waiting, waiting = 0;
  };
#pragma unroll 1
  for (Word p = blockIdx.x * kTileWarps + warp; p < parts; p += gridDim.x * kTileWarps) {
    const RowPart part = load_part(rows, p);
    if (Pass == PartPass::write) slot = counters->contacts - counters->deferred + __ldcg(rows.before + p);
    search_part<Kind>(
        task, grid, part, Pass != PartPass::write,
        [&](std::uint32_t j, bool hit) {
          const std::uint32_t has = __ballot_sync(kFullWarp, hit);
          if (!kCounts && hit) queue.put(waiting + __popc(has & below), {part.i, j});
          waiting += __popc(has);
        },
        [&] {
          if (!kCounts && waiting + PartQueue::kStep > PartQueue::kPairs) write();
        });
    if (kCounts) {
      if (lane == 0) rows.found[p] = waiting;
      total += waiting, waiting = 0;
    }
    if (Pass == PartPass::write && waiting) write();
  }
  if (Pass == PartPass::any_order && waiting) write();
  if (kCounts && lane == 0 && total)
    atomicAdd(&counters->deferred, total), atomicAdd(&counters->contacts, total);
}

// What follows the parts stands behind them when they are sorted.
__global__ void pad_keys_kernel(const __grid_constant__ LongRows rows, const Counters* counters) {
  const Word step = std::uint64_t(gridDim.x) * blockDim.x;
  for (Word p = counters->long_rows + blockIdx.x * blockDim.x + threadIdx.x; p < rows.room; p += step)
    rows.key[p] = ~Word(0);
}

template <PartPass Pass>
void launch(const SearchTask& task, const Grid& grid, int processors, cudaStream_t stream) {
  with_kind(task.spheres.kind, [&](auto kind) {
    const auto blocks = static_cast<unsigned>(processors) * tuning::kLongRowBlocks;
    long_rows_kernel<kind(), Pass><<<blocks, kTileSpheres, 0, stream>>>(task, grid);
  });
  cuda_launched("search for contacts");
}

}  // namespace

LongRows lay_out_long_rows(SearchMemory& memory, std::uint64_t room, std::uint32_t spheres, bool stable,
                           cudaStream_t stream) {
  LongRows rows;
  rows.room = room, rows.index_bits = static_cast<int>(std::bit_width(spheres));
  Word* const words = memory.long_rows.reserve((stable ? 6 : 2) * room);
  rows.key = words, rows.value = words + room;
  if (!stable) return rows;
  rows.sorted = words + 2 * room, rows.before = words + 4 * room;
  rows.found = reinterpret_cast<std::uint32_t*>(words + 5 * room);
  clear_for_initcheck(rows.value, room, stream);
  clear_for_initcheck(rows.found, room, stream);
  return rows;
}

void search_long_rows(SearchTask& task, const Grid& grid, SearchMemory& memory, int processors,
                      cudaStream_t stream) {
  if (!task.stable_order) return launch<PartPass::any_order>(task, grid, processors, stream);
  LongRows& rows = task.long_rows;
  pad_keys_kernel<<<static_cast<unsigned>(std::min<std::uint64_t>(rows.room / kTileSpheres + 1, 1024)),
                    kTileSpheres, 0, stream>>>(rows, task.counters);
  cuda_launched("search for contacts");
  std::size_t bytes = 0;
  const auto sort = [&](void* room) {
    cuda_check(
        cub::DeviceRadixSort::SortPairs(room, bytes, rows.key, rows.sorted, rows.value,
                                        rows.sorted + rows.room, rows.room, 0, 2 * rows.index_bits, stream),
        "sort the list of long rows");
  };
  sort(nullptr);
  sort(memory.scratch.reserve(bytes));
  rows.key = rows.sorted, rows.value = rows.sorted + rows.room;
  launch<PartPass::count>(task, grid, processors, stream);
  exclusive_sum(rows.found, rows.before, rows.room, memory.scratch, stream);
  launch<PartPass::write>(task, grid, processors, stream);
}

}  // namespace padder::detect::cuda
