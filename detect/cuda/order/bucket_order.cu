// SPDX-License-Identifier: MIT
// Puts the spheres of each bucket, which fits shared memory, in the order of their bins, and writes its part
// of the table.
#include "detect/cuda/order/buckets.h"

namespace padder::detect::cuda {
namespace {

// The bucket that a block puts in order. Shared memory holds the slots, then (where the kind needs them) the
// keys, the numbers of the spheres, the bins' counts and the bounds of each octave.
template <SlotKind Kind, class Bins>
struct Bucket {
  static constexpr bool kIds = Kind != SlotKind::equal, kKeys = !kKeyless<Bins>;
  float4* slots;
  std::uint32_t *keys, *numbers, *bins;
  std::uint32_t begin, count, first_entry;
  int merge;

  __device__ __forceinline__ std::uint32_t bin_of_key(std::uint32_t key) const {
    return (key >> merge) - first_entry;
  }
  template <class LevelOfBins>
  __device__ __forceinline__ std::uint32_t bin_of_slot(const LevelOfBins& bins_here, const float4& s) const {
    std::uint32_t key = 0;
    if constexpr (!kKeys) key_of(bins_here, s, key);
    return bin_of_key(key);
  }
  __device__ __forceinline__ std::uint32_t number(std::uint32_t s) const {
    return kIds ? numbers[s] : __float_as_uint(slots[s].w);
  }
  // Where the sphere at `s` belongs when the spheres of a bin stand by number: its rank is how many of its
  // bin have a smaller one.
  template <class LevelOfBins>
  __device__ __forceinline__ std::uint32_t stable_place(const LevelOfBins& bins_here, std::uint32_t s,
                                                        const float4& mine) const {
    const std::uint32_t b = kKeys ? bin_of_key(keys[s]) : bin_of_slot(bins_here, mine), end = bins[b + 1],
                        own = number(s);
    std::uint32_t to = bins[b];
    // Four at a time: one after the other, the thread would wait for each.
    for (std::uint32_t q = to; q < end; q += 4) {
#pragma unroll
      for (std::uint32_t v = 0; v < 4; v++)
        if (q + v < end && q + v != s) to += number(q + v) < own;
    }
    return to;
  }
};

// Reads the bucket, counts its bins, writes their starts to the table, and puts the spheres in the order of
// bins in shared memory. Ends without a barrier.
template <SlotKind Kind, class Bins, int Threads, class LevelOfBins>
__device__ __forceinline__ void sort_in_shared(const Bucket<Kind, Bins>& b, const LevelOfBins& bins_here,
                                               const Places& in, std::uint32_t from, std::uint32_t width,
                                               OctaveBounds* octaves, std::uint32_t* table,
                                               std::uint32_t* sums) {
  constexpr bool kIds = Bucket<Kind, Bins>::kIds, kKeys = Bucket<Kind, Bins>::kKeys;
  float4 slot[kMostBucketItems];
  std::uint32_t place[kMostBucketItems];  // bin and rank in it; then the place in the bucket
#pragma unroll
  for (int u = 0; u < kMostBucketItems; u++) {
    const std::uint32_t k = threadIdx.x + u * Threads;
    if (k < b.count) {
      if (kKeys) place[u] = in.keys[from + k];
      slot[u] = static_cast<const float4*>(in.slots)[from + k];
    }
  }
  for (std::uint32_t k = threadIdx.x; k < width; k += blockDim.x) b.bins[k] = 0;
  if (octaves) octaves->begin();
  __syncthreads();
#pragma unroll
  for (int u = 0; u < kMostBucketItems; u++) {
    if (threadIdx.x + u * Threads >= b.count) break;
    const std::uint32_t bin = kKeys ? b.bin_of_key(place[u]) : b.bin_of_slot(bins_here, slot[u]);
    place[u] = atomicAdd(b.bins + bin, 1u) | bin << 16;
  }
  scan_shared(b.bins, width, sums);
  for (std::uint32_t k = threadIdx.x; k < width; k += blockDim.x)
    table[b.first_entry + k] = b.begin + b.bins[k];
  if (blockIdx.x + 1 == gridDim.x && threadIdx.x == 0)
    table[b.first_entry + width] = b.begin + b.count;  // the end of all
#pragma unroll
  for (int u = 0; u < kMostBucketItems; u++) {
    const std::uint32_t k = threadIdx.x + u * Threads;
    if (k >= b.count) break;
    place[u] = b.bins[place[u] >> 16] + (place[u] & 0xffff);
    b.slots[place[u]] = slot[u];
    if (kKeys) b.keys[place[u]] = in.keys[from + k];
  }
  // All numbers are asked for at once, in the registers that held the slots.
  if constexpr (kIds) {
    std::uint32_t id[kMostBucketItems];
#pragma unroll
    for (int u = 0; u < kMostBucketItems; u++)
      if (threadIdx.x + u * Threads < b.count) id[u] = in.ids[from + threadIdx.x + u * Threads];
#pragma unroll
    for (int u = 0; u < kMostBucketItems; u++)
      if (threadIdx.x + u * Threads < b.count) b.numbers[place[u]] = id[u];
  }
}

// One bucket a block. Blocks half as wide are two a processor, so that one reads while the other counts.
// Kept: buckets lie in the rooms that they had in the previous call, and bounds are gathered here.
template <SlotKind Kind, class Bins, int Threads, bool Kept>
__global__ void __launch_bounds__(Threads, kWideBlock / Threads)
    bucket_order_kernel(const __grid_constant__ Bins grid_bins, const __grid_constant__ Buckets buckets,
                        std::uint32_t capacity, const __grid_constant__ Starts where, Places in, Places out,
                        std::uint32_t* table, bool stable, const __grid_constant__ Gather gather,
                        float radius, Counters* counters) {
  using Here = Bucket<Kind, Bins>;
  constexpr bool kIds = Here::kIds, kKeys = Here::kKeys;
  extern __shared__ float4 slots[];
  auto* bucket_keys = reinterpret_cast<std::uint32_t*>(slots + capacity);
  auto* numbers = kKeys ? bucket_keys + capacity : bucket_keys;
  auto* bins = kIds ? numbers + capacity : numbers;
  __shared__ std::uint32_t sums[32];
  const std::uint32_t begin = where.bucket[blockIdx.x], count = where.bucket[blockIdx.x + 1] - begin,
                      from = Kept ? where.room[blockIdx.x] : begin;
  const auto& bins_here = bins_of_level(grid_bins, buckets.level_of(blockIdx.x));
  const std::uint32_t first = buckets.first_entry(blockIdx.x),
                      width = buckets.first_entry(blockIdx.x + 1) - first;
  // Spheres are not where they should be. What the split has set is the same for all threads; kCrowded is
  // not: another block may set it meanwhile.
  if (Kept && counters->flags & (kOutside | kOutgrown)) return;
  if (count > capacity) {
    if (threadIdx.x == 0) atomicOr(&counters->flags, kCrowded);
    return;
  }
  const Here b{slots, bucket_keys, numbers, bins, begin, count, first, buckets.merge};
  auto& octaves = *reinterpret_cast<OctaveBounds*>(bins + ((width + 4) & ~3u));
  const bool by_octave = Kept && kIds && gather.octaves;
  sort_in_shared<Kind, Bins, Threads>(b, bins_here, in, from, width, by_octave ? &octaves : nullptr, table,
                                      sums);
  __syncthreads();
  Bounds bounds;
  OctaveTaker taker;
  if (by_octave) taker.begin(gather.top, slots[min(threadIdx.x, count - 1)], threadIdx.x < count);
  for (std::uint32_t s = threadIdx.x; s < count; s += blockDim.x) {
    const float4 mine = slots[s];
    const std::uint32_t to = stable ? b.stable_place(bins_here, s, mine) : s;
    if (Kept && gather.bounds)
      bounds.take_quickly(mine.x, mine.y, mine.z, Kind == SlotKind::equal ? radius : mine.w);
    if (by_octave) taker.take(octaves, gather.top, mine);
    static_cast<float4*>(out.slots)[begin + to] = mine;
    if (out.codes) out.codes[begin + to] = code_for<Kind>(bins_here, kKeys ? bucket_keys[s] : 0, mine);
    if (kKeys) out.keys[begin + to] = bucket_keys[s];
    if (kIds) out.ids[begin + to] = numbers[s];
  }
  if (Kept && gather.bounds) bounds.give<false>(gather.bounds);
  if (by_octave) {
    taker.give(octaves);
    __syncthreads();
    octaves.give(gather.octaves);
  }
}

}  // namespace

void order_buckets(const BucketPlan& p, const Ordered& o, const Grid& grid, cudaStream_t stream) {
  with_bins(o, grid, [&]<class Kind, class Bins>(Kind kind, const Bins& bins) {
    constexpr bool kMayKeep = kKeyless<Bins>;
    constexpr int kHalf = kWideBlock / 2;
    const bool halved = p.threads < kWideBlock;
    launch_with_shared(p.kept   ? halved ? bucket_order_kernel<kind(), Bins, kHalf, kMayKeep>
                                         : bucket_order_kernel<kind(), Bins, kWideBlock, kMayKeep>
                         : halved ? bucket_order_kernel<kind(), Bins, kHalf, false>
                                : bucket_order_kernel<kind(), Bins, kWideBlock, false>,
                       p.buckets.count, p.threads, p.capacity * sphere_bytes(o) + p.table_bytes,
                       p.shared_bytes, stream, bins, p.buckets, p.capacity, p.starts, p.split, p.out, o.table,
                       p.stable, p.gather, static_cast<float>(p.radius), p.counters);
  });
}

}  // namespace padder::detect::cuda
