// SPDX-License-Identifier: MIT
// How long a stream takes for what it is given. Work that it was given before does not count. Only .cu files
// include this.
#pragma once
#include "detect/cuda/device/memory.h"

namespace padder::detect::cuda {

class StreamTimer {
 public:
  StreamTimer() = default;
  ~StreamTimer() {
    for (const cudaEvent_t e : {begin_, end_})
      if (e) cudaEventDestroy(e);
  }
  StreamTimer(const StreamTimer&) = delete;
  StreamTimer& operator=(const StreamTimer&) = delete;

  void begin(cudaStream_t stream) { mark(begin_, stream); }
  // Since begin(). Waits for the stream.
  double seconds(cudaStream_t stream) {
    mark(end_, stream);
    cuda_check(cudaEventSynchronize(end_), "time a call");
    float ms = 0;
    cuda_check(cudaEventElapsedTime(&ms, begin_, end_), "time a call");
    return 1e-3 * static_cast<double>(ms);
  }

 private:
  static void mark(cudaEvent_t& event, cudaStream_t stream) {
    if (!event) cuda_check(cudaEventCreate(&event), "make an event");
    cuda_check(cudaEventRecord(event, stream), "time a call");
  }
  cudaEvent_t begin_ = nullptr, end_ = nullptr;
};

}  // namespace padder::detect::cuda
