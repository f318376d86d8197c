// SPDX-License-Identifier: MIT
#include "detect/cuda/input/host_copy.h"

#include <omp.h>

#include <algorithm>
#include <atomic>
#include <cstring>

#include "detect/cuda/tuning.h"

namespace padder::detect::cuda {
namespace {

bool is_pinned(const void* from) {
  cudaPointerAttributes a{};
  const bool known = cudaPointerGetAttributes(&a, from) == cudaSuccess;
  cudaGetLastError();
  return known && a.type != cudaMemoryTypeUnregistered;
}

}  // namespace

HostCopy::~HostCopy() {
  for (const Block& b : blocks_) cudaEventDestroy(b.fetched), cudaFreeHost(b.bytes);
}

void HostCopy::reserve(int count) {
  while (static_cast<int>(blocks_.size()) < count) {
    void* bytes = nullptr;
    cudaEvent_t fetched{};
    if (cudaMallocHost(&bytes, tuning::kCopyBlock) != cudaSuccess) break;
    if (cudaEventCreateWithFlags(&fetched, cudaEventDisableTiming) != cudaSuccess) {
      cudaFreeHost(bytes);
      break;
    }
    blocks_.push_back({static_cast<char*>(bytes), fetched});
  }
  cudaGetLastError();  // of a block that could not be had
}

// Each thread fills its own blocks in turn. The order in which blocks reach the stream does not matter.
cudaError_t HostCopy::staged(char* to, const char* from, std::uint64_t bytes, int threads,
                             cudaStream_t stream) {
  const int own = static_cast<int>(blocks_.size()) / threads;
  int device = 0;
  cudaGetDevice(&device);
  std::atomic<cudaError_t> failure = cudaSuccess;
#pragma omp parallel num_threads(threads)
  {
    cudaSetDevice(device);
    int turn = 0;
#pragma omp for schedule(dynamic)
    for (std::int64_t at = 0; at < static_cast<std::int64_t>(bytes); at += tuning::kCopyBlock) {
      const Block& b = blocks_[static_cast<std::size_t>(own * omp_get_thread_num() + turn++ % own)];
      const std::uint64_t size =
          std::min<std::uint64_t>(tuning::kCopyBlock, bytes - static_cast<std::uint64_t>(at));
      cudaError_t e = cudaEventSynchronize(b.fetched);  // by a copy before, perhaps of another call
      if (e == cudaSuccess) {
        std::memcpy(b.bytes, from + at, size);
        e = cudaMemcpyAsync(to + at, b.bytes, size, cudaMemcpyHostToDevice, stream);
      }
      if (e == cudaSuccess) e = cudaEventRecord(b.fetched, stream);
      if (e != cudaSuccess) failure = e;
    }
  }
  return failure;
}

void HostCopy::run(void* to, const void* from, std::uint64_t bytes, const char* what, cudaStream_t stream) {
  if (bytes == 0) return;
  int threads = 1;
  if (bytes >= tuning::kStagedCopy && !is_pinned(from)) {
    threads = std::min(tuning::kCopyThreads, omp_get_max_threads());
    reserve(tuning::kCopyBlocks * threads);
    threads = std::min(threads, static_cast<int>(blocks_.size()));
  }
  cuda_check(threads > 1
                 ? staged(static_cast<char*>(to), static_cast<const char*>(from), bytes, threads, stream)
                 : cudaMemcpyAsync(to, from, bytes, cudaMemcpyHostToDevice, stream),
             what);
}

}  // namespace padder::detect::cuda
