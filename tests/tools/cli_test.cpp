// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/cli.h"

#include <gtest/gtest.h>

#include <thread>

namespace padder::cli {
namespace {

template <class Exception>
void leave_a_thread(const Exception& e) {
  end_with_a_sentence("pad");
  std::thread([&] { throw e; }).join();
}

TEST(Cli, AnExceptionThatLeavesAThreadEndsTheProgramWithASentence) {
  EXPECT_EXIT(leave_a_thread(std::bad_alloc()), testing::ExitedWithCode(1),
              "^pad: not enough memory: [^\n]*\n$");
  EXPECT_EXIT(leave_a_thread(Error("a.obj: is no mesh")), testing::ExitedWithCode(1),
              "^pad: a.obj: is no mesh\n$");
}

}  // namespace
}  // namespace padder::cli
