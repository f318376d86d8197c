// SPDX-License-Identifier: MIT
// Reads an untrusted file in a process of its own. A crash on a damaged file does not end this process, and a
// file that takes over its reader can do no harm. Not installed.
#pragma once
#include <cstdint>
#include <functional>
#include <string>
#include <type_traits>

namespace padder {

// One end of the pipe between a child and its parent, with a buffer. A function that returns false has
// failed: nobody is at the other end, or it has sent more than it may.
class ChildPipe {
 public:
  ChildPipe(int end, std::uint64_t most);  // takes at most so many bytes; closes `end` when it is destroyed
  ~ChildPipe();
  ChildPipe(const ChildPipe&) = delete;
  ChildPipe& operator=(const ChildPipe&) = delete;

  template <class T>
  bool put(T number) {
    static_assert(std::is_arithmetic_v<T>);
    return put_bytes(&number, sizeof number);
  }
  template <class T>
  bool get(T& number) {
    static_assert(std::is_arithmetic_v<T>);
    return get_bytes(&number, sizeof number);
  }
  // Strings and vectors of plain numbers, points or indices.
  template <class Array>
  bool put_array(const Array& array) {
    return put<std::uint64_t>(array.size()) && put_bytes(array.data(), array.size() * sizeof(array[0]));
  }
  template <class Array>
  bool get_array(Array& array) {
    std::uint64_t left = 0;
    if (!get(left)) return false;
    for (array.clear(); left > 0;) {  // memory follows what has come, not what was announced
      const std::uint64_t begin = array.size(), more = left < kBuffer ? left : kBuffer;
      array.resize(begin + more), left -= more;
      if (!get_bytes(array.data() + begin, more * sizeof(array[0]))) return false;
    }
    return true;
  }
  bool flush();

 private:
  static constexpr std::size_t kBuffer = 1 << 16;
  bool put_bytes(const void* data, std::size_t size);
  bool get_bytes(void* data, std::size_t size);

  int end_;
  std::uint64_t most_;
  std::string buffer_;
  std::size_t at_ = 0;  // what comes next in the buffer
};

// Calls `read` in a forked process, `send` there after it, and `receive` here, which takes what was sent.
// An Error of `read` is thrown here; a crash, an abort, an endless loop or endless memory there becomes an
// Error, which begins with `where`. So does a `receive` that returns false. It must check what it gets: a
// file that has taken over the reader can make it send anything.
//
// The process has 30 s and 4 GiB, and more for large files, and may send as much. It may take and give back
// memory and write to this process, and the kernel refuses every other system call (on x86-64): it opens,
// reads, sends and starts nothing. Only the calling thread lives on in it, so `read` and `send` must not wait
// for another thread or use OpenMP. It costs about a millisecond. Inside such a process, `read` is just
// called.
void in_child(const std::function<void()>& read, const std::function<bool(ChildPipe&)>& send,
              const std::function<bool(ChildPipe&)>& receive, std::size_t file_size,
              const std::string& where);

// For fuzzers, which must see the branches that a reader takes: in_child just calls `read`.
void read_here(bool here);
bool reads_here();

}  // namespace padder
