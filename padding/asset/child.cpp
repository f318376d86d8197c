// SPDX-License-Identifier: MIT
#include <fcntl.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstddef>
#include <cstring>
#include <exception>
#include <fstream>
#include <new>
#include <vector>

#include "padding/asset/child.h"
#include "padding/asset/error.h"

namespace padder {
namespace {

constexpr int kOutOfMemory = 3;  // the child's exit status
bool here = false;               // read in this process

// From here on the kernel answers every system call with EPERM but those that take and give back memory, ask
// for the time or for random bits (the C library does both), end the process, and write to `end`. Memory
// comes from no file. Where the kernel knows no filters, there is none.
void refuse_system_calls([[maybe_unused]] int end) {
#if defined(__x86_64__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)  // they make calls of their own
  constexpr std::uint32_t kAllow = SECCOMP_RET_ALLOW, kRefuse = SECCOMP_RET_ERRNO | EPERM;
  std::vector<sock_filter> code;
  const auto load = [&](std::size_t at) {
    code.push_back(BPF_STMT(BPF_LD | BPF_W | BPF_ABS, static_cast<std::uint32_t>(at)));
  };
  const auto answer = [&](std::uint32_t what) { code.push_back(BPF_STMT(BPF_RET | BPF_K, what)); };
  // Skips `over` instructions unless what was loaded is `value`.
  const auto unless = [&](std::uint32_t value, std::uint8_t over) {
    code.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, value, 0, over));
  };
  load(offsetof(seccomp_data, arch));
  code.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, AUDIT_ARCH_X86_64, 1, 0)), answer(kRefuse);
  load(offsetof(seccomp_data, nr));
  for (const std::uint32_t call :
       {__NR_munmap, __NR_mremap, __NR_mprotect, __NR_madvise, __NR_brk, __NR_futex, __NR_rt_sigprocmask,
        __NR_rt_sigreturn, __NR_clock_gettime, __NR_gettimeofday, __NR_getrandom, __NR_exit, __NR_exit_group})
    unless(call, 1), answer(kAllow);
  struct Checked {
    std::uint32_t call, argument, value;
  };
  for (const auto& [call, argument, value] :
       {Checked{__NR_write, 0, static_cast<std::uint32_t>(end)}, Checked{__NR_mmap, 4, ~0u}}) {
    unless(call, 4), load(offsetof(seccomp_data, args) + 8 * argument);
    unless(value, 1), answer(kAllow), answer(kRefuse);
  }
  answer(kRefuse);
  const sock_fprog filter = {static_cast<unsigned short>(code.size()), code.data()};
  ::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0);
  ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &filter);
#endif
}

// The most memory that a reader may have, and the most that it may send.
rlim_t most_memory(std::size_t file_size) { return (rlim_t(4) << 30) + 100 * rlim_t(file_size); }

// What this process holds already, which a child inherits and its limit counts.
[[maybe_unused]] rlim_t memory_in_use() {
  rlim_t pages[6] = {};
  std::ifstream in("/proc/self/statm");
  for (rlim_t& p : pages) in >> p;
  return pages[5] * static_cast<rlim_t>(::sysconf(_SC_PAGESIZE));
}

void limit(int resource, rlim_t most) {
  rlimit now = {};
  ::getrlimit(static_cast<__rlimit_resource>(resource), &now);
  now.rlim_cur = std::min(now.rlim_cur, most);  // the caller's limits hold where they are lower
  ::setrlimit(static_cast<__rlimit_resource>(resource), &now);
}

// Where a standard stream is closed, a pipe could take its number, and the child's dup2() would end the pipe.
bool open_pipe(int (&ends)[2]) {
  if (::pipe2(ends, O_CLOEXEC) != 0) return false;
  for (int& end : ends)
    if (end <= STDERR_FILENO) {
      const int above = ::fcntl(end, F_DUPFD_CLOEXEC, STDERR_FILENO + 1), error = errno;
      ::close(end), errno = error;
      end = above;
    }
  if (ends[0] >= 0 && ends[1] >= 0) return true;
  const int error = errno;
  for (const int end : ends)
    if (end >= 0) ::close(end);
  errno = error;
  return false;
}

// All that the child does. It never returns, runs no destructor of the parent and leaves no core file.
[[noreturn]] void run_child(int end, const std::function<void()>& read,
                            const std::function<bool(ChildPipe&)>& send, std::size_t file_size) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);  // it ends with whoever waits for it
  const int nowhere = ::open("/dev/null", O_WRONLY);
  if (nowhere >= 0)
    ::dup2(nowhere, STDOUT_FILENO), ::dup2(nowhere, STDERR_FILENO);  // failed assertions print there
  for (const int signal :
       {SIGABRT, SIGSEGV, SIGFPE, SIGBUS, SIGILL, SIGXCPU, SIGALRM, SIGINT, SIGTERM, SIGHUP, SIGPIPE})
    std::signal(signal, SIG_DFL);
  const rlim_t seconds = 30 + file_size / 1000000;  // 1 MB takes well under one
  limit(RLIMIT_CORE, 0), limit(RLIMIT_CPU, seconds);
  ::alarm(static_cast<unsigned>(20 * seconds));  // ends a reader that waits instead of working
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // sanitizers reserve terabytes
  limit(RLIMIT_DATA, memory_in_use() + most_memory(file_size));
#endif
  refuse_system_calls(end);
  here = true;
  ChildPipe pipe(end, most_memory(file_size));
  try {
    std::string error;
    try {
      read();
    } catch (const std::bad_alloc&) {
      throw;
    } catch (const std::exception& e) {
      error = e.what();
    }
    ::_exit(pipe.put_array(error) && (!error.empty() || send(pipe)) && pipe.flush() ? 0 : 1);
  } catch (const std::bad_alloc&) {
    ::_exit(kOutOfMemory);
  } catch (...) {
    ::_exit(1);
  }
}

}  // namespace

ChildPipe::ChildPipe(int end, std::uint64_t most) : end_(end), most_(most) {}
ChildPipe::~ChildPipe() { ::close(end_); }

bool ChildPipe::flush() {
  for (std::string_view left = buffer_; !left.empty();) {
    const ssize_t n = ::write(end_, left.data(), left.size());
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    left.remove_prefix(static_cast<std::size_t>(n));
  }
  buffer_.clear();
  return true;
}

bool ChildPipe::put_bytes(const void* data, std::size_t size) {
  for (const char* at = static_cast<const char*>(data); size > 0;) {
    const std::size_t part = std::min(size, kBuffer - buffer_.size());
    buffer_.append(at, part);
    at += part, size -= part;
    if (buffer_.size() == kBuffer && !flush()) return false;
  }
  return true;
}

bool ChildPipe::get_bytes(void* data, std::size_t size) {
  if (size > most_) return false;
  most_ -= size;
  for (char* at = static_cast<char*>(data); size > 0;) {
    if (at_ == buffer_.size()) {
      buffer_.resize(kBuffer), at_ = 0;
      ssize_t n;
      do n = ::read(end_, buffer_.data(), kBuffer);
      while (n < 0 && errno == EINTR);
      buffer_.resize(n > 0 ? static_cast<std::size_t>(n) : 0);
      if (n <= 0) return false;
    }
    const std::size_t part = std::min(size, buffer_.size() - at_);
    std::memcpy(at, buffer_.data() + at_, part);
    at += part, at_ += part, size -= part;
  }
  return true;
}

void read_here(bool on) { here = on; }
bool reads_here() { return here; }

void in_child(const std::function<void()>& read, const std::function<bool(ChildPipe&)>& send,
              const std::function<bool(ChildPipe&)>& receive, std::size_t file_size,
              const std::string& where) {
  if (here) return read();
  int ends[2];
  if (!open_pipe(ends)) throw Error(where + ": no pipe to read it through: " + std::strerror(errno));
  const pid_t child = ::fork();
  if (child == 0) ::close(ends[0]), run_child(ends[1], read, send, file_size);
  const int fork_error = errno;
  ::close(ends[1]);
  bool whole = false;
  std::string error;
  std::exception_ptr thrown;
  try {  // the pipe is closed behind it, which ends a child that still writes
    ChildPipe pipe(ends[0], most_memory(file_size));
    if (child < 0) throw Error(where + ": no process to read it in: " + std::strerror(fork_error));
    whole = pipe.get_array(error) && (!error.empty() || receive(pipe));
  } catch (...) {
    thrown = std::current_exception();
  }
  int status = 0;
  while (child > 0 && ::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (thrown) std::rethrow_exception(thrown);
  if (whole && !error.empty()) throw Error(error);
  if (whole) return;
  if (WIFEXITED(status) && WEXITSTATUS(status) == kOutOfMemory)
    throw Error(where + ": the reader ran out of memory on it: the file is damaged or too large, split it");
  const int signal = WIFSIGNALED(status) ? WTERMSIG(status) : 0;
  const bool late = signal == SIGXCPU || signal == SIGALRM || signal == SIGKILL;
  throw Error(where + (late ? ": the reader came to no end on it" : ": the reader crashed on it") +
              ": the file is damaged, or has something that the reader does not know: export it again or in "
              "another format");
}

}  // namespace padder
