// SPDX-License-Identifier: MIT
// Linked into the tests that launch kernels themselves: a test that hangs on a GPU ends with a sentence.
#include <gtest/gtest.h>

#include <optional>

#include "tools/watchdog.h"

namespace {

class TimeLimit : public testing::EmptyTestEventListener {
  void OnTestStart(const testing::TestInfo& test) override {
    const std::string name = std::string(test.test_suite_name()) + "." + test.name();
    limit_.emplace(name.c_str(), 300);
  }
  void OnTestEnd(const testing::TestInfo&) override { limit_.reset(); }

  std::optional<padder::Watchdog> limit_;
};

[[maybe_unused]] const bool appended = [] {
  testing::UnitTest::GetInstance()->listeners().Append(new TimeLimit);  // which owns it
  return true;
}();

}  // namespace
