// SPDX-License-Identifier: GPL-3.0-or-later
// Long work that Ctrl-C ends.
#pragma once
#include <pybind11/pybind11.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "padding/pad.h"

namespace padder::python {

// How many threads are at work, on what was given up as well.
inline std::atomic<int>& at_work() {
  static std::atomic<int> count{0};
  return count;
}

// Runs `work(progress)` in a thread of its own, without the interpreter's lock, and returns its result or
// throws what it threw. When a signal arrives and Python's handler for it raises an exception, as that of
// Ctrl-C does, the exception is thrown within a tenth of a second. The work is then given up: it ends at its
// next call of `progress`, and nobody sees its result. `work` must own all that it uses.
template <class Work>
auto interruptible(Work work) {
  using Result = decltype(work(PadProgress()));
  struct Stop {};
  struct State {
    std::mutex mutex;
    std::condition_variable changed;
    std::optional<Result> result;
    std::exception_ptr error;
    bool finished = false;
    std::atomic<bool> stop{false};
  };
  const auto state = std::make_shared<State>();
  at_work()++;
  std::thread([state, work = std::move(work)]() mutable {
    const PadProgress progress = [&](const char*, int, int) {
      if (state->stop) throw Stop();
    };
    std::optional<Result> result;
    std::exception_ptr error;
    try {
      result = work(progress);
    } catch (...) {
      error = std::current_exception();
    }
    const std::lock_guard lock(state->mutex);
    state->result = std::move(result), state->error = error, state->finished = true;
    state->changed.notify_all();
    at_work()--;
  }).detach();
  for (;;) {
    {
      const pybind11::gil_scoped_release release;
      std::unique_lock lock(state->mutex);
      if (state->changed.wait_for(lock, std::chrono::milliseconds(100), [&] { return state->finished; }))
        break;
    }
    if (PyErr_CheckSignals() != 0) {
      state->stop = true;
      throw pybind11::error_already_set();
    }
  }
  if (state->error) std::rethrow_exception(state->error);
  return std::move(*state->result);
}

}  // namespace padder::python
