// SPDX-License-Identifier: MIT
// Fewer cases under a slow tool: with PADDER_TEST_EVERY=5 in the environment, a test that has this object
// tries every fifth of its cases only (tests/detect/cuda/sanitize.py).
#pragma once
#include <algorithm>
#include <cstdlib>

namespace padder::detect {

class SomeCases {
 public:
  static int every() {
    static const char* const text = std::getenv("PADDER_TEST_EVERY");
    static const int value = text ? std::max(1, std::atoi(text)) : 1;
    return value;
  }
  // Asked once for each case.
  bool left_out() { return count_++ % every() != 0; }

 private:
  int count_ = 0;
};

}  // namespace padder::detect
