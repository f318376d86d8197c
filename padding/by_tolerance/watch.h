// SPDX-License-Identifier: MIT
// How far a long search is, told to its caller, who may also end it.
#pragma once
#include <algorithm>
#include <exception>
#include <functional>
#include <mutex>

namespace padder {

// Called with the share that is done, 0 to 1. It may throw: the search then ends, and throws the same.
using TellShare = std::function<void(double share)>;

// Counts the steps of a search. Any thread may count, also in a parallel region, which no exception may
// leave: what the caller's function throws is kept until check().
class Watch {
 public:
  Watch(TellShare tell, double steps) : tell_(std::move(tell)), steps_(steps) {}

  void tick() {
    const std::lock_guard lock(mutex_);
    done_++;
    if (!tell_ || failure_) return;
    try {
      tell_(std::min(1.0, done_ / steps_));
    } catch (...) {
      failure_ = std::current_exception();
    }
  }

  // Should what is left be skipped?
  bool stopped() {
    const std::lock_guard lock(mutex_);
    return failure_ != nullptr;
  }

  // Outside of parallel regions: throws what the caller's function has thrown.
  void check() {
    const std::lock_guard lock(mutex_);
    if (failure_) std::rethrow_exception(failure_);
  }

 private:
  TellShare tell_;
  double steps_, done_ = 0;
  std::mutex mutex_;
  std::exception_ptr failure_;
};

}  // namespace padder
