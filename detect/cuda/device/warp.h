// SPDX-License-Identifier: MIT
// Small things that a warp does together, or a block. Only .cu files include this.
#pragma once
#include <cstdint>

namespace padder::detect::cuda {

// Sum over the lanes before this one, and (in every lane) over all of them.
template <class T>
__device__ __forceinline__ T sum_before(T v, T& total) {
  const std::uint32_t lane = threadIdx.x & 31;
  T upto = v;
#pragma unroll
  for (int d = 1; d < 32; d <<= 1) {
    const T u = __shfl_up_sync(~0u, upto, d);
    if (static_cast<int>(lane) >= d) upto += u;
  }
  total = __shfl_sync(~0u, upto, 31);
  return upto - v;
}

// Exclusive sums of v[0 .. n) in shared memory by the whole block; v[n] becomes the total. `sums` has 32
// entries. Begins and ends with all threads together.
__device__ __forceinline__ void scan_shared(std::uint32_t* v, std::uint32_t n, std::uint32_t* sums) {
  __syncthreads();
  const std::uint32_t lane = threadIdx.x & 31, warp = threadIdx.x >> 5, warps = blockDim.x >> 5;
  // Each warp scans a contiguous part, 32 entries a step: no bank conflicts.
  const std::uint32_t part = ((n + warps - 1) / warps + 31) & ~31u, from = min(warp * part, n),
                      to = min(from + part, n);
  std::uint32_t sum = 0;
  for (std::uint32_t k = from + lane; k < to; k += 32) sum += v[k];
  sum = __reduce_add_sync(~0u, sum);
  if (lane == 0) sums[warp] = sum;
  __syncthreads();
  std::uint32_t before = __reduce_add_sync(~0u, lane < warp ? sums[lane] : 0);
  for (std::uint32_t k = from; k < to; k += 32) {
    std::uint32_t total;
    const std::uint32_t mine = sum_before(k + lane < to ? v[k + lane] : 0, total);
    if (k + lane < to) v[k + lane] = before + mine;
    before += total;
  }
  if (warp + 1 == warps && lane == 0) v[n] = before;
  __syncthreads();
}

}  // namespace padder::detect::cuda
