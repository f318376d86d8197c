// SPDX-License-Identifier: MIT
#include "detect/cuda/bodies/pair_estimate.h"

#include <algorithm>
#include <cmath>

#include "detect/cuda/device/device.h"

namespace padder::detect::cuda {
namespace {

// How many others of the sample a thread tests.
constexpr std::uint32_t kThreads = 128, kTests = 16;

// Elements of the sample. If each element touches one other, 8 pairs of the sample do, or more; in large
// scenes fewer.
std::uint32_t sample_of(std::uint32_t moving) {
  return std::min(moving, std::clamp(static_cast<std::uint32_t>(4 * std::sqrt(moving)), 1024u, 4096u));
}

// Element k of the sample. They are spread evenly but for chance, because things are often listed in a
// pattern.
__device__ __forceinline__ std::uint32_t sampled(std::uint32_t k, std::uint32_t count, std::uint32_t n) {
  const auto first = [&](std::uint32_t at) {
    return static_cast<std::uint32_t>(std::uint64_t(at) * n / count);
  };
  std::uint32_t h = k * 0x9e3779b9u;
  h = (h ^ h >> 16) * 0x85ebca6bu, h ^= h >> 13;
  return first(k) + h % max(first(k + 1) - first(k), 1u);
}

__global__ void __launch_bounds__(kThreads)
    sample_kernel(const __grid_constant__ BodyView view, std::uint32_t count,
                  unsigned long long* touching_pairs) {
  const std::uint32_t t = threadIdx.x, i = blockIdx.x * kThreads + t, first = blockIdx.y * kTests;
  const auto ball_of = [&](std::uint32_t k) { return view.balls[sampled(k, count, view.moving)]; };
  const auto filter_of = [&](std::uint32_t k) {
    const std::uint32_t e = sampled(k, count, view.moving);
    return Filter{view.family[e], view.mask[e], view.owner[e]};
  };
  __shared__ Sphere balls[kTests];
  __shared__ Filter filters[kTests];
  if (t < kTests && first + t < count) balls[t] = ball_of(first + t), filters[t] = filter_of(first + t);
  __syncthreads();
  std::uint32_t found = 0;
  if (i < count) {
    const Sphere ball = ball_of(i);
    const Filter filter = filter_of(i);
    for (std::uint32_t j = max(first, i + 1); j < min(first + kTests, count); j++)
      found += touching(ball, balls[j - first]) && admitted(filter, filters[j - first]);
  }
  if (found) atomicAdd(touching_pairs, static_cast<unsigned long long>(found));
}

}  // namespace

void sample_pairs(const BodyView& view, unsigned long long* touching, cudaStream_t stream) {
  const std::uint32_t count = sample_of(view.moving);
  const dim3 blocks((count + kThreads - 1) / kThreads, (count + kTests - 1) / kTests);
  sample_kernel<<<blocks, kThreads, 0, stream>>>(view, count, touching);
  cuda_launched("estimate the pairs");
}

double estimated_pairs(std::uint32_t moving, unsigned long long touching) {
  const double each = static_cast<double>(moving) / sample_of(moving);
  return each * each * static_cast<double>(touching);
}

}  // namespace padder::detect::cuda
