// SPDX-License-Identifier: MIT
// Chooses the number of threads for calls that do not ask for one. Internal.
#pragma once
#include <chrono>
#include <cstdint>

namespace padder::detect::omp {

// As many threads as the work is worth, or one while other programs keep the processors busy.
//
// The reason for one: the threads of libgomp spin while they wait for each other. If one of them has lost its
// processor, the others burn theirs until it runs again, and a parallel region of 0.1 ms takes many
// milliseconds. So after a call that was interrupted, calls use one thread for 20 ms, and twice as long after
// each further attempt that was interrupted.
class Threads {
 public:
  // `asked`: CallOptions::threads. `work`: the number of spheres that are searched one by one.
  int choose(int asked, std::uint64_t work);
  void done();  // to be called after the call for which choose() was asked

 private:
  using Clock = std::chrono::steady_clock;
  bool several_ = false;  // more than one thread was chosen for this call
  long interruptions_ = 0;
  std::chrono::duration<double> pause_{0};
  Clock::time_point begun_, alone_until_;
};

}  // namespace padder::detect::omp
