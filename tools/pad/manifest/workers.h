// SPDX-License-Identifier: GPL-3.0-or-later
// Processes that each do one job, with a limit of time and of memory: a crash, an endless loop or endless
// memory ends one job and no other.
#pragma once
#include <sys/resource.h>
#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace padder {

// Zero means no limit.
struct WorkerLimits {
  double seconds = 0;        // on the clock
  std::uint64_t memory = 0;  // bytes that it may allocate
};

// What this process and its children may allocate from now on, in bytes: beyond it allocations fail. Nothing
// under AddressSanitizer, which reserves terabytes.
void limit_memory(std::uint64_t bytes);
std::uint64_t machine_memory();  // bytes

// How a worker ended.
struct WorkerResult {
  std::size_t job = 0;  // the number that start() was given
  pid_t process = 0;    // gone
  bool answered = false;
  std::string answer;  // what the job returned; or a sentence about how it ended without an answer
  double seconds = 0, cpu_seconds = 0;
  std::uint64_t memory = 0;  // bytes, its peak
};

// Forks a process for each job. Make it before the program starts a thread, because only the forking thread
// lives on in a worker. While it lives, SIGINT, SIGTERM and SIGHUP end no more than a wait. A worker dies
// with its parent, however that ends.
class Workers {
 public:
  Workers();
  ~Workers();  // ends those that are left
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  std::size_t running() const { return running_.size(); }

  // `work` runs in the new process, which prints nothing and whose only result is the returned text. Throws
  // Error when there is no process to be had.
  void start(std::size_t job, const WorkerLimits& limits, const std::function<std::string()>& work);

  // Waits for a worker to end. Nothing if none is running, or if a signal asked to stop: then stopped() is
  // its number.
  std::optional<WorkerResult> wait();
  int stopped() const { return stopped_; }

  // Ends all and returns their results: some may have answered just before.
  std::vector<WorkerResult> end_all();

 private:
  struct Running {
    std::size_t job;
    pid_t process;
    int answer;  // a file in memory, because a pipe holds little and would have to be emptied all the time
    WorkerLimits limits;
    std::chrono::steady_clock::time_point began;
    bool late;
  };
  void pause();  // until a worker or a signal may want something, or a limit is reached
  void take_signal(int number);
  WorkerResult reap(std::size_t at, int status, const rusage& usage);

  std::vector<Running> running_;
  sigset_t waited_{}, before_{};
  int stopped_ = 0;
};

// The sentence for a job that ended with a signal or a status, without an answer.
std::string end_sentence(int status, bool late, const WorkerLimits& limits);

}  // namespace padder
