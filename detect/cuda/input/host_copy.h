// SPDX-License-Identifier: MIT
// Host memory to the device at the speed of the bus. Only .cu files include this.
#pragma once
#include <vector>

#include "detect/cuda/device/memory.h"

namespace padder::detect::cuda {

// The driver copies memory that is not pinned with one thread. Large copies are made here by several threads:
// they move the memory to pinned blocks, and the device fetches full blocks while others are being filled.
// Pinned memory is copied as it is. The blocks (32 MiB) are kept, and count towards no limit.
class HostCopy {
 public:
  HostCopy() = default;
  ~HostCopy();
  HostCopy(const HostCopy&) = delete;
  HostCopy& operator=(const HostCopy&) = delete;

  // On return `from` may change; what is launched in `stream` from then on finds the copy. Throws Error with
  // "CUDA failed to <what>".
  void run(void* to, const void* from, std::uint64_t bytes, const char* what, cudaStream_t stream);

 private:
  struct Block {
    char* bytes;
    cudaEvent_t fetched;
  };
  // As many blocks as can be had, up to this number.
  void reserve(int count);
  cudaError_t staged(char* to, const char* from, std::uint64_t bytes, int threads, cudaStream_t stream);

  std::vector<Block> blocks_;
};

}  // namespace padder::detect::cuda
