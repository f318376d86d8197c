// SPDX-License-Identifier: MIT
// One level of dense bins: a block of threads takes a tile of spheres.
#include <algorithm>

#include "detect/cuda/device/device.h"
#include "detect/cuda/search/launch.h"
#include "detect/cuda/search/same_level.h"
#include "detect/cuda/search/tile_search.h"
#include "detect/cuda/tuning.h"

namespace padder::detect::cuda {
namespace {

// Rounded: slots are doubles rounded to float. The other kernels need not ask.
template <SlotKind Kind, bool Rounded>
struct OneLevel {
  using Pairs = NoLevelPairs;
  using Queue = PairWords<tuning::kSameLevelQueue>;
  using State = char;
  static __device__ __forceinline__ bool find(const SearchTask& task, const Grid& grid, const Pairs& pairs,
                                              Queue& queue, State&, std::uint32_t number, std::uint32_t warp,
                                              std::uint32_t flags, std::uint32_t& found) {
    const std::uint32_t first = (number * kTileWarps + warp) * 32;
    return first >= task.spheres.count ||
           find_same_level<Kind, Rounded>(task, grid, pairs, queue, first, flags, found);
  }
  static __device__ __forceinline__ void emit(const SearchTask& task, const Grid& grid, const Pairs& pairs,
                                              Queue& queue, State&, std::uint32_t number, std::uint32_t warp,
                                              std::uint32_t found, const OutputRange& range,
                                              std::uint32_t before) {
    emit_same_level<Kind>(task, grid, pairs, queue, (number * kTileWarps + warp) * 32, found, range, before);
  }
};

template <SlotKind Kind, bool Few, bool Rounded>
__global__ void __launch_bounds__(kTileSpheres, Few ? tuning::kFewTilesBlocks : tuning::kOneLevelBlocks)
    one_level_kernel(const __grid_constant__ SearchTask task, const __grid_constant__ Grid grid,
                     const __grid_constant__ NoLevelPairs pairs) {
  using Family = OneLevel<Kind, Rounded>;
  __shared__ TileMemory<Family> memory;
  const bool ordered = Few && task.stable.ordered;
  if (ordered && threadIdx.x == 0) memory.search_number = ordered_search_number(task);
  // Where a flag is set the table is not whole, and the caller will order the spheres in another way. Of many
  // tiles the flags are looked at later, when there is something else to wait for, too.
  const std::uint32_t flags = task.counters->flags;
  if (Few && flags) return;
  search_tile<Family>(task, grid, pairs, memory, kept_in_register(blockIdx.x), ordered, flags);
}

// Calls f with the kernel.
template <SlotKind Kind, class F>
void with_kernel(KernelFamily family, bool rounded, F f) {
  constexpr bool kMay = Kind != SlotKind::fixed_point;
  if (family == KernelFamily::few_tiles)
    f(kMay && rounded ? one_level_kernel<Kind, true, kMay> : one_level_kernel<Kind, true, false>);
  else
    f(kMay && rounded ? one_level_kernel<Kind, false, kMay> : one_level_kernel<Kind, false, false>);
}

}  // namespace

unsigned resident_one_level(KernelFamily family, SlotKind kind, int processors) {
  unsigned blocks = ~0u;
  with_kind(kind, [&](auto k) {
    for (const bool rounded : {false, true})
      with_kernel<k()>(family, rounded, [&](auto* kernel) {
        blocks = std::min(
            blocks, resident_blocks(reinterpret_cast<const void*>(kernel), kTileSpheres, 0, processors));
      });
  });
  return blocks;
}

void launch_one_level(const SearchTask& task, const Grid& grid, KernelFamily family, cudaStream_t stream) {
  with_kind(task.spheres.kind, [&](auto kind) {
    with_kernel<kind()>(family, task.spheres.rounded, [&](auto* kernel) {
      kernel<<<task.tiles, kTileSpheres, 0, stream>>>(task, grid, {});
    });
  });
  cuda_launched("search for contacts");
}

}  // namespace padder::detect::cuda
