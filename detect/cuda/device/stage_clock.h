// SPDX-License-Identifier: MIT
// How long the stages of a call take, for CallOptions::timings. Only .cu files include this.
#pragma once
#include <chrono>

#include "detect/cuda/device/memory.h"
#include "detect/detector.h"

namespace padder::detect::cuda {

class StageClock {
 public:
  // The call begins. Without `timings` the device is never waited for, and only the total is known.
  void begin(cudaStream_t stream, bool timings) {
    stream_ = stream, timings_ = timings, seconds_ = {};
    begun_ = last_mark_ = Clock::now();
  }
  // What was enqueued since the last mark belongs to this stage: 0 to 8 as in Seconds::stage, kPlace or
  // kHistory.
  static constexpr int kPlace = -1, kHistory = -2;
  void mark(int stage) {
    if (!timings_) return;
    cuda_check(cudaStreamSynchronize(stream_), "finish a stage");
    const auto now = Clock::now();
    (stage == kPlace     ? seconds_.place
     : stage == kHistory ? seconds_.history
                         : seconds_.stage[stage]) += std::chrono::duration<double>(now - last_mark_).count();
    last_mark_ = now;
  }
  Seconds seconds() const {
    Seconds s = seconds_;
    s.total = std::chrono::duration<double>(Clock::now() - begun_).count();
    return s;
  }

 private:
  using Clock = std::chrono::steady_clock;
  cudaStream_t stream_ = nullptr;
  bool timings_ = false;
  Seconds seconds_;
  Clock::time_point begun_, last_mark_;
};

}  // namespace padder::detect::cuda
