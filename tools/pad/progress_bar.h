// SPDX-License-Identifier: GPL-3.0-or-later
// A progress bar on stderr.
#pragma once
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <string>

namespace padder {

// About how long the rest takes if it goes on as before: "8 s left", "3 min left". Empty where that would be
// a guess: in the first two seconds, and before a twentieth is done.
inline std::string time_left(double seconds, double done) {
  if (seconds < 2 || !(done >= 0.05) || done >= 1) return "";
  const double left = seconds * (1 - done) / done;
  return left < 90     ? std::to_string(std::max(1L, std::lround(left))) + " s left"
         : left < 5400 ? std::to_string(std::lround(left / 60)) + " min left"
                       : std::to_string(std::lround(left / 3600)) + " h left";
}

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
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - began_).count();
    const std::string left = time_left(seconds, done);
    const int width = 30, filled = int(width * std::clamp(done, 0.0, 1.0));
    std::fprintf(stderr, "\r[%s%s] %s%s%s\033[K", std::string(filled, '=').c_str(),
                 std::string(width - filled, ' ').c_str(), what.c_str(), left.empty() ? "" : ", ",
                 left.c_str());
    std::fflush(stderr);
  }
  void clear() {
    if (on_) std::fprintf(stderr, "\r\033[K");
  }

 private:
  bool on_;
  std::chrono::steady_clock::time_point began_ = std::chrono::steady_clock::now();
};

}  // namespace padder
