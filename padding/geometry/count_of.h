// SPDX-License-Identifier: MIT
// Counts in sentences. Not installed.
#pragma once
#include <string>

namespace padder {

// "1 hole", "3 holes".
inline std::string count_of(std::size_t n, const std::string& one) {
  return std::to_string(n) + " " + one + (n == 1 ? "" : "s");
}

}  // namespace padder
