// A counting sort over bins; counts live in L2. Fewest launches: for small scenes.
#include "detect/cuda_order.h"

namespace padder::detect::cuda {
namespace {

constexpr int kThreads = 256, kScan = 1024, kScanItems = 4, kScanTile = kScan * kScanItems;
using Word = unsigned long long;

// Sets to zero the table and the sums of its parts.
__global__ void __launch_bounds__(kThreads)
    cell_clear_kernel(std::uint32_t* table, std::uint32_t entries, Word* sums, std::uint32_t parts) {
  follow();
  const std::uint32_t k = blockIdx.x * kThreads + threadIdx.x;
  if (4 * k < entries) reinterpret_cast<uint4*>(table)[k] = make_uint4(0, 0, 0, 0);
  if (k < parts) sums[k] = 0;
}

template <class Bins, bool Along>
__global__ void __launch_bounds__(kThreads)
    cell_count_kernel(const __grid_constant__ Source source, const __grid_constant__ Bins bins, int merge,
                      std::uint32_t* keys, std::uint32_t* ranks, std::uint32_t* counts, Word* found,
                      Counters* counters) {
  follow();
  const std::uint32_t k = blockIdx.x * kThreads + threadIdx.x;
  const bool valid = k < source.count;
  std::uint32_t key = ~0u;
  Bounds bounds;
  if (valid) {
    const Sphere s = source.sphere(k);
    key = key_of_sphere(s, bins, counters);
    if (Along) bounds.take(s, k);
  }
  const std::uint32_t rank = ticket(counts, valid ? key >> merge : ~0u);
  if (valid) {
    ranks[k] = rank;
    if (!kKeyless<Bins>) keys[k] = key;
  }
  if (Along) bounds.give(found);
}

// Exclusive sums of the table in one launch: a block publishes the sum of its part and adds up those of all
// parts before it, which are few and were begun before it.
__global__ void __launch_bounds__(kScan)
    cell_scan_kernel(std::uint32_t* table, std::uint32_t entries, Word* sums) {
  constexpr Word kKnown = Word(1) << 32;
  follow();
  __shared__ std::uint32_t warp_sums[32], shared_before;
  const std::uint32_t lane = threadIdx.x & 31, warp = threadIdx.x >> 5,
                      at = (blockIdx.x * kScan + threadIdx.x) * kScanItems;
  if (threadIdx.x == 0) shared_before = 0;
  uint4 v = at < entries ? *reinterpret_cast<const uint4*>(table + at) : make_uint4(0, 0, 0, 0);
  std::uint32_t total, before = sum_before(v.x + v.y + v.z + v.w, total);
  if (lane == 0) warp_sums[warp] = total;
  __syncthreads();
  const std::uint32_t mine = warp_sums[lane];
  before += __reduce_add_sync(~0u, lane < warp ? mine : 0);
  if (warp == 0) {
    const std::uint32_t all = __reduce_add_sync(~0u, mine);
    if (lane == 0) atomicExch(sums + blockIdx.x, kKnown | all);
  }
  std::uint32_t earlier = 0;
  for (std::uint32_t part = threadIdx.x; part < blockIdx.x; part += kScan) {
    Word sum;
    while (!((sum = *static_cast<volatile Word*>(sums + part)) & kKnown)) {
    }
    earlier += static_cast<std::uint32_t>(sum);
  }
  earlier = __reduce_add_sync(~0u, earlier);
  if (lane == 0 && earlier) atomicAdd(&shared_before, earlier);
  __syncthreads();
  before += shared_before;
  if (at < entries)
    *reinterpret_cast<uint4*>(table + at) =
        make_uint4(before, before + v.x, before + v.x + v.y, before + v.x + v.y + v.z);
}

template <SlotKind Kind, class Bins>
__global__ void __launch_bounds__(kThreads)
    cell_place_kernel(const __grid_constant__ Source source, const __grid_constant__ Bins bins, int merge,
                      const std::uint32_t* keys, const std::uint32_t* ranks, const std::uint32_t* table,
                      Places out) {
  follow();
  const std::uint32_t k = blockIdx.x * kThreads + threadIdx.x;
  if (k >= source.count) return;
  const float4 slot = slot_of<Kind>(source, grid_of(bins), k);
  std::uint32_t key;
  if constexpr (kKeyless<Bins>)
    key_of(bins, slot.x, slot.y, slot.z, key);
  else
    key = keys[k];
  const std::uint32_t at = table[key >> merge] + ranks[k];
  static_cast<float4*>(out.slots)[at] = slot;
  if (!kKeyless<Bins>) out.keys[at] = key;
  if (Kind != SlotKind::equal) out.ids[at] = k;
}

// Spheres of a bin by their number. Bins are small; a crowded one is reported and the caller sorts instead.
template <SlotKind Kind, bool Keyless>
__global__ void __launch_bounds__(kThreads)
    cell_tidy_kernel(std::uint32_t entries, const std::uint32_t* table, Places out, Counters* counters) {
  follow();
  const std::uint32_t b = blockIdx.x * kThreads + threadIdx.x;
  if (b >= entries) return;
  const std::uint32_t from = table[b], to = table[b + 1];
  if (to - from < 2) return;
  if (to - from > 64) {
    atomicOr(&counters->flags, kCrowded);
    return;
  }
  auto* slots = static_cast<float4*>(out.slots);
  const auto id = [&](std::uint32_t p) {
    return Kind == SlotKind::equal ? __float_as_uint(slots[p].w) : out.ids[p];
  };
  for (std::uint32_t i = from + 1; i < to; i++) {
    const float4 slot = slots[i];
    const std::uint32_t mine = Kind == SlotKind::equal ? __float_as_uint(slot.w) : out.ids[i],
                        key = Keyless ? 0 : out.keys[i];
    std::uint32_t j = i;
    for (; j > from && id(j - 1) > mine; j--) {
      slots[j] = slots[j - 1];
      if (!Keyless) out.keys[j] = out.keys[j - 1];
      if (Kind != SlotKind::equal) out.ids[j] = out.ids[j - 1];
    }
    slots[j] = slot;
    if (!Keyless) out.keys[j] = key;
    if (Kind != SlotKind::equal) out.ids[j] = mine;
  }
}

std::uint32_t scan_parts(std::uint64_t entries) { return blocks_for(entries, kScanTile); }

}  // namespace

std::uint64_t cell_sums(std::uint64_t entries) { return scan_parts(entries); }

void order_by_cells(const Source& source, const Grid& grid, const CellPlan& plan, unsigned long long* bounds,
                    Counters* counters, const Ordered& o, cudaStream_t stream) {
  const auto entries = static_cast<std::uint32_t>(o.entries + 1);
  const unsigned blocks = blocks_for(o.count, kThreads);
  launch(cell_clear_kernel, {blocks_for((entries + 3) / 4, kThreads), kThreads}, stream, o.table, entries,
         plan.sums, scan_parts(entries));
  with_bins(o, grid, [&]<class Kind, class Bins>(Kind kind, const Bins& bins) {
    launch(bounds ? cell_count_kernel<Bins, true> : cell_count_kernel<Bins, false>, {blocks, kThreads},
           stream, source, bins, o.merge, plan.keys, plan.ranks, o.table, bounds, counters);
    launch(cell_scan_kernel, {scan_parts(entries), kScan}, stream, o.table, entries, plan.sums);
    const Places out{o.slots, o.ids, o.keys};
    launch(cell_place_kernel<kind(), Bins>, {blocks, kThreads}, stream, source, bins, o.merge, plan.keys,
           plan.ranks, o.table, out);
    if (plan.tidy)
      launch(cell_tidy_kernel<kind(), kKeyless<Bins>>, {blocks_for(o.entries, kThreads), kThreads}, stream,
             static_cast<std::uint32_t>(o.entries), o.table, out, counters);
  });
}

}  // namespace padder::detect::cuda
