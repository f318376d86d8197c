// SPDX-License-Identifier: MIT
#include "detect/omp/threads.h"

#include <omp.h>

#include <algorithm>

#include "detect/detector.h"

#if defined(__unix__)
#include <sys/resource.h>
#endif

namespace padder::detect::omp {
namespace {

// How often threads of this program had to give up their processor to another program, so far.
long interruptions() {
#if defined(__unix__)
  rusage usage;
  if (getrusage(RUSAGE_SELF, &usage) == 0) return usage.ru_nivcsw;
#endif
  return 0;
}

// Spheres that are worth a further thread. A small scene is done before a second thread has woken up.
constexpr std::uint64_t kWorth = 2048;
// A call counts as interrupted with at least this many interruptions, and this many a second. On an idle
// machine there are a few a second; beside another program there is one every few milliseconds for each
// thread.
constexpr long kFewest = 2;
constexpr double kPerSecond = 50;
constexpr std::chrono::duration<double> kShortest{0.02}, kLongest{5};

}  // namespace

int Threads::choose(int asked, std::uint64_t work) {
  several_ = false;
  if (asked > 0) return asked;
  const auto worth = static_cast<int>(std::min<std::uint64_t>(1 + work / kWorth, kMostThreads));
  const int threads = std::min(omp_get_max_threads(), worth);
  if (threads <= 1) return 1;
  begun_ = Clock::now();
  if (begun_ < alone_until_) return 1;
  several_ = true, interruptions_ = interruptions();
  return threads;
}

void Threads::done() {
  if (!several_) return;
  several_ = false;
  const auto now = Clock::now();
  const std::chrono::duration<double> passed = now - begun_;
  const long count = interruptions() - interruptions_;
  if (count < kFewest || static_cast<double>(count) < kPerSecond * passed.count()) {
    pause_ = std::chrono::duration<double>(0);
    return;
  }
  pause_ = std::clamp(2 * pause_, kShortest, kLongest);
  alone_until_ = now + std::chrono::duration_cast<Clock::duration>(pause_);
}

}  // namespace padder::detect::omp
