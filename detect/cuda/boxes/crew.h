// SPDX-License-Identifier: MIT
// Threads that wait for work together. Internal.
#pragma once
#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <thread>
#include <utility>
#include <vector>

namespace padder::detect::cuda {

// Threads that live as long as the detector, one for each GPU but the first: the caller's works for that.
// They sleep between calls of the detector. Within a call the next work comes in some microseconds, for which
// they stay awake, since to wake a thread takes longer than that.
class Crew {
 public:
  explicit Crew(std::size_t size) {
    try {
      for (std::size_t k = 1; k < size; k++) threads_.emplace_back([this, k] { serve(k); });
    } catch (...) {
      end();
      throw;
    }
  }
  ~Crew() { end(); }
  Crew(const Crew&) = delete;
  Crew& operator=(const Crew&) = delete;

  // Calls work(k) for each k and waits for all. `work` must not throw.
  void run(const std::function<void(std::size_t)>& work) {
    work_ = &work;
    begin_round();
    work(0), arrive(0);
    for (std::size_t busy; (busy = busy_.load()) > 0;) wait_while(busy_, busy);
  }

  // For work(k): waits until each work of this round has called this, or has ended.
  void meet(std::size_t k) {
    arrive(k);
    for (std::size_t apart; (apart = apart_.load()) > 0;) wait_while(apart_, apart);
  }

 private:
  void end() {
    work_ = nullptr;
    begin_round();
    for (std::thread& t : threads_) t.join();
  }
  void begin_round() {
    arrived_.assign(threads_.size() + 1, false), apart_ = arrived_.size();
    busy_ = threads_.size(), round_++;
    round_.notify_all();
  }
  void serve(std::size_t k) {
    for (std::uint64_t served = 0;; served++) {
      wait_while(round_, served);
      if (!work_) return;
      (*work_)(k), arrive(k);
      if (--busy_ == 0) busy_.notify_one();
    }
  }
  void arrive(std::size_t k) {
    if (!std::exchange(arrived_[k], char(true)) && --apart_ == 0) apart_.notify_all();
  }
  // Until the value is another one: awake for a moment, then asleep.
  template <class T>
  static void wait_while(const std::atomic<T>& value, T old) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::microseconds(200);
    while (value.load() == old && std::chrono::steady_clock::now() < end) std::this_thread::yield();
    value.wait(old);
  }

  const std::function<void(std::size_t)>* work_ = nullptr;
  std::atomic<std::size_t> busy_ = 0;   // works that have not ended
  std::atomic<std::size_t> apart_ = 0;  // works that have neither met nor ended
  std::vector<char> arrived_;           // those that have
  std::atomic<std::uint64_t> round_ = 0;
  std::vector<std::thread> threads_;
};

}  // namespace padder::detect::cuda
