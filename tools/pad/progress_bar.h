// SPDX-License-Identifier: GPL-3.0-or-later
// A progress bar on stderr.
#pragma once
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <string>

namespace padder {

// One line on a terminal. Prints nothing when stderr is not a terminal.
class ProgressBar {
 public:
  explicit ProgressBar(bool wanted) : on_(wanted && isatty(STDERR_FILENO)) {}
  ~ProgressBar() { clear(); }
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  // `done` is the share of the work, 0 to 1.
  void show(double done, const std::string& what) {
    if (!on_) return;
    const int width = 30, filled = int(width * std::clamp(done, 0.0, 1.0));
    std::fprintf(stderr, "\r[%s%s] %s\033[K", std::string(filled, '=').c_str(),
                 std::string(width - filled, ' ').c_str(), what.c_str());
    std::fflush(stderr);
  }
  void clear() {
    if (on_) std::fprintf(stderr, "\r\033[K");
  }

 private:
  bool on_;
};

}  // namespace padder
