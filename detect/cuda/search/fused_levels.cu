// SPDX-License-Identifier: MIT
// The fused search: several dense levels of many float spheres whose distance alone counts. Resident warps
// take tiles and units as long as there are any, and the candidates of both flow through one row of pairs
// (fused_queue.h).
#include "detect/cuda/search/fused_search.h"
#include "detect/cuda/search/fused_work.h"
#include "detect/cuda/search/launch.h"

namespace padder::detect::cuda {
namespace {

template <bool Stable, bool Hashed, bool Given, bool Owned>
__global__ void __launch_bounds__(kTileSpheres, tuning::kFusedBlocks)
    fused_kernel(const __grid_constant__ SearchTask task, const __grid_constant__ Grid grid,
                 const __grid_constant__ LevelPairs pairs) {
  __shared__ FusedMemory memory[kTileWarps];
  __shared__ WorkPlan work;
  if (Stable) allow_next_kernel();
  // Where a flag is set the table is not whole, and the caller will order the spheres in another way.
  if (task.counters->flags) return;
  const bool largest_first =
      task.spheres.count < (Stable ? tuning::kStableLargestFirst : tuning::kLargestFirst);
  plan_work(task, grid, pairs, Stable && largest_first, largest_first, work);
  __syncthreads();
  const std::uint32_t warp = __shfl_sync(kFullWarp, threadIdx.x >> 5, 0), items = work.items;
  FusedSearch<Stable, Hashed, Given, Owned> search(task, grid, pairs, memory[warp]);
  std::uint32_t number = blockIdx.x * kTileWarps + warp;
#pragma unroll 1
  while (number < items) {
    // The number of the next item, loaded long before it is needed.
    std::uint32_t next = 0;
    if (search.lane == 0) next = atomicAdd(task.next, 1u);
    WorkItem item = item_of(work, pairs.count, number, search.lane, round_bits(Stable, largest_first));
    if (largest_first && item.pair < pairs.count) item.pair = pairs.count - 1 - item.pair;
    const bool of_unit = item.pair < pairs.count;
    const LevelPair& d = pairs.pair[of_unit ? item.pair : 0];
    if constexpr (Stable) {
      if (of_unit)
        search.begin_unit(d.first_unit + item.unit);
      else
        search.begin_tile(item.unit);
    }
    if (!of_unit)
      search.begin_spheres(item.unit * task.tile_spheres,
                           min((item.unit + 1) * task.tile_spheres, task.spheres.count));
    if (!of_unit || search.begin_rows(d, item.unit)) search.take_all(of_unit, Stable);
    if (Stable) search.end_producer();
    // The last to find nothing leaves the counter as it was.
    if (search.lane == 0 && next + 1 == items) *task.next = 0;
    number = __shfl_sync(kFullWarp, next, 0) + gridDim.x * kTileWarps;
  }
  if (!Stable) search.finish();
}

}  // namespace

void launch_fused_levels(const SearchTask& task, const Grid& grid, const LevelPairs& pairs, int processors,
                         cudaStream_t stream) {
  const auto blocks =
      static_cast<unsigned>(std::min((std::uint64_t(pairs.warps) + task.tiles + kTileWarps - 1) / kTileWarps,
                                     static_cast<std::uint64_t>(processors) * tuning::kFusedBlocks));
  const auto launch = [&]<bool Stable, bool Given, bool Owned = false>() {
    auto* const kernel = task.spheres.hashed ? fused_kernel<Stable, true, Given, Owned>
                                             : fused_kernel<Stable, false, Given, Owned>;
    if (Stable && task.units) {
      launch_unit_quotas(task, grid, pairs, true, processors, stream);
      launch_overlapped(kernel, {blocks, kTileSpheres}, stream, task, grid, pairs);
    } else {
      kernel<<<blocks, kTileSpheres, 0, stream>>>(task, grid, pairs);
    }
  };
  const bool given = record_kind(task) == RecordKind::from_given || task.spheres.rounded;
  if (task.test_all)
    launch.template operator()<false, false, true>();
  else if (task.stable_order)
    given ? launch.template operator()<true, true>() : launch.template operator()<true, false>();
  else
    given ? launch.template operator()<false, true>() : launch.template operator()<false, false>();
  cuda_launched("search for contacts");
}

}  // namespace padder::detect::cuda
