// SPDX-License-Identifier: MIT
// What padder throws when its input is at fault.
#pragma once
#include <stdexcept>

namespace padder {

// One clear sentence: what is wrong, in which file and place, what to do. Tools print it on stderr and exit
// with 1.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace padder
