// SPDX-License-Identifier: GPL-3.0-or-later
// Work without the interpreter's lock, also in a process that was forked.
#pragma once
#include <pybind11/pybind11.h>
#include <unistd.h>

#include <future>

namespace padder::python {

inline const pid_t kLoadedBy = getpid();

// Returns what `work()` returns, or throws what it throws. A child of fork(), as multiprocessing makes it,
// has none of the threads that OpenMP keeps for the thread that forked, and that thread would wait for them
// for ever. There a new thread does the work, for which OpenMP starts threads of its own.
template <class Work>
auto unlocked(Work work) {
  const pybind11::gil_scoped_release release;
  if (getpid() == kLoadedBy) return work();
  return std::async(std::launch::async, work).get();
}

}  // namespace padder::python
