// SPDX-License-Identifier: MIT
// The loop of a call whose grid follows from a survey of the spheres: guess, verify, grow, repeat.
//
// To survey first and search then, the host waits for the device twice, which is a large part of a short
// call. From one call to the next the spheres usually move little, and the survey leads to the same grid. So
// the grid of the previous call is tried while the survey runs along, and one wait is saved. What was found
// is taken only if the survey leads to that very grid: the result does not depend on what was detected
// before.
//
// A pass over the device counts everything to its end, even what finds no room. So after one pass it is known
// how large everything must be; then the pass is repeated.
#pragma once
#include <algorithm>

namespace padder::detect::cuda {

enum class Trial { fits, differs, refused };

class SpeculativeCall {
 public:
  // `cooldown`: calls to wait before the previous grid is tried for the first time.
  explicit SpeculativeCall(int cooldown) : retry_cooldown_(cooldown) {}

  // `may_try`: there is a grid of a previous call. False if a step refused. The steps are:
  //   Trial try_previous();  // a pass with the previous grid, and whether the survey leads to the same
  //   bool survey();         // the survey by itself, and the plan that follows; false: refused
  //   void pass();           // the pass that is planned
  //   bool grow();           // makes larger what the last pass found too small and plans again, if need be
  // They may throw.
  template <class Steps>
  bool run(Steps& steps, bool may_try) {
    Trial trial = Trial::differs;
    if (may_try && retry_cooldown_ == 0) {
      trial = steps.try_previous();
      if (trial == Trial::refused) return false;
      doubt_ = trial == Trial::fits ? std::max(doubt_ - 1, 0) : doubt_ + kInVain;
      if (doubt_ > kMostDoubt) retry_cooldown_ = kAfterFailure, doubt_ = kMostDoubt;
    }
    if (trial == Trial::differs) {
      if (retry_cooldown_ > 0) retry_cooldown_--;
      if (!steps.survey()) return false;
      steps.pass();
    }
    while (steps.grow()) steps.pass();
    return true;
  }

 private:
  // A trial in vain costs a whole search, and one that fits saves a third to half of one. Where more than a
  // fourth are in vain the detector waits for some calls; that of the last trial is the first of these.
  static constexpr int kAfterFailure = 5, kInVain = 3, kMostDoubt = 6;
  int doubt_ = 0;       // kInVain for each trial in vain, less 1 for each that fits
  int retry_cooldown_;  // calls to wait before the previous grid is tried again
};

}  // namespace padder::detect::cuda
