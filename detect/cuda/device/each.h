// SPDX-License-Identifier: MIT
// A function for each of so many numbers, on the device; counts may pass 2^32. Only .cu files include this.
#pragma once
#include "detect/cuda/device/blocks.h"
#include "detect/cuda/device/memory.h"

namespace padder::detect::cuda {

inline constexpr int kThreadsOfEach = 128;

template <class F>
__global__ void __launch_bounds__(kThreadsOfEach) each_kernel(std::uint64_t n, F f) {
  for (std::uint64_t k = blockIdx.x * std::uint64_t(kThreadsOfEach) + threadIdx.x; k < n;
       k += std::uint64_t(gridDim.x) * kThreadsOfEach)
    f(k);
}
// f(k) for each k below n. `what`: what a sentence says that CUDA has failed to do.
template <class F>
void each(std::uint64_t n, cudaStream_t stream, const char* what, F f) {
  if (n == 0) return;
  each_kernel<<<blocks_of_loop(n, kThreadsOfEach), kThreadsOfEach, 0, stream>>>(n, f);
  cuda_launched(what);
}

}  // namespace padder::detect::cuda
