// SPDX-License-Identifier: MIT
#include "detect/cuda/output/records.h"

#include "detect/cuda/device/blocks.h"

namespace padder::detect::cuda {
namespace {

constexpr int kThreads = 256;

__global__ void __launch_bounds__(kThreads)
    geometry_kernel(DeviceSpheres source, Output out, std::uint64_t count) {
  for (std::uint64_t k = blockIdx.x * std::uint64_t(kThreads) + threadIdx.x; k < count;
       k += std::uint64_t(gridDim.x) * kThreads)
    put_geometry(out, k, source.sphere(out.pairs[k].i), source.sphere(out.pairs[k].j));
}

__global__ void __launch_bounds__(kThreads)
    hash_kernel(const Pair* pairs, std::uint64_t count, unsigned long long* sum) {
  unsigned long long h = 0;
  for (std::uint64_t k = blockIdx.x * std::uint64_t(kThreads) + threadIdx.x; k < count;
       k += std::uint64_t(gridDim.x) * kThreads)
    h += pair_hash(pairs[k].i, pairs[k].j);
  for (int d = 16; d; d >>= 1) h += __shfl_xor_sync(~0u, h, d);
  if ((threadIdx.x & 31) == 0) atomicAdd(sum, h);
}

}  // namespace

void write_geometry(const DeviceSpheres& source, const Output& output, std::uint64_t count,
                    cudaStream_t stream) {
  if (count == 0 || output.width == Width::pairs) return;
  geometry_kernel<<<blocks_of_loop(count, kThreads), kThreads, 0, stream>>>(source, output, count);
  cuda_launched("write the contacts");
}

bool has_kernels() {
  cudaFuncAttributes found{};
  const cudaError_t e = cudaFuncGetAttributes(&found, hash_kernel);
  // Other errors are those of earlier work, and are told by what comes next.
  return e != cudaErrorInvalidDeviceFunction && e != cudaErrorNoKernelImageForDevice;
}

std::uint64_t hash_of_pairs(const Pair* pairs, std::uint64_t count, Buffer<unsigned long long>& sum,
                            cudaStream_t stream) {
  if (count == 0) return 0;
  unsigned long long *device = sum.reserve(1), value = 0;
  cuda_check(cudaMemsetAsync(device, 0, sizeof value, stream), "hash the contacts");
  hash_kernel<<<blocks_of_loop(count, kThreads), kThreads, 0, stream>>>(pairs, count, device);
  cuda_launched("hash the contacts");
  cuda_check(cudaMemcpyAsync(&value, device, sizeof value, cudaMemcpyDeviceToHost, stream),
             "hash the contacts");
  cuda_check(cudaStreamSynchronize(stream), "hash the contacts");
  return value;
}

}  // namespace padder::detect::cuda
