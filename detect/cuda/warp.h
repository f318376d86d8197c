// Small things that a warp does together. Only .cu files include this.
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

}  // namespace padder::detect::cuda
