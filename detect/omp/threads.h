// SPDX-License-Identifier: MIT
// How many threads a call gets that does not say how many. Internal.
#pragma once
#include <chrono>
#include <cstdint>

namespace padder::detect::omp {

// As many as the work is worth, and one while other programs keep the processors busy. libgomp's threads spin
// while they wait for each other: where one of them has lost its processor, the others burn theirs until it
// gets another turn, and a region of a tenth of a millisecond takes many. So a call that was interrupted is
// followed by calls on one thread: for 20 ms at first, twice as long each time that several were tried in
// vain.
class Threads {
 public:
  // `asked`: Options::threads; `work`: in spheres searched one by one.
  int choose(int asked, std::uint64_t work);
  void done();  // after the call that this many threads were chosen for

 private:
  using Clock = std::chrono::steady_clock;
  bool several_ = false;  // chosen for this call
  long interruptions_ = 0;
  std::chrono::duration<double> pause_{0};
  Clock::time_point begun_, alone_until_;
};

}  // namespace padder::detect::omp
