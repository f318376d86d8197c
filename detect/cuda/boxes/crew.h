// SPDX-License-Identifier: MIT
// Threads that wait for work together. Internal.
#pragma once
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <stop_token>
#include <thread>
#include <vector>

namespace padder::detect::cuda {

// Threads that live as long as the detector, one for each GPU but the first: the caller's works for that.
class Crew {
 public:
  explicit Crew(std::size_t size) {
    for (std::size_t k = 1; k < size; k++)
      threads_.emplace_back([this, k](const std::stop_token& stop) { serve(k, stop); });
  }
  // Calls work(k) for each k and waits for all. `work` must not throw.
  void run(const std::function<void(std::size_t)>& work) {
    {
      const std::lock_guard lock(mutex_);
      work_ = &work, busy_ = threads_.size(), round_++;
    }
    changed_.notify_all();
    work(0);
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return busy_ == 0; });
  }

 private:
  void serve(std::size_t k, const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    for (std::uint64_t served = 0; changed_.wait(lock, stop, [&] { return round_ != served; });) {
      served = round_;
      lock.unlock();
      (*work_)(k);
      lock.lock();
      if (--busy_ == 0) changed_.notify_all();
    }
  }

  std::mutex mutex_;
  std::condition_variable_any changed_;
  const std::function<void(std::size_t)>* work_ = nullptr;
  std::size_t busy_ = 0;
  std::uint64_t round_ = 0;
  std::vector<std::jthread> threads_;  // the last member: they end first
};

}  // namespace padder::detect::cuda
