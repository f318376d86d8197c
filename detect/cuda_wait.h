// Waiting for the few words that a pass over the device ends with. cudaStreamSynchronize looks whether the
// device is done every 8 us on the machines measured (docs/results/h200.md), a quarter of a small pass. Only
// .cu files include this.
#pragma once
#include <atomic>
#include <chrono>

#include "detect/cuda_memory.h"

namespace padder::detect::cuda {

// Words in pinned memory that a copy, the last of the stream, is to overwrite. expect() before the copy is
// enqueued, arrived() afterwards: returns once every word has changed, and then all that the stream had to do
// is done. A word that happens to be copied as it was, or a device that stopped, is found by synchronizing.
// Throws Error.
class Arrival {
 public:
  void expect(void* words, std::size_t bytes) {
    words_ = static_cast<Word*>(words), count_ = bytes / sizeof(Word);
    for (std::size_t k = 0; k < count_; k++)
      std::atomic_ref(words_[k]).store(kPending, std::memory_order_relaxed);
    std::atomic_thread_fence(std::memory_order_seq_cst);
  }
  void arrived(cudaStream_t stream, const char* what) const {
    using Clock = std::chrono::steady_clock;
    const auto patience = Clock::now() + std::chrono::microseconds(400);
    std::size_t k = 0;
    for (unsigned turn = 1; k < count_; turn++) {
      if (std::atomic_ref(words_[k]).load(std::memory_order_acquire) != kPending)
        k++;
      else if (turn % 64 == 0 && Clock::now() > patience)
        break;
    }
    if (k < count_) cuda_check(cudaStreamSynchronize(stream), what);
  }

 private:
  using Word = unsigned long long;
  static constexpr Word kPending = 0x9d1f5c3ab7e60248;
  Word* words_ = nullptr;
  std::size_t count_ = 0;
};

}  // namespace padder::detect::cuda
