// SPDX-License-Identifier: MIT
#include "padding/asset/child.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <new>
#include <random>
#include <vector>

#include "padding/asset/error.h"
#include "padding/asset/json.h"
#include "tests/error_of.h"

namespace padder {
namespace {

using Work = std::function<void()>;
using Talk = std::function<bool(ChildPipe&)>;
const Talk kNothing = [](ChildPipe&) { return true; };

std::string sentence(const Work& read, const Talk& send = kNothing, const Talk& receive = kNothing) {
  return error_of([&] { in_child(read, send, receive, 0, "t.fbx"); });
}
const std::string kCrashed =
    "t.fbx: the reader crashed on it: the file is damaged, or has something that the reader does not know: "
    "export it again or in another format";

TEST(Child, WhateverHappensThereIsASentenceHere) {
  EXPECT_EQ(sentence([] { throw Error("t.fbx: a reason"); }), "t.fbx: a reason");
  EXPECT_EQ(sentence([] { throw std::bad_alloc(); }).find("t.fbx: the reader ran out of memory"), 0u);
  EXPECT_EQ(sentence([] { std::abort(); }), kCrashed);
  EXPECT_EQ(sentence([] {}, [](ChildPipe&) -> bool { std::abort(); }), kCrashed);
  EXPECT_EQ(
      sentence([] {}, [](ChildPipe&) -> bool { throw std::bad_alloc(); }, [](ChildPipe&) { return false; })
          .find("t.fbx: the reader ran out of memory"),
      0u);
  rlimit time = {};
  ::getrlimit(RLIMIT_CPU, &time);
  const rlimit soon = {1, time.rlim_max};
  std::signal(SIGXCPU, SIG_IGN);  // this process may have used more
  ::setrlimit(RLIMIT_CPU, &soon);
  EXPECT_EQ(sentence([] {
              for (volatile bool on = true; on;) {
              }
            }).find("t.fbx: the reader came to no end"),
            0u);
  ::setrlimit(RLIMIT_CPU, &time);
  std::signal(SIGXCPU, SIG_DFL);
}

TEST(Child, ReadsWhereTheStandardStreamsAreClosed) {
  const pid_t process = ::fork();
  if (process == 0) {  // a process of its own, which needs none of them
    for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) ::close(stream);
    int got = 0;
    try {
      in_child([] {}, [](ChildPipe& pipe) { return pipe.put(7); },
               [&](ChildPipe& pipe) { return pipe.get(got); }, 0, "t.fbx");
    } catch (const Error&) {
    }
    ::_exit(got);
  }
  int status = 0;
  ::waitpid(process, &status, 0);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 7) << status;
}

TEST(Child, ArraysComeBackAndTheirEndIsSeen) {
  const std::vector<double> sent(100000, 0.1);
  std::vector<double> back;
  int number = 0;
  in_child([] {}, [&](ChildPipe& pipe) { return pipe.put_array(sent) && pipe.put(7); },
           [&](ChildPipe& pipe) { return pipe.get_array(back) && pipe.get(number); }, 0, "t");
  EXPECT_EQ(back, sent);
  EXPECT_EQ(number, 7);
  const Talk longer = [&](ChildPipe& pipe) { return pipe.get_array(back); };
  EXPECT_EQ(
      sentence([] {}, [](ChildPipe& pipe) { return pipe.put<std::uint64_t>(1'000'000'000'000); }, longer),
      kCrashed);
}

// Who has what he needs may leave: the child that still sends ends, and is waited for.
TEST(Child, AnErrorHereEndsAChildThatSendsWithoutEnd) {
  const Talk endless = [](ChildPipe& pipe) {
    while (pipe.put(1)) {
    }
    return false;
  };
  EXPECT_EQ(sentence([] {}, endless, [](ChildPipe&) -> bool { throw Error("seen enough"); }), "seen enough");
  EXPECT_EQ(::waitpid(-1, nullptr, WNOHANG), -1);
}

// What this process holds already is not the reader's.
TEST(Child, MayHaveItsMemoryBesideALargeProcess) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "a sanitizer's process has no limit of memory";
#endif
  constexpr std::size_t five = std::size_t(5) << 30;
  void* const large =
      ::mmap(nullptr, five, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  ASSERT_NE(large, MAP_FAILED);
  EXPECT_EQ(sentence([] { std::vector<char>(100'000'000, 'x'); }), "");
  void* volatile held = nullptr;
  const auto take = [&] { held = ::operator new(five); };
  EXPECT_EQ(sentence(take).find("t.fbx: the reader ran out of memory"), 0u);
  ::munmap(large, five);
}

// A file that takes over its reader has nothing to call.
TEST(Child, MayOnlyCompute) {
#if !defined(__x86_64__) || defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "system calls are restricted on x86-64, and not under a sanitizer, which makes its own";
#endif
  const int here = ::open("/dev/null", O_RDWR);
  ASSERT_GE(here, 0);
  const std::pair<const char*, std::function<long()>> calls[] = {
      {"open a file", [] { return ::open("/dev/null", O_RDONLY); }},
      {"make a file", [] { return ::open("made by a reader", O_WRONLY | O_CREAT, 0600); }},
      {"read an open file",
       [here] {
         char c = 0;
         return ::read(here, &c, 1);
       }},
      {"write to an open file", [here] { return ::write(here, "x", 1); }},
      {"map a file", [here] { return long(::mmap(nullptr, 1, PROT_READ, MAP_PRIVATE, here, 0)); }},
      {"make a socket", [] { return ::socket(AF_INET, SOCK_STREAM, 0); }},
      {"start a process", [] { return ::syscall(SYS_clone, SIGCHLD, 0, 0, 0, 0); }},
      {"start a program", [] { return ::execl("/bin/true", "true", nullptr); }},
      {"raise a signal", [] { return ::kill(::getppid(), 0); }},
      {"raise a limit",
       [] {
         const rlimit none = {RLIM_INFINITY, RLIM_INFINITY};
         return ::setrlimit(RLIMIT_CORE, &none);
       }},
      {"remove a file", [] { return ::unlink("not there"); }}};
  std::string possible;
  in_child(
      [&] {
        for (const auto& [what, call] : calls) {
          errno = 0;
          const long answer = call();
          if (answer != -1 || errno != EPERM) possible += std::string(what) + ", ";
        }
        const std::vector<char> memory(200'000'000, 'x');  // there is some
      },
      [&](ChildPipe& pipe) { return pipe.put_array(possible); },
      [&](ChildPipe& pipe) { return pipe.get_array(possible); }, 0, "t.obj");
  ::close(here);
  EXPECT_EQ(possible, "");
}

TEST(Child, JsonIsWhatTheTextSays) {
  const std::string text =
      R"({"a": [1, -2, 0.5, true, false, null, {"b": "\u00fc"}, []], "c": {}, "d": 18446744073709551615})";
  EXPECT_EQ(parse_json<nlohmann::json>(text, "t"), nlohmann::json::parse(text));
  EXPECT_EQ(parse_json<nlohmann::ordered_json>(text, "t"), nlohmann::ordered_json::parse(text));
}

// What a child says that a file has taken over is a document, or nothing.
TEST(Child, NothingThatItSaysOfJsonBreaksTheDocument) {  // seed 3
  std::mt19937 random(3);
  const std::string events = "nnttfiudsskkk{{[[]]!.x";
  int documents = 0;
  for (int k = 0; k < 20000; k++) {
    std::string said;
    for (auto left = 1 + random() % 12; left > 0; left--) {
      const char event = events[random() % events.size()];
      said += event;
      if (event == 'i' || event == 'u' || event == 'd' || event == '!') said.append(8, char(random() % 3));
      if (event == 's' || event == 'k' || event == '!')
        said += std::string("\1\0\0\0\0\0\0\0", 8) + char('a' + random() % 3);
    }
    int ends[2];
    ASSERT_EQ(::pipe(ends), 0);
    ASSERT_EQ(::write(ends[1], said.data(), said.size()), ssize_t(said.size()));
    ::close(ends[1]);
    ChildPipe pipe(ends[0], 1000);
    nlohmann::json document;
    try {
      const bool whole = receive_json(pipe, document, "text", "t");
      EXPECT_EQ(nlohmann::json::parse(document.dump()), document);
      documents += whole;
    } catch (const Error&) {  // a key that stands twice, a fault in the text
    }
  }
  EXPECT_GT(documents, 100);
}

}  // namespace
}  // namespace padder
