// Spheres into the order of their bins.
#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_scan.cuh>

#include "detect/cuda_search.h"

namespace padder::detect::cuda {
namespace {

constexpr int kThreads = 256;
unsigned blocks_for(std::uint64_t n) { return static_cast<unsigned>((n + kThreads - 1) / kThreads); }

__global__ void __launch_bounds__(kThreads)
    key_kernel(Source source, const __grid_constant__ Grid grid, std::uint32_t* keys, std::uint32_t* ids) {
  const std::uint32_t k = blockIdx.x * kThreads + threadIdx.x;
  if (k >= source.count) return;
  const Sphere s = source.sphere(k);
  const Level& l = grid.level[level_of(grid, s)];
  keys[k] = key_of(l, bin_of(l, s)), ids[k] = k;
}

template <SlotKind Kind>
__device__ __forceinline__ void put_slot(const Source& source, const Grid& grid, std::uint32_t id, void* slots,
                                         std::uint32_t at) {
  const Sphere s = source.sphere(id);
  if constexpr (Kind == SlotKind::fixed) {
    static_cast<FixedSlot*>(slots)[at] = fixed_slot(grid.level[level_of(grid, s)], s);
  } else {
    FloatSlot slot = float_slot(s);
    if constexpr (Kind == SlotKind::equal) slot.r = __uint_as_float(id);
    static_cast<FloatSlot*>(slots)[at] = slot;
  }
}

template <SlotKind Kind>
__global__ void __launch_bounds__(kThreads)
    arrange_kernel(Source source, const __grid_constant__ Grid grid, const std::uint32_t* keys, const std::uint32_t* ids,
                   int merge, void* slots, std::uint32_t* table) {
  const std::uint32_t p = blockIdx.x * kThreads + threadIdx.x;
  if (p >= source.count) return;
  const std::uint32_t key = keys[p] >> merge;
  put_slot<Kind>(source, grid, ids[p], slots, p);
  if (p + 1 == source.count || keys[p + 1] >> merge != key) table[key + 1] = p + 1;
}

}  // namespace

Orderer::Orderer(MemoryBook& book)
    : keys_(book, "the bins"),
      sorted_keys_(book, "the bins"),
      ids_(book, "the bins"),
      sorted_ids_(book, "the bins"),
      table_(book, "the table of bins"),
      slots_(book, "the spheres in the order of their bins"),
      scratch_(book, "sorting") {}

Ordered Orderer::order(const Source& source, const Grid& grid, SlotKind kind, cudaStream_t stream) {
  const std::uint32_t n = source.count;
  Ordered o;
  o.kind = kind, o.count = n, o.merge = 0;
  const std::uint64_t entries = (std::uint64_t(grid.buckets) >> o.merge) + 2;
  std::uint32_t *keys = keys_.reserve(n), *ids = ids_.reserve(n);
  o.keys = sorted_keys_.reserve(n), o.ids = sorted_ids_.reserve(n);
  o.table = table_.reserve(entries), o.slots = slots_.reserve(n + kSlack);
  std::size_t sort_bytes = 0, scan_bytes = 0;
  const int end_bit = std::max(bits_for(grid.buckets), 1);
  cuda_check(cub::DeviceRadixSort::SortPairs(nullptr, sort_bytes, keys, o.keys, ids, o.ids, n, 0, end_bit, stream),
             "plan the sort");
  cuda_check(cub::DeviceScan::InclusiveScan(nullptr, scan_bytes, o.table, o.table, ::cuda::maximum<>{}, entries, stream),
             "plan the scan");
  void* scratch = scratch_.reserve(std::max(sort_bytes, scan_bytes));
  key_kernel<<<blocks_for(n), kThreads, 0, stream>>>(source, grid, keys, ids);
  cuda_check(cub::DeviceRadixSort::SortPairs(scratch, sort_bytes, keys, o.keys, ids, o.ids, n, 0, end_bit, stream),
             "sort the spheres by bin");
  cuda_check(cudaMemsetAsync(o.table, 0, entries * sizeof(std::uint32_t), stream), "clear the table of bins");
  if (kind == SlotKind::equal)
    arrange_kernel<SlotKind::equal><<<blocks_for(n), kThreads, 0, stream>>>(source, grid, o.keys, o.ids, o.merge, o.slots, o.table);
  else if (kind == SlotKind::unequal)
    arrange_kernel<SlotKind::unequal><<<blocks_for(n), kThreads, 0, stream>>>(source, grid, o.keys, o.ids, o.merge, o.slots, o.table);
  else
    arrange_kernel<SlotKind::fixed><<<blocks_for(n), kThreads, 0, stream>>>(source, grid, o.keys, o.ids, o.merge, o.slots, o.table);
  cuda_launched("put the spheres in order");
  cuda_check(cub::DeviceScan::InclusiveScan(scratch, scan_bytes, o.table, o.table, ::cuda::maximum<>{}, entries, stream),
             "find the bins' starts");
  return o;
}

}  // namespace padder::detect::cuda
