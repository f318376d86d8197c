// SPDX-License-Identifier: GPL-3.0-or-later
// How far the work is, on stderr.
#pragma once
#include <pthread.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <csignal>
#include <cstdio>
#include <mutex>
#include <string>
#include <system_error>
#include <thread>

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

// On a terminal one line, drawn anew by each call of show(). Elsewhere, in a log say, a line for each
// `interval` that the work takes; so short work prints nothing there.
class ProgressBar {
 public:
  ProgressBar(const char* program, bool wanted,
              std::chrono::duration<double> interval = std::chrono::minutes(1))
      : program_(program), on_(wanted), is_terminal_(isatty(STDERR_FILENO)), interval_(interval) {}
  ~ProgressBar() {
    clear();
    if (!thread_.joinable()) return;
    {
      const std::lock_guard lock(mutex_);
      ended_ = true;
    }
    end_.notify_all(), thread_.join();
  }
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  // From here on lines come also while nothing calls show(). Not for a program that forks and goes on with
  // threads in its children: this takes a thread.
  void tell_between_calls() {
    if (!on_ || is_terminal_) return;
    sigset_t all, before;  // signals are for the other threads
    ::sigfillset(&all), ::pthread_sigmask(SIG_SETMASK, &all, &before);
    try {
      thread_ = std::thread([this] {
        std::unique_lock lock(mutex_);
        while (!end_.wait_until(lock, next_line(), [&] { return ended_; })) print_line_if_due();
      });
    } catch (const std::system_error&) {  // there is no room for a thread; the work goes on without lines
    }
    ::pthread_sigmask(SIG_SETMASK, &before, nullptr);
  }

  // `done` is the share of the work, 0 to 1.
  void show(double done, const std::string& what) {
    if (!on_) return;
    const std::lock_guard lock(mutex_);
    what_ = what;
    if (!is_terminal_) return print_line_if_due();
    const std::string left = time_left(seconds(), done);
    const int width = 30, filled = int(width * std::clamp(done, 0.0, 1.0));
    std::fprintf(stderr, "\r[%s%s] %s%s%s\033[K", std::string(filled, '=').c_str(),
                 std::string(width - filled, ' ').c_str(), what.c_str(), left.empty() ? "" : ", ",
                 left.c_str());
    std::fflush(stderr);
  }
  void clear() {
    if (on_ && is_terminal_) std::fprintf(stderr, "\r\033[K");
  }

 private:
  using Clock = std::chrono::steady_clock;

  double seconds() const { return std::chrono::duration<double>(Clock::now() - began_).count(); }
  Clock::time_point next_line() const {
    return last_line_ + std::chrono::duration_cast<Clock::duration>(interval_);
  }
  void print_line_if_due() {
    if (Clock::now() < next_line()) return;
    last_line_ = Clock::now();
    // Not how long the rest takes: within one long step that would be a guess that grows.
    if (!what_.empty())
      std::fprintf(stderr, "%s: after %ld min: %s\n", program_, std::lround(seconds() / 60), what_.c_str());
  }

  const char* program_;
  bool on_, is_terminal_;
  std::chrono::duration<double> interval_;
  Clock::time_point began_ = Clock::now(), last_line_ = began_;
  std::mutex mutex_;  // of what the thread reads
  std::condition_variable end_;
  bool ended_ = false;
  std::string what_;
  std::thread thread_;
};

}  // namespace padder
