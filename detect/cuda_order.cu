// Spheres into the order of their bins, in one of three ways:
//   cells    a counting sort over bins; counts live in L2. Fewest launches: for small scenes.
//   buckets  two passes over the spheres: into some thousand buckets of consecutive bins, through shared
//   memory so that
//            what goes to one bucket is written together; then each bucket, which fits shared memory, is put
//            in order and its part of the table written. No sphere is gathered from a random place.
//   sort     a stable radix sort of keys: for hashed levels, crowded bins, everything else.
#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_scan.cuh>

#include "detect/cuda_search.h"

namespace padder::detect::cuda {
namespace {

constexpr int kThreads = 256, kWide = 1024, kItems = 8, kCount = 512;
constexpr std::uint32_t kMostBuckets = 6144, kSharedBytes = 227 * 1024;
unsigned blocks_for(std::uint64_t n, int threads = kThreads) {
  return static_cast<unsigned>((n + threads - 1) / threads);
}

// Where spheres are put; ids is null where the slot holds the number.
struct Places {
  void* slots = nullptr;
  std::uint32_t* ids = nullptr;
  std::uint32_t* keys = nullptr;
};

// Bucket of a table entry: entries first_entry(b) to first_entry(b + 1) - 1 are of bucket b. Each level has
// buckets of its own width, for the levels' bins are not equally full.
struct Buckets {
  std::uint32_t count = 0, entries = 1, widest = 1;
  int merge = 0, levels = 1;
  struct Part {
    std::uint32_t entry = 0, bucket = 0, magic = 1;  // its first ones; 2^32 / width
  } part[kMaxLevels];
  __device__ __forceinline__ std::uint32_t of(std::uint32_t key) const {
    const std::uint32_t entry = key >> merge;
    int k = 0;
    while (k + 1 < levels && entry >= part[k + 1].entry) k++;
    return part[k].bucket + __umulhi(entry - part[k].entry, part[k].magic);
  }
  __device__ __forceinline__ std::uint32_t first_entry(std::uint32_t b) const {
    int k = 0;
    while (k + 1 < levels && b >= part[k + 1].bucket) k++;
    const std::uint64_t magic = part[k].magic,
                        first = ((static_cast<std::uint64_t>(b - part[k].bucket) << 32) + magic - 1) / magic;
    return static_cast<std::uint32_t>(min(part[k].entry + first, std::uint64_t(entries)));
  }
};

template <SlotKind Kind>
__device__ __forceinline__ float4 slot_of(const Source& source, const Grid& grid, std::uint32_t id) {
  if (Kind != SlotKind::fixed && source.packed) {
    float4 s = __ldg(static_cast<const float4*>(source.centers) + id);
    if (Kind == SlotKind::equal) s.w = __uint_as_float(id);
    return s;
  }
  const Sphere s = source.sphere(id);
  if constexpr (Kind == SlotKind::fixed) {
    const FixedSlot f = fixed_slot(grid.level[level_of(grid, s)], s);
    return make_float4(__int_as_float(f.x), __int_as_float(f.y), __int_as_float(f.z), f.r);
  } else {
    const FloatSlot f = float_slot(s);
    return make_float4(f.x, f.y, f.z, Kind == SlotKind::equal ? __uint_as_float(id) : f.r);
  }
}
// The grid may be that of the call before, kept in the hope that it still fits (backend_cuda.cu): a sphere
// outside it is reported, and gets a key that does no harm.
__device__ __forceinline__ std::uint32_t key_of_sphere(const Sphere& s, const Grid& grid,
                                                       Counters* counters) {
  const Level& l = grid.level[level_of(grid, s)];
  const Bin b = bin_of(l, s);
  if (!l.hashed && !(static_cast<std::uint64_t>(b.x - l.first[0]) < l.count[0] &&
                     static_cast<std::uint64_t>(b.y - l.first[1]) < l.count[1] &&
                     static_cast<std::uint64_t>(b.z - l.first[2]) < l.count[2])) {
    atomicOr(&counters->flags, kOutside);
    return 0;
  }
  return key_of(l, b);
}

// Adds one to count[b] for each lane with b != ~0 and returns the count before. Neighbouring lanes of one
// bucket, as in coherent input, share one atomic operation.
__device__ __forceinline__ std::uint32_t ticket(std::uint32_t* count, std::uint32_t b) {
  const int lane = threadIdx.x & 31;
  const std::uint32_t left = __shfl_up_sync(~0u, b, 1);
  const std::uint32_t heads = __ballot_sync(~0u, lane == 0 || left != b);
  const int head = 31 - __clz(heads & (~0u >> (31 - lane)));
  const std::uint32_t after = lane == 31 ? 0 : heads & (~1u << lane);
  std::uint32_t at = 0;
  if (head == lane && b != ~0u) at = atomicAdd(count + b, (after ? __ffs(after) - 1 : 32) - lane);
  return __shfl_sync(~0u, at, head) + lane - head;
}

// Exclusive sums of v[0 .. n) in shared memory by the whole block; v[n] becomes the total. `sums` has 32
// entries.
__device__ void scan_shared(std::uint32_t* v, std::uint32_t n, std::uint32_t* sums) {
  const std::uint32_t lane = threadIdx.x & 31, warp = threadIdx.x >> 5, warps = blockDim.x >> 5;
  // Each warp scans a contiguous part, 32 entries a step: no bank conflicts.
  const std::uint32_t part = ((n + warps - 1) / warps + 31) & ~31u, from = min(warp * part, n),
                      to = min(from + part, n);
  std::uint32_t sum = 0;
  for (std::uint32_t k = from + lane; k < to; k += 32) sum += v[k];
  sum = __reduce_add_sync(~0u, sum);
  if (lane == 0) sums[warp] = sum;
  __syncthreads();
  std::uint32_t before = 0;
  for (std::uint32_t w = 0; w < warp; w++) before += sums[w];
  for (std::uint32_t k = from; k < to; k += 32) {
    const std::uint32_t c = k + lane < to ? v[k + lane] : 0;
    std::uint32_t upto = c;
#pragma unroll
    for (int d = 1; d < 32; d <<= 1) {
      const std::uint32_t u = __shfl_up_sync(~0u, upto, d);
      if (static_cast<int>(lane) >= d) upto += u;
    }
    if (k + lane < to) v[k + lane] = before + upto - c;
    before += __shfl_sync(~0u, upto, 31);
  }
  if (warp + 1 == warps && lane == 0) v[n] = before;
  __syncthreads();
}

// ---- cells

template <bool Along>
__global__ void __launch_bounds__(kThreads)
    cell_count_kernel(Source source, const __grid_constant__ Grid grid, int merge, std::uint32_t* keys,
                      std::uint32_t* ranks, std::uint32_t* counts, unsigned long long* found,
                      Counters* counters) {
  const std::uint32_t k = blockIdx.x * kThreads + threadIdx.x;
  const bool valid = k < source.count;
  std::uint32_t key = ~0u;
  Bounds bounds;
  if (valid) {
    const Sphere s = source.sphere(k);
    key = key_of_sphere(s, grid, counters);
    if (Along) bounds.take(s, k);
  }
  if (Along) bounds.give(found);
  const std::uint32_t rank = ticket(counts, valid ? key >> merge : ~0u);
  if (valid) keys[k] = key, ranks[k] = rank;
}
template <SlotKind Kind>
__global__ void __launch_bounds__(kThreads)
    cell_place_kernel(Source source, const __grid_constant__ Grid grid, int merge, const std::uint32_t* keys,
                      const std::uint32_t* ranks, const std::uint32_t* table, Places out) {
  const std::uint32_t k = blockIdx.x * kThreads + threadIdx.x;
  if (k >= source.count) return;
  const std::uint32_t key = keys[k], at = table[key >> merge] + ranks[k];
  static_cast<float4*>(out.slots)[at] = slot_of<Kind>(source, grid, k);
  out.keys[at] = key;
  if (Kind != SlotKind::equal) out.ids[at] = k;
}
// Spheres of a bin by their number. Bins are small; a crowded one is reported and the caller sorts instead.
template <SlotKind Kind>
__global__ void __launch_bounds__(kThreads)
    cell_tidy_kernel(std::uint32_t entries, const std::uint32_t* table, Places out, Counters* counters) {
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
    const std::uint32_t mine = id(i), key = out.keys[i];
    std::uint32_t j = i;
    for (; j > from && id(j - 1) > mine; j--) {
      slots[j] = slots[j - 1], out.keys[j] = out.keys[j - 1];
      if (Kind != SlotKind::equal) out.ids[j] = out.ids[j - 1];
    }
    slots[j] = slot, out.keys[j] = key;
    if (Kind != SlotKind::equal) out.ids[j] = mine;
  }
}

// ---- buckets

template <bool Along>
__global__ void __launch_bounds__(kCount, 4)
    bucket_count_kernel(Source source, const __grid_constant__ Grid grid,
                        const __grid_constant__ Buckets buckets, std::uint32_t* keys, std::uint32_t* counts,
                        unsigned long long* found, Counters* counters) {
  Bounds bounds;
  extern __shared__ std::uint32_t shared[];
  for (std::uint32_t b = threadIdx.x; b < buckets.count; b += kCount) shared[b] = 0;
  __syncthreads();
  const std::uint64_t step = static_cast<std::uint64_t>(gridDim.x) * kCount;
  for (std::uint64_t from = static_cast<std::uint64_t>(blockIdx.x) * kCount; from < source.count;
       from += step) {
    const std::uint64_t k = from + threadIdx.x;
    const bool valid = k < source.count;
    std::uint32_t key = 0;
    if (valid) {
      const Sphere s = source.sphere(static_cast<std::uint32_t>(k));
      keys[k] = key = key_of_sphere(s, grid, counters);
      if (Along) bounds.take(s, static_cast<std::uint32_t>(k));
    }
    ticket(shared, valid ? buckets.of(key) : ~0u);
  }
  if (Along) bounds.give(found);
  __syncthreads();
  for (std::uint32_t b = threadIdx.x; b < buckets.count; b += kCount)
    if (shared[b]) atomicAdd(counts + b, shared[b]);
}
__global__ void __launch_bounds__(kWide) bucket_start_kernel(const __grid_constant__ Buckets buckets,
                                                             std::uint32_t* starts, std::uint32_t* cursors) {
  __shared__ std::uint32_t v[kMostBuckets + 1], sums[32];
  for (std::uint32_t b = threadIdx.x; b < buckets.count; b += kWide) v[b] = starts[b];
  __syncthreads();
  scan_shared(v, buckets.count, sums);
  for (std::uint32_t b = threadIdx.x; b <= buckets.count; b += kWide) {
    starts[b] = v[b];
    if (b < buckets.count) cursors[b] = v[b];
  }
}
// One tile of spheres a block: ordered by bucket in shared memory, then written, each bucket's share to one
// place.
template <SlotKind Kind>
__global__ void __launch_bounds__(kWide)
    bucket_split_kernel(Source source, const __grid_constant__ Grid grid,
                        const __grid_constant__ Buckets buckets, const std::uint32_t* keys,
                        std::uint32_t* cursors, Places out) {
  constexpr std::uint32_t kTile = kWide * kItems;
  extern __shared__ float4 slots[];
  auto* tile_keys = reinterpret_cast<std::uint32_t*>(slots + kTile);
  auto* counts = tile_keys + kTile;
  auto* shift = counts + buckets.count + 1;
  __shared__ std::uint32_t sums[32];
  for (std::uint32_t b = threadIdx.x; b < buckets.count; b += kWide) counts[b] = 0;
  __syncthreads();
  const std::uint64_t first = static_cast<std::uint64_t>(blockIdx.x) * kTile;
  const auto count =
      static_cast<std::uint32_t>(min(static_cast<std::uint64_t>(source.count) - first, std::uint64_t(kTile)));
  std::uint32_t key[kItems], rank[kItems];
#pragma unroll
  for (int u = 0; u < kItems; u++) {
    const std::uint32_t k = threadIdx.x + u * kWide;
    key[u] = k < count ? keys[first + k] : 0;
  }
#pragma unroll
  for (int u = 0; u < kItems; u++)
    rank[u] = ticket(counts, threadIdx.x + u * kWide < count ? buckets.of(key[u]) : ~0u);
  __syncthreads();
  for (std::uint32_t b = threadIdx.x; b < buckets.count; b += kWide)
    if (counts[b]) shift[b] = atomicAdd(cursors + b, counts[b]);
  __syncthreads();
  scan_shared(counts, buckets.count, sums);
#pragma unroll
  for (int u = 0; u < kItems; u++) {
    const std::uint32_t k = threadIdx.x + u * kWide;
    if (k >= count) break;
    const std::uint32_t at = counts[buckets.of(key[u])] + rank[u];
    float4 s = slot_of<Kind>(source, grid, static_cast<std::uint32_t>(first + k));
    slots[at] = s, tile_keys[at] = key[u];
    if (Kind != SlotKind::equal) rank[u] = at;
  }
  // The numbers take the place of the keys' ranks: they are staged in a second round, through the same
  // memory.
  __syncthreads();
  for (std::uint32_t s = threadIdx.x; s < count; s += kWide) {
    const std::uint32_t b = buckets.of(tile_keys[s]), to = shift[b] - counts[b] + s;
    static_cast<float4*>(out.slots)[to] = slots[s];
    out.keys[to] = tile_keys[s];
  }
  if (Kind == SlotKind::equal) return;
  __syncthreads();
  auto* numbers = reinterpret_cast<std::uint32_t*>(slots);
#pragma unroll
  for (int u = 0; u < kItems; u++) {
    const std::uint32_t k = threadIdx.x + u * kWide;
    if (k < count) numbers[rank[u]] = static_cast<std::uint32_t>(first + k);
  }
  __syncthreads();
  for (std::uint32_t s = threadIdx.x; s < count; s += kWide) {
    const std::uint32_t b = buckets.of(tile_keys[s]);
    out.ids[shift[b] - counts[b] + s] = numbers[s];
  }
}
// One bucket a block: its spheres by bin, within a bin by number if `tidy`, and its part of the table.
template <SlotKind Kind>
__global__ void __launch_bounds__(kWide)
    bucket_order_kernel(const __grid_constant__ Buckets buckets, std::uint32_t capacity,
                        const std::uint32_t* starts, Places in, Places out, std::uint32_t* table, bool tidy,
                        Counters* counters) {
  extern __shared__ float4 slots[];
  auto* tile_keys = reinterpret_cast<std::uint32_t*>(slots + capacity);
  auto* numbers = tile_keys + capacity;
  auto* bins = Kind == SlotKind::equal ? numbers : numbers + capacity;
  __shared__ std::uint32_t sums[32];
  const std::uint32_t begin = starts[blockIdx.x], count = starts[blockIdx.x + 1] - begin;
  const std::uint32_t first = buckets.first_entry(blockIdx.x),
                      width = buckets.first_entry(blockIdx.x + 1) - first;
  if (count > capacity) {
    if (threadIdx.x == 0) atomicOr(&counters->flags, kCrowded);
    return;
  }
  for (std::uint32_t b = threadIdx.x; b < width; b += blockDim.x) bins[b] = 0;
  __syncthreads();
  constexpr int kMost = 10;
  std::uint32_t key[kMost], rank[kMost];
#pragma unroll
  for (int u = 0; u < kMost; u++) {
    const std::uint32_t k = threadIdx.x + u * kWide;
    if (k < count) key[u] = in.keys[begin + k];
  }
#pragma unroll
  for (int u = 0; u < kMost; u++)
    if (threadIdx.x + u * kWide < count) rank[u] = atomicAdd(bins + (key[u] >> buckets.merge) - first, 1u);
  __syncthreads();
  scan_shared(bins, width, sums);
  for (std::uint32_t b = threadIdx.x; b < width; b += blockDim.x) table[first + b] = begin + bins[b];
  if (blockIdx.x + 1 == gridDim.x && threadIdx.x == 0)
    table[first + width] = begin + count;  // the end of all
#pragma unroll
  for (int u = 0; u < kMost; u++) {
    const std::uint32_t k = threadIdx.x + u * kWide;
    if (k >= count) break;
    const std::uint32_t at = bins[(key[u] >> buckets.merge) - first] + rank[u];
    slots[at] = static_cast<const float4*>(in.slots)[begin + k], tile_keys[at] = key[u];
    if (Kind != SlotKind::equal) numbers[at] = in.ids[begin + k];
  }
  __syncthreads();
  const auto number = [&](std::uint32_t s) {
    return Kind == SlotKind::equal ? __float_as_uint(slots[s].w) : numbers[s];
  };
  for (std::uint32_t s = threadIdx.x; s < count; s += blockDim.x) {
    std::uint32_t to = s;
    if (tidy) {
      const std::uint32_t b = (tile_keys[s] >> buckets.merge) - first, from = bins[b], end = bins[b + 1],
                          mine = number(s);
      to = from;
      for (std::uint32_t q = from; q < end; q++) to += number(q) < mine;
    }
    static_cast<float4*>(out.slots)[begin + to] = slots[s];
    out.keys[begin + to] = tile_keys[s];
    if (Kind != SlotKind::equal) out.ids[begin + to] = numbers[s];
  }
}

// ---- sort

template <bool Along>
__global__ void __launch_bounds__(kThreads)
    sort_key_kernel(Source source, const __grid_constant__ Grid grid, std::uint32_t* keys, std::uint32_t* ids,
                    unsigned long long* found, Counters* counters) {
  Bounds bounds;
  for (std::uint64_t at = blockIdx.x * kThreads + threadIdx.x; at < source.count;
       at += gridDim.x * kThreads) {
    const auto k = static_cast<std::uint32_t>(at);
    const Sphere s = source.sphere(k);
    keys[k] = key_of_sphere(s, grid, counters), ids[k] = k;
    if (Along) bounds.take(s, k);
  }
  if (Along) bounds.give(found);
}
// Ends of bins go to the table; a running maximum turns them into starts.
template <SlotKind Kind>
__global__ void __launch_bounds__(kThreads)
    sort_place_kernel(Source source, const __grid_constant__ Grid grid, const std::uint32_t* keys,
                      const std::uint32_t* ids, int merge, float4* slots, std::uint32_t* table) {
  const std::uint32_t p = blockIdx.x * kThreads + threadIdx.x;
  if (p >= source.count) return;
  const std::uint32_t key = keys[p] >> merge;
  slots[p] = slot_of<Kind>(source, grid, ids[p]);
  if (p + 1 == source.count || keys[p + 1] >> merge != key) table[key + 1] = p + 1;
}

template <class F>
void with_kind(SlotKind kind, F f) {
  if (kind == SlotKind::equal) f(std::integral_constant<SlotKind, SlotKind::equal>{});
  if (kind == SlotKind::unequal) f(std::integral_constant<SlotKind, SlotKind::unequal>{});
  if (kind == SlotKind::fixed) f(std::integral_constant<SlotKind, SlotKind::fixed>{});
}

}  // namespace

Orderer::Orderer(MemoryBook& book)
    : keys_(book, "the bins"),
      sorted_keys_(book, "the bins"),
      ids_(book, "the bins"),
      sorted_ids_(book, "the bins"),
      table_(book, "the table of bins"),
      starts_(book, "the table of bins"),
      slots_(book, "the spheres in the order of their bins"),
      split_slots_(book, "the spheres in the order of their bins"),
      scratch_(book, "sorting") {}

Ordered Orderer::order(const Source& source, const Grid& grid, SlotKind kind, bool tidy, OrderMethod method,
                       unsigned long long* bounds, Counters* counters, cudaStream_t stream) {
  const bool single = grid.levels == 1 && !grid.level[0].hashed;
  bool dense = true;
  for (int k = 0; k < grid.levels; k++) dense = dense && !grid.level[k].hashed;
  if (method == OrderMethod::automatic)
    method = !dense                       ? OrderMethod::sort
             : source.count < kFewSpheres ? OrderMethod::cells
                                          : OrderMethod::buckets;
  Ordered o;
  o.kind = kind, o.count = source.count, o.grid_entries = grid.buckets;
  // Where bins are many and nearly empty, several along x share an entry of the table. Not in rows so short
  // that an entry could hold bins of two rows that both hold partners of one sphere.
  if (single && method != OrderMethod::sort && grid.level[0].count[0] >= 32)
    while (o.merge < 3 && (static_cast<double>(grid.buckets) / (2 << o.merge)) > 0.75 * source.count)
      o.merge++;
  o.entries = (grid.buckets >> o.merge) + 2;
  o.table = table_.reserve(o.entries + 1), o.slots = slots_.reserve(std::uint64_t(o.count) + kSlack);
  o.keys = sorted_keys_.reserve(o.count);
  if (method == OrderMethod::buckets && !by_buckets(source, grid, tidy, bounds, counters, o, stream))
    method = OrderMethod::sort;
  if (method == OrderMethod::cells) by_cells(source, grid, tidy, bounds, counters, o, stream);
  if (method == OrderMethod::sort) by_sort(source, grid, bounds, counters, o, stream);
  cuda_launched("put the spheres in order");
  return o;
}

void Orderer::by_cells(const Source& source, const Grid& grid, bool tidy, unsigned long long* bounds,
                       Counters* counters, Ordered& o, cudaStream_t stream) {
  std::uint32_t *keys = keys_.reserve(o.count), *ranks = ids_.reserve(o.count);
  if (o.kind != SlotKind::equal) o.ids = sorted_ids_.reserve(o.count);
  std::size_t bytes = 0;
  cuda_check(cub::DeviceScan::ExclusiveSum(nullptr, bytes, o.table, o.table, o.entries + 1, stream),
             "plan the scan");
  void* scratch = scratch_.reserve(bytes);
  cuda_check(cudaMemsetAsync(o.table, 0, (o.entries + 1) * 4, stream), "clear the table of bins");
  (bounds ? cell_count_kernel<true> : cell_count_kernel<false>)<<<blocks_for(o.count), kThreads, 0, stream>>>(
      source, grid, o.merge, keys, ranks, o.table, bounds, counters);
  cuda_check(cub::DeviceScan::ExclusiveSum(scratch, bytes, o.table, o.table, o.entries + 1, stream),
             "scan the table of bins");
  with_kind(o.kind, [&](auto k) {
    const Places out{o.slots, o.ids, o.keys};
    cell_place_kernel<k()>
        <<<blocks_for(o.count), kThreads, 0, stream>>>(source, grid, o.merge, keys, ranks, o.table, out);
    if (tidy)
      cell_tidy_kernel<k()>
          <<<blocks_for(o.entries), kThreads, 0, stream>>>(o.entries, o.table, out, counters);
  });
}

bool Orderer::by_buckets(const Source& source, const Grid& grid, bool tidy, unsigned long long* bounds,
                         Counters* counters, Ordered& o, cudaStream_t stream) {
  const std::uint32_t sphere_bytes = o.kind == SlotKind::equal ? 20 : 24;
  // As many buckets as give each about `bucket_spheres` on average, and no more entries than leave room.
  const double aim = bucket_spheres;
  const std::uint32_t room = aim <= 4096 ? 112 * 1024 : kSharedBytes - 1024;
  const double widest = (room - aim * 1.12 * sphere_bytes) / 4 - 4;
  if (widest < 64) return false;
  Buckets b;
  b.merge = o.merge, b.levels = grid.levels, b.entries = static_cast<std::uint32_t>(o.entries);
  for (int k = 0; k < grid.levels; k++) {
    Buckets::Part& part = b.part[k];
    part.entry = k ? grid.level[k].offset : 0, part.bucket = b.count;
    const std::uint32_t entries = (k + 1 < grid.levels ? grid.level[k + 1].offset : b.entries) - part.entry;
    const double spheres = static_cast<double>(std::max<std::uint64_t>(grid.level[k].spheres, 1)),
                 width = std::floor(std::clamp(aim * entries / spheres, 2.0, widest - 1));
    part.magic = static_cast<std::uint32_t>(std::ceil(4294967296.0 / width));
    b.widest = std::max(b.widest, static_cast<std::uint32_t>(width) + 2);
    b.count += static_cast<std::uint32_t>((std::uint64_t(entries - 1) * part.magic) >> 32) + 1;
  }
  const std::uint32_t table_bytes = (b.widest + 1) * 4,
                      tile_bytes = kWide * kItems * 20 + (2 * b.count + 1) * 4;
  if (b.count > kMostBuckets || tile_bytes > kSharedBytes - 1024) return false;
  const std::uint32_t capacity =
      std::min<std::uint32_t>((room - table_bytes) / sphere_bytes, 10 * kWide) & ~3u;
  // Work space in the list of contacts, which is written afterwards.
  const bool lent = lent_slots_ >= o.count && lent_words_ >= 2 * std::uint64_t(o.count);
  std::uint32_t* keys = lent ? lent_word_ : keys_.reserve(o.count);
  std::uint32_t* split_keys = lent ? lent_word_ + o.count : ids_.reserve(o.count);
  float4* split_slots = lent ? lent_slot_ : split_slots_.reserve(o.count);
  std::uint32_t *starts = starts_.reserve(2 * kMostBuckets + 2), *cursors = starts + kMostBuckets + 1;
  std::uint32_t* split_ids = nullptr;
  if (o.kind != SlotKind::equal)
    o.ids = sorted_ids_.reserve(2 * std::uint64_t(o.count)), split_ids = o.ids + o.count;
  const Places split{split_slots, split_ids, split_keys}, out{o.slots, o.ids, o.keys};
  cuda_check(cudaMemsetAsync(starts, 0, (b.count + 1) * 4, stream), "clear the buckets");
  (bounds ? bucket_count_kernel<true> : bucket_count_kernel<false>)<<<132 * 4, kCount, b.count * 4, stream>>>(
      source, grid, b, keys, starts, bounds, counters);
  bucket_start_kernel<<<1, kWide, 0, stream>>>(b, starts, cursors);
  with_kind(o.kind, [&](auto k) {
    auto* divide = bucket_split_kernel<k()>;
    auto* arrange = bucket_order_kernel<k()>;
    const std::uint32_t order_bytes = capacity * sphere_bytes + table_bytes;
    cuda_check(cudaFuncSetAttribute(divide, cudaFuncAttributeMaxDynamicSharedMemorySize, kSharedBytes - 1024),
               "take shared memory");
    cuda_check(
        cudaFuncSetAttribute(arrange, cudaFuncAttributeMaxDynamicSharedMemorySize, kSharedBytes - 1024),
        "take shared memory");
    divide<<<blocks_for(o.count, kWide * kItems), kWide, tile_bytes, stream>>>(source, grid, b, keys, cursors,
                                                                               split);
    arrange<<<b.count, kWide, order_bytes, stream>>>(b, capacity, starts, split, out, o.table, tidy,
                                                     counters);
  });
  return true;
}

void Orderer::by_sort(const Source& source, const Grid& grid, unsigned long long* bounds, Counters* counters,
                      Ordered& o, cudaStream_t stream) {
  std::uint32_t *keys = keys_.reserve(o.count), *ids = ids_.reserve(o.count);
  o.ids = sorted_ids_.reserve(o.count);
  std::size_t sort_bytes = 0, scan_bytes = 0;
  const int end_bit = std::max(bits_for(grid.buckets), 1);
  const std::uint64_t entries = o.entries + 1;
  cuda_check(cub::DeviceRadixSort::SortPairs(nullptr, sort_bytes, keys, o.keys, ids, o.ids, o.count, o.merge,
                                             end_bit, stream),
             "plan the sort");
  cuda_check(cub::DeviceScan::InclusiveScan(nullptr, scan_bytes, o.table, o.table, ::cuda::maximum<>{},
                                            entries, stream),
             "plan the scan");
  void* scratch = scratch_.reserve(std::max(sort_bytes, scan_bytes));
  (bounds ? sort_key_kernel<true>
          : sort_key_kernel<false>)<<<std::min(blocks_for(o.count), 132u * 32), kThreads, 0, stream>>>(
      source, grid, keys, ids, bounds, counters);
  cuda_check(cub::DeviceRadixSort::SortPairs(scratch, sort_bytes, keys, o.keys, ids, o.ids, o.count, o.merge,
                                             end_bit, stream),
             "sort the spheres by bin");
  cuda_check(cudaMemsetAsync(o.table, 0, entries * 4, stream), "clear the table of bins");
  with_kind(o.kind, [&](auto k) {
    sort_place_kernel<k()><<<blocks_for(o.count), kThreads, 0, stream>>>(
        source, grid, o.keys, o.ids, o.merge, static_cast<float4*>(o.slots), o.table);
  });
  cuda_check(cub::DeviceScan::InclusiveScan(scratch, scan_bytes, o.table, o.table, ::cuda::maximum<>{},
                                            entries, stream),
             "find the bins' starts");
}

}  // namespace padder::detect::cuda
