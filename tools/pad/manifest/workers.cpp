// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/pad/manifest/workers.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstring>
#include <exception>
#include <new>

#include "padding/asset/error.h"
#include "padding/asset/excerpt.h"

namespace padder {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_of(const timeval& t) { return double(t.tv_sec) + 1e-6 * double(t.tv_usec); }

double since(Clock::time_point began) { return std::chrono::duration<double>(Clock::now() - began).count(); }

bool write_all(int file, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t n = ::write(file, bytes.data(), bytes.size());
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    bytes.remove_prefix(static_cast<std::size_t>(n));
  }
  return true;
}

std::string read_all(int file) {
  std::string bytes;
  char piece[65536];
  ::lseek(file, 0, SEEK_SET);
  for (ssize_t n; (n = ::read(file, piece, sizeof piece)) > 0;)
    bytes.append(piece, static_cast<std::size_t>(n));
  return bytes;
}

constexpr int kExitedForMemory = 3;  // exit code of a worker that ran out of memory

// All that a worker does. It never returns and runs no destructor of the parent.
[[noreturn]] void run_worker(int answer, pid_t parent, const sigset_t& before, const WorkerLimits& limits,
                             const std::function<std::string()>& work) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(1);  // it ended before the line above
  ::setpgid(0, 0);                        // Ctrl-C is for the parent, and a kill reaches all that it starts
  for (const int s : {SIGINT, SIGTERM, SIGHUP, SIGPIPE, SIGCHLD}) std::signal(s, SIG_DFL);
  ::sigprocmask(SIG_SETMASK, &before, nullptr);
  const int nowhere = ::open("/dev/null", O_RDWR);
  for (const int standard : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) ::dup2(nowhere, standard);
  const rlimit no_core = {0, 0};
  ::setrlimit(RLIMIT_CORE, &no_core);
  if (limits.memory > 0) limit_memory(limits.memory);
  int code = 1;
  try {
    code = write_all(answer, work()) ? 0 : 1;
  } catch (const std::bad_alloc&) {
    code = kExitedForMemory;
  } catch (const std::exception& e) {
    code = write_all(answer, std::string("!") + e.what()) ? 0 : 1;
  }
  ::_exit(code);
}

}  // namespace

void limit_memory([[maybe_unused]] std::uint64_t bytes) {
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  rlimit memory = {};
  ::getrlimit(RLIMIT_DATA, &memory);
  memory.rlim_cur = memory.rlim_max =
      std::min<rlim_t>(memory.rlim_cur, bytes);  // a shell's lower limit holds
  ::setrlimit(RLIMIT_DATA, &memory);
#endif
}

std::uint64_t machine_memory() {
  return std::uint64_t(::sysconf(_SC_PHYS_PAGES)) * std::uint64_t(::sysconf(_SC_PAGESIZE));
}

std::string end_sentence(int status, bool late, const WorkerLimits& limits) {
  const std::string memory = "it needs more memory than " +
                             short_number(double(limits.memory) / (1 << 20), 6) +
                             " MiB: give it more with --memory, or take fewer --workers";
  if (late) return "no result after " + short_number(limits.seconds, 6) + " s: give it more with --seconds";
  if (WIFEXITED(status))
    return WEXITSTATUS(status) == kExitedForMemory ? memory : "its worker ended without a result";
  const int signal = WTERMSIG(status);
  if (signal == SIGKILL)
    return "its worker was killed from outside, maybe because the machine ran out of memory: take fewer "
           "--workers";
  return "its worker was ended by signal " + std::to_string(signal) + " (" + ::strsignal(signal) +
         "): out of its memory, or a fault of pad: try --memory, and report it";
}

Workers::Workers() {
  ::sigemptyset(&waited_);
  for (const int s : {SIGCHLD, SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction now {};
    ::sigaction(s, nullptr, &now);
    if (now.sa_handler != SIG_IGN || s == SIGCHLD) ::sigaddset(&waited_, s);
  }
  std::signal(SIGCHLD, SIG_DFL);
  ::sigprocmask(SIG_BLOCK, &waited_, &before_);
}

Workers::~Workers() {
  end_all();
  ::sigprocmask(SIG_SETMASK, &before_, nullptr);
}

void Workers::start(std::size_t job, const WorkerLimits& limits, const std::function<std::string()>& work) {
  const int answer = ::memfd_create("answer", MFD_CLOEXEC);
  const pid_t parent = ::getpid();
  const pid_t process = answer < 0 ? -1 : ::fork();
  if (process < 0) {
    const int error = errno;
    if (answer >= 0) ::close(answer);
    throw Error(std::string("no process for a worker (") + std::strerror(error) + "): take fewer --workers");
  }
  if (process == 0) run_worker(answer, parent, before_, limits, work);
  ::setpgid(process, process);  // whichever of the two comes first
  running_.push_back({job, process, answer, limits, Clock::now(), false});
}

WorkerResult Workers::reap(std::size_t at, int status, const rusage& usage) {
  const Running r = running_[at];
  running_.erase(running_.begin() + static_cast<std::ptrdiff_t>(at));
  WorkerResult result;
  result.job = r.job, result.process = r.process;
  result.answer = read_all(r.answer);
  ::close(r.answer);
  result.answered = !r.late && WIFEXITED(status) && WEXITSTATUS(status) == 0;
  if (result.answered && result.answer.starts_with('!'))
    result.answered = false, result.answer = "unexpected: " + result.answer.substr(1);
  else if (!result.answered)
    result.answer = end_sentence(status, r.late, r.limits);
  result.seconds = since(r.began);
  result.cpu_seconds = seconds_of(usage.ru_utime) + seconds_of(usage.ru_stime);
  result.memory = static_cast<std::uint64_t>(usage.ru_maxrss) << 10;
  return result;
}

void Workers::take_signal(int number) {
  if (number > 0 && number != SIGCHLD && stopped_ == 0) stopped_ = number;
}

void Workers::pause() {
  double left = 3600;
  for (const Running& r : running_)
    if (r.limits.seconds > 0 && !r.late) left = std::min(left, r.limits.seconds - since(r.began));
  left = std::max(left, 0.0);
  const timespec time = {static_cast<time_t>(left), static_cast<long>(1e9 * (left - std::floor(left)))};
  take_signal(::sigtimedwait(&waited_, nullptr, &time));
  for (Running& r : running_)
    if (!r.late && r.limits.seconds > 0 && since(r.began) >= r.limits.seconds)
      r.late = true, ::kill(-r.process, SIGKILL);
}

std::optional<WorkerResult> Workers::wait() {
  const timespec now = {0, 0};
  for (int number; (number = ::sigtimedwait(&waited_, nullptr, &now)) > 0;) take_signal(number);
  while (!running_.empty() && stopped_ == 0) {
    for (std::size_t k = 0; k < running_.size(); k++) {
      int status = 0;
      rusage usage{};
      if (::wait4(running_[k].process, &status, WNOHANG, &usage) > 0) return reap(k, status, usage);
    }
    pause();
  }
  return std::nullopt;
}

std::vector<WorkerResult> Workers::end_all() {
  for (const Running& r : running_) ::kill(-r.process, SIGKILL);
  std::vector<WorkerResult> results;
  while (!running_.empty()) {
    int status = 0;
    rusage usage{};
    if (::wait4(running_.back().process, &status, 0, &usage) < 0 && errno == EINTR) continue;
    results.push_back(reap(running_.size() - 1, status, usage));
  }
  return results;
}

}  // namespace padder
