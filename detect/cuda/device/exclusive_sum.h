// SPDX-License-Identifier: MIT
// Sums of counts on the device. Only .cu files include this.
#pragma once
#include <cub/device/device_scan.cuh>
#include <cuda/std/functional>

#include "detect/cuda/device/memory.h"

namespace padder::detect::cuda {

// sums[k] = counts[0] + … + counts[k - 1], for k below n. Added up in 64 bits, since a sum may exceed a
// count.
template <class Count>
void exclusive_sum(const std::uint32_t* counts, unsigned long long* sums, Count n,
                   Buffer<unsigned char>& scratch, cudaStream_t stream) {
  std::size_t bytes = 0;
  const auto scan = [&](void* room) {
    return cub::DeviceScan::ExclusiveScan(room, bytes, counts, sums, ::cuda::std::plus<>{}, 0ull, n, stream);
  };
  cuda_check(scan(nullptr), "scan");
  cuda_check(scan(scratch.reserve(bytes)), "scan");
}

}  // namespace padder::detect::cuda
