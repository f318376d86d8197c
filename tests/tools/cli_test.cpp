// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/cli.h"

#include <gtest/gtest.h>

#include <thread>

#include "tools/progress_bar.h"

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

// What a bar says on stderr, which is no terminal here, of work that takes `milliseconds` in one call.
std::string said(bool wanted, int milliseconds) {
  testing::internal::CaptureStderr();
  {
    ProgressBar bar("pad", wanted, std::chrono::milliseconds(50));
    bar.tell_between_calls();
    bar.show(0.25, "part.obj: cull");
    std::this_thread::sleep_for(std::chrono::milliseconds(milliseconds));
  }
  return testing::internal::GetCapturedStderr();
}

TEST(ProgressBar, LongWorkSpeaksInALog) {
  const std::string line = "pad: after 0 min: part.obj: cull\n", text = said(true, 400);
  EXPECT_EQ(text.substr(0, 2 * line.size()), line + line) << text;
  EXPECT_EQ(said(true, 0), "");
  EXPECT_EQ(said(false, 200), "");
}

}  // namespace
}  // namespace padder::cli
