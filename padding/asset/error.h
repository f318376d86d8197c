// SPDX-License-Identifier: MIT
// The exception that padder throws when its input is at fault.
#pragma once
#include <stdexcept>

namespace padder {

// what() is one sentence: what is wrong, in which file and place, and what to do. Tools print it on stderr
// and exit with status 1.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace padder
