// SPDX-License-Identifier: MIT
// The sentence of an Error, for tests of what is refused.
#pragma once
#include <gtest/gtest.h>

#include <string>

#include "padding/asset/error.h"

namespace padder {

// What the Error says that `work` throws, or "" where it throws none.
template <class Work>
std::string error_of(const Work& work) {
  try {
    work();
  } catch (const Error& e) {
    return e.what();
  }
  return "";
}

// Does `work` throw an Error with these words?
template <class Work>
::testing::AssertionResult refuses(const Work& work, const std::string& words) {
  const std::string said = error_of(work);
  if (!said.empty() && said.find(words) != std::string::npos) return ::testing::AssertionSuccess();
  return ::testing::AssertionFailure()
         << (said.empty() ? "nothing was refused" : "\"" + said + "\"") << ", wanted: " << words;
}

}  // namespace padder
