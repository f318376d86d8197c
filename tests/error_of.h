// SPDX-License-Identifier: MIT
// The sentence of an Error, for tests of what is refused, and words in a text.
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

// Are these words in the text?
inline ::testing::AssertionResult holds(const std::string& text, const std::string& words) {
  if (text.find(words) != std::string::npos) return ::testing::AssertionSuccess();
  return ::testing::AssertionFailure() << '"' << text << "\", wanted: " << words;
}

// Does `work` throw an Error with these words?
template <class Work>
::testing::AssertionResult refuses(const Work& work, const std::string& words) {
  const std::string said = error_of(work);
  if (said.empty()) return ::testing::AssertionFailure() << "nothing was refused, wanted: " << words;
  return holds(said, words);
}

}  // namespace padder
