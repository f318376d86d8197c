// SPDX-License-Identifier: MIT
// The few words that a pass over the device ends with, brought to the host by a kernel that writes them
// there. A copy by the copy engine, and cudaStreamSynchronize after it, end on a beat of 8 us on the machines
// measured (docs/results/h200.md): a quarter of a small pass. Only .cu files include this.
#pragma once
#include "detect/cuda/memory.h"

namespace padder::detect::cuda {

class Report {
 public:
  void clear() { parts_.count = 0; }
  // `bytes`, a multiple of 8, from device memory to pinned memory. At most four parts.
  void add(const void* device, void* pinned, std::uint64_t bytes);
  // Before anything is enqueued: the pinned words are marked.
  void expect() const;
  // The last of the stream.
  void send(cudaStream_t stream) const;
  // Returns once no word is as expect() left it; then all that the stream had to do is done. Where that takes
  // long, where a word happens to be the mark, or where the device stopped, the stream is synchronized.
  // Throws Error: CUDA failed to `what`.
  void arrived(cudaStream_t stream, const char* what) const;

  struct Part {
    const unsigned long long* from;
    unsigned long long* to;
    std::uint32_t words;
  };
  struct Parts {
    Part part[4];
    int count = 0;
  };

 private:
  Parts parts_;
};

}  // namespace padder::detect::cuda
