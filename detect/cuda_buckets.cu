// Two passes over the spheres: into some thousand buckets of consecutive bins, through shared memory so that
// what goes to one bucket is written together; then each bucket, which fits shared memory, is put in order
// and its part of the table written. No sphere is gathered from a random place.
#include "detect/cuda_order.h"

namespace padder::detect::cuda {
namespace {

constexpr int kWide = 1024, kItems = 8, kMost = 10, kCount = 512, kProcessors = 132;
constexpr std::uint32_t kMostBuckets = 6144, kSharedBytes = 226 * 1024, kTile = kWide * kItems;

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

template <class Bins, bool Along>
__global__ void __launch_bounds__(kCount, 4)
    bucket_count_kernel(const __grid_constant__ Source source, const __grid_constant__ Bins bins,
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
      key = key_of_sphere(s, bins, counters);
      if (!kKeyless<Bins>) keys[k] = key;
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
  scan_shared(v, buckets.count, sums);
  for (std::uint32_t b = threadIdx.x; b <= buckets.count; b += kWide) {
    starts[b] = v[b];
    if (b < buckets.count) cursors[b] = v[b];
  }
}

// Tiles of spheres, one after the other: ordered by bucket in shared memory, then written, each bucket's
// share to one place. The next tile is read while this one is written.
template <SlotKind Kind, class Bins>
__global__ void __launch_bounds__(kWide)
    bucket_split_kernel(const __grid_constant__ Source source, const __grid_constant__ Bins bins,
                        const __grid_constant__ Buckets buckets, const std::uint32_t* keys,
                        std::uint32_t* cursors, Places out) {
  constexpr int kShare = kMostBuckets / kWide;
  extern __shared__ float4 slots[];
  auto* bucket_at = reinterpret_cast<std::uint16_t*>(slots + kTile);
  auto* counts = reinterpret_cast<std::uint32_t*>(bucket_at + kTile);
  auto* shift = counts + buckets.count + 1;
  __shared__ std::uint32_t sums[32];
  const auto tiles = static_cast<std::uint32_t>((std::uint64_t(source.count) + kTile - 1) / kTile);
  const auto count_of = [&](std::uint32_t tile) {
    return static_cast<std::uint32_t>(
        min(std::uint64_t(source.count) - std::uint64_t(tile) * kTile, std::uint64_t(kTile)));
  };
  float4 slot[kItems];
  const auto read = [&](std::uint32_t tile) {
    const std::uint32_t count = count_of(tile), first = tile * kTile;
#pragma unroll
    for (int u = 0; u < kItems; u++) {
      const std::uint32_t k = threadIdx.x + u * kWide;
      if (k < count) slot[u] = slot_of<Kind>(source, grid_of(bins), first + k);
    }
  };
  for (std::uint32_t b = threadIdx.x; b < buckets.count; b += kWide) counts[b] = 0;
  if (blockIdx.x < tiles) read(blockIdx.x);
  __syncthreads();
  for (std::uint32_t tile = blockIdx.x; tile < tiles; tile += gridDim.x) {
    const std::uint32_t count = count_of(tile), first = tile * kTile;
    std::uint32_t place[kItems];  // bucket and rank in it; then the place in the tile
#pragma unroll
    for (int u = 0; u < kItems; u++) {
      const std::uint32_t k = threadIdx.x + u * kWide;
      std::uint32_t bucket = ~0u, key = 0;
      if (k < count) {
        if constexpr (kKeyless<Bins>)
          key_of(bins, slot[u].x, slot[u].y, slot[u].z, key);
        else
          key = keys[first + k];
        bucket = buckets.of(key);
      }
      place[u] = ticket(counts, bucket) | bucket << 16;
    }
    __syncthreads();
    std::uint32_t taken[kShare];
#pragma unroll
    for (int u = 0; u < kShare; u++) {
      const std::uint32_t b = threadIdx.x + u * kWide, c = b < buckets.count ? counts[b] : 0;
      taken[u] = c ? atomicAdd(cursors + b, c) : 0;
    }
    scan_shared(counts, buckets.count, sums);
#pragma unroll
    for (int u = 0; u < kShare; u++) {
      const std::uint32_t b = threadIdx.x + u * kWide;
      if (b < buckets.count) shift[b] = taken[u] - counts[b];
    }
#pragma unroll
    for (int u = 0; u < kItems; u++) {
      if (threadIdx.x + u * kWide >= count) break;
      const std::uint32_t bucket = place[u] >> 16;
      place[u] = counts[bucket] + (place[u] & 0xffff);
      slots[place[u]] = slot[u], bucket_at[place[u]] = static_cast<std::uint16_t>(bucket);
    }
    __syncthreads();
    if (tile + gridDim.x < tiles) read(tile + gridDim.x);
    for (std::uint32_t b = threadIdx.x; b < buckets.count; b += kWide) counts[b] = 0;
    for (std::uint32_t s = threadIdx.x; s < count; s += kWide)
      static_cast<float4*>(out.slots)[shift[bucket_at[s]] + s] = slots[s];
    __syncthreads();
    // What does not fit the slot is staged in a second round, through the same memory.
    if (Kind != SlotKind::equal || !kKeyless<Bins>) {
      auto *numbers = reinterpret_cast<std::uint32_t*>(slots), *tile_keys = numbers + kTile;
#pragma unroll
      for (int u = 0; u < kItems; u++) {
        const std::uint32_t k = threadIdx.x + u * kWide;
        if (k >= count) break;
        if (Kind != SlotKind::equal) numbers[place[u]] = first + k;
        if (!kKeyless<Bins>) tile_keys[place[u]] = keys[first + k];
      }
      __syncthreads();
      for (std::uint32_t s = threadIdx.x; s < count; s += kWide) {
        const std::uint32_t to = shift[bucket_at[s]] + s;
        if (Kind != SlotKind::equal) out.ids[to] = numbers[s];
        if (!kKeyless<Bins>) out.keys[to] = tile_keys[s];
      }
      __syncthreads();
    }
  }
}

// One bucket a block: its spheres by bin, within a bin by number if `tidy`, and its part of the table.
template <SlotKind Kind, class Bins>
__global__ void __launch_bounds__(kWide)
    bucket_order_kernel(const __grid_constant__ Bins grid_bins, const __grid_constant__ Buckets buckets,
                        std::uint32_t capacity, const std::uint32_t* starts, Places in, Places out,
                        std::uint32_t* table, bool tidy, Counters* counters) {
  constexpr bool kIds = Kind != SlotKind::equal, kKeys = !kKeyless<Bins>;
  extern __shared__ float4 slots[];
  auto* tile_keys = reinterpret_cast<std::uint32_t*>(slots + capacity);
  auto* numbers = kKeys ? tile_keys + capacity : tile_keys;
  auto* bins = kIds ? numbers + capacity : numbers;
  __shared__ std::uint32_t sums[32];
  const std::uint32_t begin = starts[blockIdx.x], count = starts[blockIdx.x + 1] - begin;
  const std::uint32_t first = buckets.first_entry(blockIdx.x),
                      width = buckets.first_entry(blockIdx.x + 1) - first;
  if (count > capacity) {
    if (threadIdx.x == 0) atomicOr(&counters->flags, kCrowded);
    return;
  }
  const auto bin_of_key = [&](std::uint32_t key) { return (key >> buckets.merge) - first; };
  const auto bin_of_slot = [&](const float4& s) {
    std::uint32_t key = 0;
    if constexpr (!kKeys) key_of(grid_bins, s.x, s.y, s.z, key);
    return bin_of_key(key);
  };
  float4 slot[kMost];
  std::uint32_t place[kMost];  // bin and rank in it
#pragma unroll
  for (int u = 0; u < kMost; u++) {
    const std::uint32_t k = threadIdx.x + u * kWide;
    if (k < count) {
      if (kKeys) place[u] = in.keys[begin + k];
      slot[u] = static_cast<const float4*>(in.slots)[begin + k];
    }
  }
  for (std::uint32_t b = threadIdx.x; b < width; b += blockDim.x) bins[b] = 0;
  __syncthreads();
#pragma unroll
  for (int u = 0; u < kMost; u++) {
    if (threadIdx.x + u * kWide >= count) break;
    const std::uint32_t bin = kKeys ? bin_of_key(place[u]) : bin_of_slot(slot[u]);
    place[u] = atomicAdd(bins + bin, 1u) | bin << 16;
  }
  scan_shared(bins, width, sums);
  for (std::uint32_t b = threadIdx.x; b < width; b += blockDim.x) table[first + b] = begin + bins[b];
  if (blockIdx.x + 1 == gridDim.x && threadIdx.x == 0)
    table[first + width] = begin + count;  // the end of all
#pragma unroll
  for (int u = 0; u < kMost; u++) {
    const std::uint32_t k = threadIdx.x + u * kWide;
    if (k >= count) break;
    const std::uint32_t at = bins[place[u] >> 16] + (place[u] & 0xffff);
    slots[at] = slot[u];
    if (kKeys) tile_keys[at] = in.keys[begin + k];
    if (kIds) numbers[at] = in.ids[begin + k];
  }
  __syncthreads();
  const auto number = [&](std::uint32_t s) { return kIds ? numbers[s] : __float_as_uint(slots[s].w); };
  for (std::uint32_t s = threadIdx.x; s < count; s += blockDim.x) {
    std::uint32_t to = s;
    const float4 mine = slots[s];
    if (tidy) {
      const std::uint32_t b = kKeys ? bin_of_key(tile_keys[s]) : bin_of_slot(mine), from = bins[b],
                          end = bins[b + 1], own = kIds ? numbers[s] : __float_as_uint(mine.w);
      to = from;
      for (std::uint32_t q = from; q < end; q++) to += number(q) < own;
    }
    static_cast<float4*>(out.slots)[begin + to] = mine;
    if (kKeys) out.keys[begin + to] = tile_keys[s];
    if (kIds) out.ids[begin + to] = numbers[s];
  }
}

template <class Kernel>
void let_take_shared(Kernel* kernel) {
  cuda_check(cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, kSharedBytes),
             "take shared memory");
}

}  // namespace

bool Orderer::by_buckets(const Source& source, const Grid& grid, bool tidy, unsigned long long* bounds,
                         Counters* counters, Ordered& o, cudaStream_t stream) {
  const bool ids = o.kind != SlotKind::equal, keyed = !o.bins.on;
  const std::uint32_t sphere_bytes = 16 + (ids ? 4 : 0) + (keyed ? 4 : 0);
  // As many buckets as give each about `bucket_spheres` on average, and no more entries than leave room, nor
  // than 16 bits can number.
  const double aim = bucket_spheres,
               widest = std::min((kSharedBytes - aim * 1.12 * sphere_bytes) / 4 - 4, 65535.0);
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
  const std::uint32_t table_bytes = (b.widest + 1) * 4, tile_bytes = kTile * 18 + (2 * b.count + 1) * 4;
  if (b.count > kMostBuckets || tile_bytes > kSharedBytes) return false;
  const std::uint32_t capacity =
      std::min<std::uint32_t>((kSharedBytes - table_bytes) / sphere_bytes, kMost * kWide) & ~3u;
  // Work space in the list of contacts, which is written afterwards.
  const std::uint64_t words = keyed ? 2 * std::uint64_t(o.count) : 0;
  const bool lent = lent_slots_ >= o.count && lent_words_ >= words;
  std::uint32_t *keys = nullptr, *split_keys = nullptr, *split_ids = nullptr;
  if (keyed)
    keys = lent ? lent_word_ : keys_.reserve(o.count),
    split_keys = lent ? lent_word_ + o.count : ids_.reserve(o.count);
  float4* split_slots = lent ? lent_slot_ : split_slots_.reserve(o.count);
  std::uint32_t *starts = starts_.reserve(2 * kMostBuckets + 2), *cursors = starts + kMostBuckets + 1;
  if (ids) o.ids = sorted_ids_.reserve(2 * std::uint64_t(o.count)), split_ids = o.ids + o.count;
  const Places split{split_slots, split_ids, split_keys}, out{o.slots, o.ids, o.keys};
  cuda_check(cudaMemsetAsync(starts, 0, (b.count + 1) * 4, stream), "clear the buckets");
  with_bins(o, grid, [&]<class Kind, class Bins>(Kind kind, const Bins& bins) {
    (bounds ? bucket_count_kernel<Bins, true>
            : bucket_count_kernel<Bins, false>)<<<kProcessors * 4, kCount, b.count * 4, stream>>>(
        source, bins, b, keys, starts, bounds, counters);
    bucket_start_kernel<<<1, kWide, 0, stream>>>(b, starts, cursors);
    auto* divide = bucket_split_kernel<kind(), Bins>;
    auto* arrange = bucket_order_kernel<kind(), Bins>;
    let_take_shared(divide), let_take_shared(arrange);
    divide<<<std::min<unsigned>(blocks_for(o.count, kTile), kProcessors), kWide, tile_bytes, stream>>>(
        source, bins, b, keys, cursors, split);
    arrange<<<b.count, kWide, capacity * sphere_bytes + table_bytes, stream>>>(
        bins, b, capacity, starts, split, out, o.table, tidy, counters);
  });
  return true;
}

}  // namespace padder::detect::cuda
