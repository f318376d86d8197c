// SPDX-License-Identifier: MIT
#include "detect/core/bodies/way_choice.h"

#include <algorithm>

namespace padder::detect {

void WayChoice::took(double seconds, bool worth_trying) {
  if (calls_++ < kUntimed) return;
  least_ = std::min(least_, seconds);
  const bool all_timed = calls_ == kUntimed + kTimed;
  if (trying_) {
    if (!all_timed && seconds < kSlow * chosen_) return;
    const bool faster = least_ < chosen_;
    first_ = first_ != faster, tried_ = true;
    keep(!faster);
  } else if (all_timed && worth_trying) {
    chosen_ = least_;
    trying_ = true, calls_ = 0, least_ = INFINITY;
  } else if (all_timed) {
    keep(false);
  }
}

void WayChoice::gave_up() {
  const bool was_right = trying_;
  first_ = tried_ = false;
  keep(was_right);
}

void WayChoice::keep(bool was_right) {
  kept_ = was_right ? std::min(2 * kept_, kMostKept) : kKept;
  trying_ = false, calls_ = -kept_, least_ = INFINITY;
}

}  // namespace padder::detect
