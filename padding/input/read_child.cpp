// SPDX-License-Identifier: MIT
// Runs a reader in a process of its own, so that a crash on a damaged file does not end this one, and a
// reader that a file has taken over can do nothing.
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
#include <new>

#include "padding/input/read_internal.h"

namespace padder::reading {
namespace {

class Pipe {
 public:
  Pipe(int end) : end_(end) {}
  ~Pipe() { ::close(end_); }
  Pipe(const Pipe&) = delete;
  Pipe& operator=(const Pipe&) = delete;

  bool put(const void* data, std::size_t size) {
    for (const char* at = static_cast<const char*>(data); size > 0;) {
      const ssize_t n = ::write(end_, at, size);
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) return false;
      at += n, size -= static_cast<std::size_t>(n);
    }
    return true;
  }
  bool get(void* data, std::size_t size) {
    for (char* at = static_cast<char*>(data); size > 0;) {
      const ssize_t n = ::read(end_, at, size);
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) return false;
      at += n, size -= static_cast<std::size_t>(n);
    }
    return true;
  }
  template <class Array>
  bool put_array(const Array& array) {
    const std::uint64_t size = array.size();
    return put(&size, sizeof size) && put(array.data(), size * sizeof(array[0]));
  }
  template <class Array>
  bool get_array(Array& array) {
    std::uint64_t size = 0;
    if (!get(&size, sizeof size)) return false;
    while (array.size() < size) {  // memory follows what has come, not what was announced
      const std::uint64_t begin = array.size(), more = std::min<std::uint64_t>(size - begin, 1 << 20);
      array.resize(begin + more);
      if (!get(&array[begin], more * sizeof(array[0]))) return false;
    }
    return true;
  }

 private:
  int end_;
};

// From here on the kernel answers every system call with EPERM but those that take and give back memory, ask
// for the time or for random bits (the C library does both), end the process, and write to `end`. Memory
// comes from no file. Where the kernel knows no filters, there is none.
void refuse_system_calls(int end) {
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

// All that the child does. It never returns, runs no destructor of the parent and leaves no core file.
[[noreturn]] void run_child(int end, const std::function<ReadResult()>& read, std::size_t file_size) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);  // it ends with whoever waits for it
  const int nowhere = ::open("/dev/null", O_WRONLY);
  if (nowhere >= 0)
    ::dup2(nowhere, STDOUT_FILENO), ::dup2(nowhere, STDERR_FILENO);  // failed assertions print there
  for (const int signal :
       {SIGABRT, SIGSEGV, SIGFPE, SIGBUS, SIGILL, SIGXCPU, SIGALRM, SIGINT, SIGTERM, SIGHUP})
    std::signal(signal, SIG_DFL);
  const rlimit no_core = {0, 0};
  ::setrlimit(RLIMIT_CORE, &no_core);
  // The caller's limits hold where they are lower. 1 MB takes well under one second.
  rlimit time = {};
  ::getrlimit(RLIMIT_CPU, &time);
  time.rlim_cur = std::min<rlim_t>(time.rlim_cur, 30 + file_size / 1000000);
  ::setrlimit(RLIMIT_CPU, &time);
  ::alarm(static_cast<unsigned>(20 * time.rlim_cur));  // ends a reader that waits instead of working
#if !defined(__SANITIZE_ADDRESS__)                     // AddressSanitizer reserves terabytes
  rlimit memory = {};
  ::getrlimit(RLIMIT_DATA, &memory);
  memory.rlim_cur = std::min<rlim_t>(memory.rlim_cur, (rlim_t(4) << 30) + 100 * file_size);
  ::setrlimit(RLIMIT_DATA, &memory);
#endif
  refuse_system_calls(end);
  Pipe pipe(end);
  std::string error;
  ReadResult result;
  try {
    result = read();
  } catch (const std::bad_alloc&) {
    error = "?out of memory";
  } catch (const std::exception& e) {
    error = e.what();
  }
  std::string notes;  // one line each
  for (const std::string& note : result.notes) notes += note + '\n';
  bool sent = pipe.put_array(error);
  if (error.empty())
    sent = sent && pipe.put_array(result.mesh.points) && pipe.put_array(result.mesh.triangles) &&
           pipe.put_array(result.unit) && pipe.put_array(notes);
  ::_exit(sent ? 0 : 1);
}

}  // namespace

ReadResult in_child(const std::function<ReadResult()>& read, std::size_t file_size,
                    const std::string& where) {
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0)
    fail(where, std::string("no pipe to read it through: ") + std::strerror(errno));
  const pid_t child = ::fork();
  if (child == 0) ::close(ends[0]), run_child(ends[1], read, file_size);
  const int fork_error = errno;
  ::close(ends[1]);
  Pipe pipe(ends[0]);
  if (child < 0) fail(where, std::string("no process to read it in: ") + std::strerror(fork_error));

  ReadResult result;
  std::string error, notes;
  bool whole = pipe.get_array(error);
  if (error.empty())
    whole = whole && pipe.get_array(result.mesh.points) && pipe.get_array(result.mesh.triangles) &&
            pipe.get_array(result.unit) && pipe.get_array(notes);
  // A reader that a file has taken over may send anything.
  for (const auto& triangle : result.mesh.triangles)
    for (const std::uint32_t corner : triangle) whole = whole && corner < result.mesh.points.size();
  Lines lines(notes);
  for (std::string_view note; lines.next(note);) result.notes.emplace_back(note);
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (!whole) {
    const int signal = WIFSIGNALED(status) ? WTERMSIG(status) : 0;
    const bool late = signal == SIGXCPU || signal == SIGALRM || signal == SIGKILL;
    fail(where, std::string(late ? "the reader came to no end on it" : "the reader crashed on it") +
                    ": the file is damaged, export it again or in another format");
  }
  if (error == "?out of memory")
    fail(where, "the reader ran out of memory on it: the file is damaged or too large, split the mesh");
  if (!error.empty()) throw Error(error);
  return result;
}

}  // namespace padder::reading
