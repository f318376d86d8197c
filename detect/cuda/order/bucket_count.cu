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

// By the block that finishes last: makes starts of the counts, of buckets and of groups.
template <int Threads>
__device__ __forceinline__ void find_starts(const Buckets& buckets, const Starts& starts,
                                            std::uint32_t groups, std::uint32_t* shared,
                                            std::uint32_t* sums) {
  for (std::uint32_t b = threadIdx.x; b < buckets.count; b += Threads) shared[b] = __ldcg(starts.bucket + b);
  scan_shared(shared, buckets.count, sums);
  for (std::uint32_t b = threadIdx.x; b <= buckets.count; b += Threads) {
    starts.bucket[b] = shared[b];
    if (b < buckets.count) starts.cursor[b] = shared[b];
  }
  for (std::uint32_t g = threadIdx.x; g < groups; g += Threads)
    starts.group_cursor[g] = shared[g << kGroupBits];
  if (threadIdx.x > 0 || groups == 0) return;
  std::uint32_t portions = 0;
  for (std::uint32_t g = 0; g < groups; g++) {
    starts.group_portion[g] = portions;
    portions += (shared[min((g + 1) << kGroupBits, buckets.count)] - shared[g << kGroupBits] +
                 buckets.portion_spheres - 1) /
                buckets.portion_spheres;
  }
  starts.group_portion[groups] = portions;
}

// Each block counts in shared memory of its own. Narrow blocks are four a processor, where their counts leave
// room for that; else one wide block.
template <class Bins, bool Along, int Threads>
__global__ void __launch_bounds__(Threads,
                                  Threads == kCountThreads ? tuning::at_most_resident(4, Threads) : 1)
    bucket_count_kernel(const __grid_constant__ DeviceSpheres source, const __grid_constant__ Bins bins,
                        const __grid_constant__ Buckets buckets, std::uint32_t* keys, Starts starts,
                        std::uint32_t groups, unsigned long long* found, Counters* counters) {
  constexpr int kAtOnce = Threads == kCountThreads ? 1 : 3;
  Bounds bounds;
  extern __shared__ std::uint32_t shared[];
  __shared__ std::uint32_t sums[32];
  for (std::uint32_t b = threadIdx.x; b < buckets.count; b += Threads) shared[b] = 0;
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
        if (const std::uint32_t k = u * Threads + threadIdx.x; k < here) s[u] = source.sphere(first + k);
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
      ticket(shared, valid ? buckets.of(key) : ~0u);
    }
  }
  if (Along) bounds.give(found);
  __syncthreads();
  for (std::uint32_t b = threadIdx.x; b < buckets.count; b += Threads)
    if (shared[b]) atomicAdd(starts.bucket + b, shared[b]);
  if (is_last(starts)) find_starts<Threads>(buckets, starts, groups, shared, sums);
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
    const auto launch = [&](auto* kernel, unsigned blocks, int threads) {
      launch_with_shared(kernel, blocks, threads, (p.buckets.count + 1) * 4, p.shared_bytes, stream, source,
                         bins, p.buckets, p.source.keys, p.starts, p.groups, p.gather.bounds, p.counters);
    };
    const auto processors = static_cast<unsigned>(p.processors);
    if (p.groups > 0)
      launch(p.gather.bounds ? bucket_count_kernel<Bins, true, kWideBlock>
                             : bucket_count_kernel<Bins, false, kWideBlock>,
             processors, kWideBlock);
    else
      launch(p.gather.bounds ? bucket_count_kernel<Bins, true, kCountThreads>
                             : bucket_count_kernel<Bins, false, kCountThreads>,
             processors * 4, kCountThreads);
  });
}

}  // namespace padder::detect::cuda
