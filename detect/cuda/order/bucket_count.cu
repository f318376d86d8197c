// SPDX-License-Identifier: MIT
// How many spheres each bucket holds, and from that where it begins.
#include "detect/cuda/order/buckets.h"

namespace padder::detect::cuda {
namespace {

constexpr int kCountThreads = 512;

__global__ void __launch_bounds__(kCountThreads)
    bucket_begin_kernel(Starts starts, std::uint32_t count, unsigned long long* bounds, Counters* counters) {
  const std::uint32_t k = blockIdx.x * kCountThreads + threadIdx.x;
  if (k < count) starts.bucket[k] = 0;
  if (k == 0) *starts.finished = 0;
  if (!bounds) return;
  if (k < kBounds) bounds[k] = Bounds::nothing(k);
  if (k == 0) *counters = {};
}

// The same, where the previous call's counts decide what room each bucket gets.
__global__ void __launch_bounds__(kCountThreads)
    bucket_room_kernel(Starts starts, std::uint32_t count, Gather gather, Counters* counters) {
  const std::uint32_t k = blockIdx.x * kCountThreads + threadIdx.x;
  if (k <= count) starts.room[k] = starts.cursor[k] = roomy(starts.bucket[k], k);
  if (k == 0) *starts.finished = 0;
  if (!gather.bounds) return;
  gather.begin(k, gridDim.x * kCountThreads);
  if (k == 0) *counters = {};
}

// By the block that finishes last: makes starts of the counts, of buckets and of groups. `shared` has room
// for `at_once` counts and one more.
template <int Threads>
__device__ __forceinline__ void find_starts(const Buckets& buckets, const Starts& starts,
                                            std::uint32_t groups, std::uint32_t at_once,
                                            std::uint32_t* shared, std::uint32_t* sums) {
  std::uint32_t before = 0;
  for (std::uint32_t first = 0; first < buckets.count; first += at_once) {
    const std::uint32_t count = min(at_once, buckets.count - first);
    for (std::uint32_t b = threadIdx.x; b < count; b += Threads)
      shared[b] = __ldcg(starts.bucket + first + b);
    scan_shared(shared, count, sums);
    for (std::uint32_t b = threadIdx.x; b < count; b += Threads)
      starts.bucket[first + b] = starts.cursor[first + b] = before + shared[b];
    before += shared[count];
    __syncthreads();
  }
  if (threadIdx.x == 0) starts.bucket[buckets.count] = before;
  __syncthreads();
  for (std::uint32_t g = threadIdx.x; g < groups; g += Threads)
    starts.group_cursor[g] = starts.bucket[g << kGroupBits];
  if (threadIdx.x > 0 || groups == 0) return;
  std::uint32_t portions = 0, begin = 0;
  for (std::uint32_t g = 0; g < groups; g++) {
    starts.group_portion[g] = portions;
    const std::uint32_t end = starts.bucket[min((g + 1) << kGroupBits, buckets.count)];
    portions += (end - begin + buckets.portion_spheres - 1) / buckets.portion_spheres, begin = end;
  }
  starts.group_portion[groups] = portions;
}

// Which buckets a pass counts. Where shared memory holds the counts of all, there is one pass.
struct Counted {
  std::uint32_t first = 0, count = 0;
  bool last = true;  // of the passes
};

// Each block counts in shared memory of its own. Narrow blocks are four a processor, where their counts leave
// room for that; else one wide block.
template <class Bins, bool Along, int Threads>
__global__ void __launch_bounds__(Threads,
                                  Threads == kCountThreads ? tuning::at_most_resident(4, Threads) : 1)
    bucket_count_kernel(const __grid_constant__ DeviceSpheres source, const __grid_constant__ Bins bins,
                        const __grid_constant__ Buckets buckets, Counted counted, std::uint32_t* keys,
                        Starts starts, std::uint32_t groups, unsigned long long* found, Counters* counters) {
  constexpr int kAtOnce = Threads == kCountThreads ? 1 : 3;
  Bounds bounds;
  extern __shared__ std::uint32_t shared[];
  __shared__ std::uint32_t sums[32];
  for (std::uint32_t b = threadIdx.x; b < counted.count; b += Threads) shared[b] = 0;
  __syncthreads();
  const std::uint64_t step = static_cast<std::uint64_t>(gridDim.x) * Threads * kAtOnce;
  for (std::uint64_t from = static_cast<std::uint64_t>(blockIdx.x) * Threads * kAtOnce; from < source.count;
       from += step) {
    Sphere s[kAtOnce];
    const auto first = static_cast<std::uint32_t>(from),
               here = min(source.count - first, static_cast<std::uint32_t>(Threads * kAtOnce));
    if (const float4* const run = source.float_run(first, here)) {
#pragma unroll
      for (int u = 0; u < kAtOnce; u++)
        if (const std::uint32_t k = u * Threads + threadIdx.x; k < here) {
          const float4 v = run[k];
          s[u] = {v.x, v.y, v.z, v.w};
        }
    } else {
#pragma unroll
      for (int u = 0; u < kAtOnce; u++)
        if (const std::uint32_t k = u * Threads + threadIdx.x; k < here) s[u] = source.searched(first + k);
    }
#pragma unroll
    for (int u = 0; u < kAtOnce; u++) {
      const std::uint64_t k = from + u * Threads + threadIdx.x;
      const bool valid = k < source.count;
      std::uint32_t key = 0;
      if (valid) {
        key = key_of_sphere(s[u], bins, counters);
        if (!kKeyless<Bins>) keys[k] = key;
        if (Along) bounds.take(s[u], static_cast<std::uint32_t>(k));
      }
      const std::uint32_t bucket = buckets.of(key) - counted.first;
      ticket(shared, valid && bucket < counted.count ? bucket : ~0u);
    }
  }
  if (Along) bounds.give(found);
  __syncthreads();
  for (std::uint32_t b = threadIdx.x; b < counted.count; b += Threads)
    if (shared[b]) atomicAdd(starts.bucket + counted.first + b, shared[b]);
  if (counted.last && is_last(starts))
    find_starts<Threads>(buckets, starts, groups, counted.count, shared, sums);
}

}  // namespace

void begin_buckets(const BucketPlan& p, cudaStream_t stream) {
  const std::uint32_t count = p.buckets.count;
  if (p.kept)
    bucket_room_kernel<<<blocks_for(count + 1, kCountThreads), kCountThreads, 0, stream>>>(
        p.starts, count, p.gather, p.counters);
  else
    bucket_begin_kernel<<<blocks_for(count, kCountThreads), kCountThreads, 0, stream>>>(
        p.starts, count, p.gather.bounds, p.counters);
}

void count_buckets(const BucketPlan& p, const DeviceSpheres& source, const Ordered& o, const Grid& grid,
                   cudaStream_t stream) {
  with_bins(o, grid, [&]<class Kind, class Bins>(Kind, const Bins& bins) {
    const auto pass = [&](auto* kernel, unsigned blocks, int threads, const Counted& counted,
                          unsigned long long* bounds) {
      launch_with_shared(kernel, blocks, threads, (counted.count + 1) * 4, p.shared_bytes, stream, source,
                         bins, p.buckets, counted, p.source.keys, p.starts, p.groups, bounds, p.counters);
    };
    const auto processors = static_cast<unsigned>(p.processors);
    const std::uint32_t all = p.buckets.count, most = p.shared_bytes / 4 - 1,
                        passes = (all + most - 1) / most, at_once = (all + passes - 1) / passes;
    for (std::uint32_t first = 0; first < all; first += at_once) {
      const Counted counted{first, std::min(at_once, all - first), all - first <= at_once};
      unsigned long long* const bounds = first == 0 ? p.gather.bounds : nullptr;
      if (p.groups > 0)
        pass(bounds ? bucket_count_kernel<Bins, true, kWideBlock>
                    : bucket_count_kernel<Bins, false, kWideBlock>,
             processors, kWideBlock, counted, bounds);
      else
        pass(bounds ? bucket_count_kernel<Bins, true, kCountThreads>
                    : bucket_count_kernel<Bins, false, kCountThreads>,
             processors * 4, kCountThreads, counted, bounds);
    }
  });
}

}  // namespace padder::detect::cuda
