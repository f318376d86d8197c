// SPDX-License-Identifier: GPL-3.0-or-later
// A scope that does not end in time ends the process, with a sentence; others do nothing.
#include "tools/watchdog.h"

#include <gtest/gtest.h>
#include <sys/wait.h>

namespace padder {
namespace {

void sleep_for(double seconds) { std::this_thread::sleep_for(std::chrono::duration<double>(seconds)); }

struct Ended {
  int code;
  std::string said;
};

// What becomes of a process that does `work` and then ends by itself with 7.
template <class Work>
Ended process(const Work& work, const char* factor = nullptr) {
  int ends[2];
  if (::pipe(ends) != 0) return {-1, "no pipe"};
  const pid_t child = ::fork();
  if (child == 0) {
    ::dup2(ends[1], STDERR_FILENO);
    ::close(ends[0]), ::close(ends[1]);
    factor ? ::setenv("PADDER_WATCHDOG", factor, 1) : ::unsetenv("PADDER_WATCHDOG");
    work();
    ::_exit(7);
  }
  ::close(ends[1]);
  Ended e{0, ""};
  char c;
  while (::read(ends[0], &c, 1) == 1) e.said += c;
  ::close(ends[0]);
  int status = 0;
  ::waitpid(child, &status, 0);
  e.code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return e;
}

TEST(Watchdog, TheInnerScopeHasItsOwnLimit) {
  const Ended e = process([] {
    const Watchdog outer("outer", 100);
    { const Watchdog done("done", 0.5); }
    const Watchdog inner("inner", 1);
    sleep_for(120);
  });
  EXPECT_EQ(e.code, Watchdog::kEnded);
  EXPECT_EQ(e.said, "inner: no answer after 1 s, ended\n");
}

TEST(Watchdog, WhoeverAnswersIsLeftAlone) {
  const Ended e = process([] {
    for (int k = 0; k < 10; k++) {
      const Watchdog limit("quick", 1);
      sleep_for(0.15);
    }
    sleep_for(1);
  });
  EXPECT_EQ(e.code, 7);
  EXPECT_EQ(e.said, "");
}

TEST(Watchdog, TheEnvironmentLengthensOrEndsIt) {
  const auto late = [] {
    const Watchdog limit("late", 0.1);
    sleep_for(1);
  };
  EXPECT_EQ(process(late).code, Watchdog::kEnded);
  EXPECT_EQ(process(late, "100").code, 7);
  EXPECT_EQ(process(late, "0").code, 7);
  EXPECT_EQ(process(late, "2").said, "late: no answer after 0.2 s, ended\n");
  EXPECT_EQ(process(late, "nonsense").code, Watchdog::kEnded);
}

}  // namespace
}  // namespace padder
