// SPDX-License-Identifier: MIT
// Runs a reader in a process of its own, so that a crash on a damaged file does not end this one.
#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
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
    array.resize(size);
    return get(array.data(), size * sizeof(array[0]));
  }

 private:
  int end_;
};

// All that the child does. It never returns, runs no destructor of the parent and leaves no core file.
[[noreturn]] void run_child(int end, const std::function<Soup()>& read, std::size_t file_size) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);  // it ends with whoever waits for it
  const int nowhere = ::open("/dev/null", O_WRONLY);
  if (nowhere >= 0)
    ::dup2(nowhere, STDOUT_FILENO), ::dup2(nowhere, STDERR_FILENO);  // failed assertions print there
  for (const int signal :
       {SIGABRT, SIGSEGV, SIGFPE, SIGBUS, SIGILL, SIGXCPU, SIGALRM, SIGINT, SIGTERM, SIGHUP})
    std::signal(signal, SIG_DFL);
  const rlimit no_core = {0, 0};
  ::setrlimit(RLIMIT_CORE, &no_core);
  const std::size_t seconds = 30 + file_size / 1000000;  // 1 MB takes well under one second
  const rlimit time = {seconds, seconds};
  ::setrlimit(RLIMIT_CPU, &time);
  ::alarm(static_cast<unsigned>(20 * time.rlim_cur));  // ends a reader that waits instead of working
#if !defined(__SANITIZE_ADDRESS__)                     // AddressSanitizer reserves terabytes
  rlimit memory = {};
  ::getrlimit(RLIMIT_DATA, &memory);  // the caller's limit holds where it is lower
  memory.rlim_cur = std::min<rlim_t>(memory.rlim_cur, (rlim_t(4) << 30) + 100 * file_size);
  ::setrlimit(RLIMIT_DATA, &memory);
#endif
  Pipe pipe(end);
  std::string error;
  Soup soup;
  try {
    soup = read();
  } catch (const std::bad_alloc&) {
    error = "?out of memory";
  } catch (const std::exception& e) {
    error = e.what();
  }
  std::string notes;  // one line each
  for (const std::string& note : soup.notes) notes += note + '\n';
  bool sent = pipe.put_array(error);
  if (error.empty())
    sent = sent && pipe.put_array(soup.points) && pipe.put_array(soup.corners) && pipe.put_array(soup.ends) &&
           pipe.put(&soup.thin, sizeof soup.thin) && pipe.put_array(soup.unit) && pipe.put_array(notes);
  ::_exit(sent ? 0 : 1);
}

}  // namespace

Soup in_child(const std::function<Soup()>& read, std::size_t file_size, const std::string& where) {
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0)
    fail(where, std::string("no pipe to read it through: ") + std::strerror(errno));
  const pid_t child = ::fork();
  if (child == 0) ::close(ends[0]), run_child(ends[1], read, file_size);
  const int fork_error = errno;
  ::close(ends[1]);
  Pipe pipe(ends[0]);
  if (child < 0) fail(where, std::string("no process to read it in: ") + std::strerror(fork_error));

  Soup soup;
  std::string error, notes;
  bool whole = pipe.get_array(error);
  if (error.empty())
    whole = whole && pipe.get_array(soup.points) && pipe.get_array(soup.corners) &&
            pipe.get_array(soup.ends) && pipe.get(&soup.thin, sizeof soup.thin) &&
            pipe.get_array(soup.unit) && pipe.get_array(notes);
  Lines lines(notes);
  for (std::string_view note; lines.next(note);) soup.notes.emplace_back(note);
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
  return soup;
}

}  // namespace padder::reading
