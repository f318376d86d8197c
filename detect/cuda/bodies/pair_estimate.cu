// SPDX-License-Identifier: MIT
#include "detect/cuda/bodies/pair_estimate.h"

#include <algorithm>

namespace padder::detect::cuda {
namespace {

// Elements of the sample, and how many others of it a thread tests.
constexpr std::uint32_t kSample = 1024, kThreads = 128, kTests = 64;

// They are spread evenly but for chance, because things are often listed in a pattern.
__device__ __forceinline__ std::uint32_t sampled(std::uint32_t k, std::uint32_t count, std::uint32_t n) {
  const auto first = [&](std::uint32_t at) {
    return static_cast<std::uint32_t>(std::uint64_t(at) * n / count);
  };
  std::uint32_t h = k * 0x9e3779b9u;
  h = (h ^ h >> 16) * 0x85ebca6bu, h ^= h >> 13;
  return first(k) + h % max(first(k + 1) - first(k), 1u);
}

__global__ void __launch_bounds__(kThreads)
    count_kernel(const __grid_constant__ BodyView view, std::uint32_t count, std::uint32_t* touching_pairs) {
  const std::uint32_t i = blockIdx.x * kThreads + threadIdx.x;
  std::uint32_t found = 0;
  if (i < count) {
    const auto filter = [&](std::uint32_t k) { return Filter{view.family[k], view.mask[k], view.owner[k]}; };
    const std::uint32_t a = sampled(i, count, view.moving), first = blockIdx.y * kTests;
    const Sphere ball = view.balls[a];
    const Filter of_a = filter(a);
    for (std::uint32_t j = max(first, i + 1); j < min(first + kTests, count); j++) {
      const std::uint32_t b = sampled(j, count, view.moving);
      found += touching(ball, view.balls[b]) && admitted(of_a, filter(b));
    }
  }
  if (found) atomicAdd(touching_pairs, found);
}

}  // namespace

double PairEstimate::pairs(const BodyView& view, cudaStream_t stream) {
  if (view.moving == 0) return 0;
  const std::uint32_t count = std::min(view.moving, kSample);
  std::uint32_t *const found = count_.reserve(1), *const host = host_count_.reserve(1);
  cuda_check(cudaMemsetAsync(found, 0, sizeof *found, stream), "estimate the pairs");
  count_kernel<<<dim3((count + kThreads - 1) / kThreads, (count + kTests - 1) / kTests), kThreads, 0,
                 stream>>>(view, count, found);
  cuda_launched("estimate the pairs");
  cuda_check(cudaMemcpyAsync(host, found, sizeof *found, cudaMemcpyDeviceToHost, stream),
             "estimate the pairs");
  cuda_check(cudaStreamSynchronize(stream), "estimate the pairs");
  const double each = static_cast<double>(view.moving) / count;
  return each * each * *host;
}

}  // namespace padder::detect::cuda
