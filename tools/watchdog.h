// SPDX-License-Identifier: MIT
// Ends the process with a sentence when something takes longer than allowed. A call that hangs on a GPU
// cannot be cancelled; without this it would block the machine silently.
#pragma once
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <list>
#include <mutex>
#include <string>
#include <thread>

namespace padder {

// While an object lives, its scope has `seconds` to end. After that the watchdog writes "NAME: no answer
// after 60 s, ended" to stderr and ends the process with the code 124, as timeout(1) does. It runs no
// destructors and flushes nothing, because both could wait for what hangs.
//
// The environment variable PADDER_WATCHDOG multiplies every limit, for slow machines and instruments
// (compute-sanitizer, valgrind). 0 switches the watchdog off.
//
// Construction and destruction each take a lock, some 100 ns together, so a watchdog may stand around what is
// timed. One thread of the process checks all scopes four times a second. Scopes may be nested, and may be in
// several threads.
class Watchdog {
 public:
  static constexpr int kEnded = 124;

  explicit Watchdog(const char* name, double seconds = 60) {
    const double factor = limit_factor();
    if (factor <= 0) return;
    Watched& all = watched();
    const std::lock_guard lock(all.mutex);
    scope_ = all.scopes.insert(all.scopes.end(), {name, seconds * factor, Clock::now()});
    on_ = true;
  }
  ~Watchdog() {
    if (!on_) return;
    Watched& all = watched();
    const std::lock_guard lock(all.mutex);
    all.scopes.erase(scope_);
  }
  Watchdog(const Watchdog&) = delete;
  Watchdog& operator=(const Watchdog&) = delete;

  // PADDER_WATCHDOG, or 1.
  static double limit_factor() {
    static const double factor = [] {
      const char* text = std::getenv("PADDER_WATCHDOG");
      char* end = nullptr;
      const double value = text ? std::strtod(text, &end) : 1;
      return text && (end == text || *end || !std::isfinite(value)) ? 1 : value;
    }();
    return factor;
  }

 private:
  using Clock = std::chrono::steady_clock;
  struct Scope {
    std::string name;
    double seconds;
    Clock::time_point began;
  };
  struct Watched {
    std::mutex mutex;
    std::list<Scope> scopes;
  };

  // Made once and never destroyed: the thread outlives main.
  static Watched& watched() {
    static Watched& all = *[] {
      auto* const made = new Watched;
      std::thread([made] { watch(*made); }).detach();
      return made;
    }();
    return all;
  }

  [[noreturn]] static void watch(Watched& all) {
    for (;;) {
      std::this_thread::sleep_for(std::chrono::milliseconds(250));
      const std::lock_guard lock(all.mutex);
      for (const Scope& s : all.scopes)
        if (std::chrono::duration<double>(Clock::now() - s.began).count() > s.seconds) end(s);
    }
  }

  [[noreturn]] static void end(const Scope& s) {
    char seconds[32];
    std::snprintf(seconds, sizeof seconds, "%.6g", s.seconds);
    const std::string sentence = s.name + ": no answer after " + seconds + " s, ended\n";
    // Not with stdio: the thread that hangs may hold its lock.
    [[maybe_unused]] const auto written = ::write(STDERR_FILENO, sentence.data(), sentence.size());
    ::_exit(kEnded);
  }

  bool on_ = false;
  std::list<Scope>::iterator scope_;
};

}  // namespace padder
