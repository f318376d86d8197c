// SPDX-License-Identifier: MIT
// Brings the few words that a pass over the device ends with to the host: a kernel writes them there, and the
// host watches for them. A copy by the copy engine, followed by cudaStreamSynchronize, ends on a beat of 8 us
// on the machines measured (docs/experiments/calls.md), a quarter of a small pass. Only .cu files include
// this.
#pragma once
#include "detect/cuda/device/memory.h"

namespace padder::detect::cuda {

class Report {
 public:
  void clear() { parts_.count = 0; }
  // `bytes`, a multiple of 8, from device memory to pinned memory. At most four parts.
  void add(const void* device, void* pinned, std::uint64_t bytes);
  // The same, and leaves zeros on the device.
  void add_and_clear(void* device, void* pinned, std::uint64_t bytes);
  // Marks the pinned words. To be called before anything is enqueued.
  void expect() const;
  // Enqueues the kernel that writes them: after everything else of the pass.
  void send(cudaStream_t stream) const;
  // Returns once every word has changed; then all that the stream had to do is done. If that takes long,
  // because a word happens to equal the mark or the device has stopped, the stream is synchronized. Throws
  // Error: CUDA failed to `what`.
  void arrived(cudaStream_t stream, const char* what) const;

  // For a kernel that ends the pass and writes the words by itself: write_report().
  const auto& parts() const { return parts_; }

  struct Part {
    const unsigned long long* from;
    unsigned long long* to;
    std::uint32_t words;
    unsigned long long* cleared;  // `from`, or null
  };
  struct Parts {
    Part part[4];
    int count = 0;
  };

 private:
  Parts parts_;
};

// By a whole block that sees what is to be reported.
__device__ inline void write_report(const Report::Parts& parts) {
  for (int p = 0; p < parts.count; p++)
    for (std::uint32_t k = threadIdx.x; k < parts.part[p].words; k += blockDim.x) {
      *static_cast<volatile unsigned long long*>(parts.part[p].to + k) = parts.part[p].from[k];
      if (parts.part[p].cleared) parts.part[p].cleared[k] = 0;
    }
}

}  // namespace padder::detect::cuda
