// SPDX-License-Identifier: MIT
// Puts spheres in the order of their bins, in one of three ways: a counting sort over bins (cells.cu),
// through buckets (buckets.cu), or here by a stable radix sort of keys, which serves crowded bins and
// everything else.
#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_scan.cuh>

#include "detect/cuda/order/order_kernels.h"

namespace padder::detect::cuda {
namespace {

constexpr int kThreads = 256;

template <class Bins, bool Along>
__global__ void __launch_bounds__(kThreads)
    sort_key_kernel(const __grid_constant__ DeviceSpheres source, const __grid_constant__ Bins bins,
                    std::uint32_t* keys, std::uint32_t* ids, unsigned long long* found, Counters* counters) {
  Bounds bounds;
  for (std::uint64_t at = blockIdx.x * kThreads + threadIdx.x; at < source.count;
       at += gridDim.x * kThreads) {
    const auto k = static_cast<std::uint32_t>(at);
    const Sphere s = source.searched(k);
    keys[k] = key_of_sphere(s, bins, counters), ids[k] = k;
    if (Along) bounds.take(s, k);
  }
  if (Along) bounds.give(found);
}
// Writes the end of each bin to the table. A running maximum then turns ends into starts.
template <SlotKind Kind, class Bins>
__global__ void __launch_bounds__(kThreads)
    sort_place_kernel(const __grid_constant__ DeviceSpheres source, const __grid_constant__ Bins bins,
                      const std::uint32_t* keys, const std::uint32_t* ids, int merge, float4* slots,
                      std::uint32_t* codes, std::uint32_t* table) {
  const std::uint32_t p = blockIdx.x * kThreads + threadIdx.x;
  if (p >= source.count) return;
  const std::uint32_t key = keys[p] >> merge;
  const float4 slot = slot_of<Kind>(source, grid_of(bins), ids[p]);
  slots[p] = slot;
  if (codes) codes[p] = code_for<Kind>(bins, keys[p], slot);
  if (p + 1 == source.count || keys[p + 1] >> merge != key) table[key + 1] = p + 1;
}

// Gathers the spheres as they were given. Where a flag is set their numbers mean nothing.
__global__ void __launch_bounds__(kThreads)
    given_kernel(const __grid_constant__ DeviceSpheres source, const __grid_constant__ Ordered o,
                 const Counters* counters) {
  const std::uint32_t p = blockIdx.x * kThreads + threadIdx.x;
  if (p >= o.count || counters->flags) return;
  const std::uint32_t id = o.ids ? o.ids[p] : __float_as_uint(static_cast<const float4*>(o.slots)[p].w);
  const Sphere s = source.sphere(id);
  auto* const to = reinterpret_cast<double2*>(o.given + p);
  to[0] = make_double2(s.x, s.y), to[1] = make_double2(s.z, s.r);
}

// Slots that are rounded or fixed point are not the spheres that doubt and records need. Spheres of one
// radius are fetched from the caller's array, if that takes one piece of memory each: what the tiles of a
// moment need stays in L2, and there is nothing to gather. Others take longer so, with radii of 1:100 by a
// fourth.
bool gathers_given(const OrderRequest& r) {
  if (!r.source.rounded) return r.kind == SlotKind::fixed_point;
  const bool one_piece = r.source.packed || r.source.radius_of_all > 0;
  return r.kind != SlotKind::equal || !one_piece || r.source.placed > 0;
}

}  // namespace

Orderer::Orderer(MemoryBook& book)
    : keys_(book, "the bins"),
      sorted_keys_(book, "the bins"),
      ids_(book, "the bins"),
      sorted_ids_(book, "the bins"),
      codes_(book, "the spheres in the order of their bins"),
      table_(book, "the table of bins"),
      starts_(book, "the table of bins"),
      slots_(book, "the spheres in the order of their bins"),
      split_slots_(book, "the spheres in the order of their bins"),
      given_(book, "the spheres in the order of their bins"),
      scratch_(book, "sorting") {}

Ordered Orderer::order(const OrderRequest& r) {
  const Grid& grid = r.grid;
  const std::uint32_t count = r.source.count;
  OrderMethod method = r.method;
  if (method == OrderMethod::automatic)
    method = count < tuning::kFewSpheres ? OrderMethod::cells : OrderMethod::buckets;
  Ordered o;
  o.kind = r.kind, o.count = count, o.rounded = r.source.rounded;
  o.bins = float_bins(grid, r.kind, count);
  o.float_levels = level_bins(grid, r.kind).on;
  for (int k = 0; k < grid.levels; k++) o.hashed = o.hashed || grid.level[k].hashed;
  // By any method, so that a stable list does not depend on it.
  o.merge = merge_of(grid, o.bins, count);
  o.entries = (keys_of(grid, o.bins) >> o.merge) + 2;
  o.table = table_.reserve(o.entries + 4), o.slots = slots_.reserve(std::uint64_t(o.count) + kSlack);
  o.codes = codes_.reserve(std::uint64_t(o.count) + kSlack);
  clear_for_initcheck(o.codes + count, kSlack, r.stream);
  clear_for_initcheck(slots_.data() + count, kSlack, r.stream);
  if (method == OrderMethod::cells && !by_cells(r, o)) method = OrderMethod::buckets;
  if (method == OrderMethod::buckets && !by_buckets(r, o)) method = OrderMethod::sort;
  if (method == OrderMethod::sort) by_sort(r, o);
  if (r.given && gathers_given(r)) {
    DeviceSpheres source = r.source;
    source.rounded = false;
    o.given = given_.reserve(count);
    given_kernel<<<blocks_for(count, kThreads), kThreads, 0, r.stream>>>(source, o, r.counters);
  }
  cuda_launched("put the spheres in order");
  return o;
}

void Orderer::by_sort(const OrderRequest& r, Ordered& o) {
  const cudaStream_t stream = r.stream;
  if (r.gather.bounds) Surveyor::begin_bounds(r.gather.bounds, stream);
  if (r.gather.octaves) Surveyor::gather_octaves(r.source, r.gather, r.processors, stream);
  std::uint32_t *keys = keys_.reserve(o.count), *ids = ids_.reserve(o.count);
  o.ids = sorted_ids_.reserve(o.count), o.keys = sorted_keys_.reserve(o.count);
  std::size_t sort_bytes = 0, scan_bytes = 0;
  const int end_bit = std::max(bits_for(keys_of(r.grid, o.bins)), 1);
  const std::uint64_t entries = o.entries + 1;
  cuda_check(cub::DeviceRadixSort::SortPairs(nullptr, sort_bytes, keys, o.keys, ids, o.ids, o.count, o.merge,
                                             end_bit, stream),
             "plan the sort");
  cuda_check(cub::DeviceScan::InclusiveScan(nullptr, scan_bytes, o.table, o.table, ::cuda::maximum<>{},
                                            entries, stream),
             "plan the scan");
  void* scratch = scratch_.reserve(std::max(sort_bytes, scan_bytes));
  with_bins(o, r.grid, [&]<class Kind, class Bins>(Kind, const Bins& bins) {
    auto* const kernel = r.gather.bounds ? sort_key_kernel<Bins, true> : sort_key_kernel<Bins, false>;
    const unsigned most = static_cast<unsigned>(r.processors) * 32;
    kernel<<<std::min(blocks_for(o.count, kThreads), most), kThreads, 0, stream>>>(
        r.source, bins, keys, ids, r.gather.bounds, r.counters);
  });
  cuda_check(cub::DeviceRadixSort::SortPairs(scratch, sort_bytes, keys, o.keys, ids, o.ids, o.count, o.merge,
                                             end_bit, stream),
             "sort the spheres by bin");
  cuda_check(cudaMemsetAsync(o.table, 0, entries * 4, stream), "clear the table of bins");
  with_bins(o, r.grid, [&]<class Kind, class Bins>(Kind kind, const Bins& bins) {
    sort_place_kernel<kind(), Bins><<<blocks_for(o.count, kThreads), kThreads, 0, stream>>>(
        r.source, bins, o.keys, o.ids, o.merge, static_cast<float4*>(o.slots), o.codes, o.table);
  });
  cuda_check(cub::DeviceScan::InclusiveScan(scratch, scan_bytes, o.table, o.table, ::cuda::maximum<>{},
                                            entries, stream),
             "find the bins' starts");
}

}  // namespace padder::detect::cuda
