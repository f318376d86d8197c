// SPDX-License-Identifier: MIT
// Memory and error checks of the CUDA backend. Only .cu files include this.
#pragma once
#include <cuda_runtime.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>

#include "detect/core/backend.h"
#include "padding/asset/error.h"

namespace padder::detect::cuda {

inline void cuda_check(cudaError_t e, const char* what) {
  if (e == cudaSuccess) return;
  cudaGetLastError();  // a sticky error would be found again by the next innocent call
  throw Error(std::string("CUDA failed to ") + what + ": " + cudaGetErrorString(e));
}
inline void cuda_launched(const char* what) { cuda_check(cudaGetLastError(), what); }

// What one backend holds, and how much it may hold.
struct MemoryBook {
  std::uint64_t held = 0, limit = 0, peak = 0;
  std::uint64_t moves = 0;  // allocations so far; each makes recorded graphs stale, which hold addresses
  bool roomy = false;       // what is held will grow a little in later calls
};

// Memory that grows and never shrinks; contents are lost when it grows. What grows once will grow again, and
// each time takes several times as long as a call. So it takes an eighth more than it needs, if that is to be
// had, and up to twice what it needs while that is little beside what the book holds; of a roomy book it
// takes more at once, as long as half of the GPU's memory stays free. Throws MemoryError.
template <class T>
class Buffer {
 public:
  Buffer(MemoryBook& book, const char* what, bool pinned = false)
      : book_(&book), what_(what), pinned_(pinned) {}
  ~Buffer() { release(); }
  Buffer(const Buffer&) = delete;
  Buffer& operator=(const Buffer&) = delete;

  T* reserve(std::uint64_t count) {
    if (count <= capacity_ && data_) return data_;
    const std::uint64_t little = book_->limit ? 0 : book_->held / kLittle / sizeof(T),
                        with_room = count + std::max(count / 8, std::min(count, little));
    const bool grows = data_ || (book_->roomy && !pinned_ && half_stays_free(with_room));
    release();
    const cudaError_t e = grows && allocate(with_room) == cudaSuccess ? cudaSuccess : allocate(count);
    if (e == cudaErrorMemoryAllocation)
      throw pinned_ ? MemoryError(count * sizeof(T), what_, "host", 0)
                    : MemoryError(book_->held + count * sizeof(T), what_, "GPU", book_->limit);
    cuda_check(e, "allocate memory");
    return data_;
  }
  void release() {
    if (!data_) return;
    pinned_ ? cudaFreeHost(data_) : cudaFree(data_);
    if (!pinned_) book_->held -= capacity_ * sizeof(T);
    data_ = nullptr, capacity_ = 0;
  }
  T* data() const { return data_; }
  std::uint64_t capacity() const { return capacity_; }

 private:
  static constexpr std::uint64_t kLittle = 32;  // one part in so many (docs/experiments/calls.md)
  static bool half_stays_free(std::uint64_t count) {
    std::size_t free = 0, total = 0;
    return cudaMemGetInfo(&free, &total) == cudaSuccess && count * sizeof(T) + total / 2 < free;
  }
  cudaError_t allocate(std::uint64_t count) {
    const std::uint64_t bytes = (count ? count : 1) * sizeof(T);
    if (!pinned_ && book_->limit && book_->held + bytes > book_->limit) return cudaErrorMemoryAllocation;
    void* p = nullptr;
    const cudaError_t e = pinned_ ? cudaMallocHost(&p, bytes) : cudaMalloc(&p, bytes);
    if (e == cudaErrorMemoryAllocation) cudaGetLastError();
    if (e != cudaSuccess) return e;
    data_ = static_cast<T*>(p), capacity_ = count ? count : 1;
    book_->moves++;
    if (!pinned_) book_->held += bytes, book_->peak = book_->held > book_->peak ? book_->held : book_->peak;
    return e;
  }

  MemoryBook* book_;
  const char* what_;
  bool pinned_;
  T* data_ = nullptr;
  std::uint64_t capacity_ = 0;
};

// Clears memory that a kernel reads before it is known to count. Only in a build for compute-sanitizer's
// initcheck (PADDER_INITCHECK), which would report each of these reads; no result depends on them.
template <class T>
void clear_for_initcheck([[maybe_unused]] T* p, [[maybe_unused]] std::uint64_t count,
                         [[maybe_unused]] cudaStream_t stream) {
#ifdef PADDER_INITCHECK
  cuda_check(cudaMemsetAsync(p, 0, count * sizeof(T), stream), "clear memory for initcheck");
#endif
}

// Copies host memory to a buffer, which grows if it must. Returns its begin.
template <class T>
T* copied(Buffer<T>& to, const T* from, std::uint64_t count, cudaStream_t stream) {
  T* p = to.reserve(count);
  if (count)
    cuda_check(cudaMemcpyAsync(p, from, count * sizeof(T), cudaMemcpyHostToDevice, stream),
               "copy the bodies");
  return p;
}

}  // namespace padder::detect::cuda
