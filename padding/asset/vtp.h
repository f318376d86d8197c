// SPDX-License-Identifier: MIT
// VTK's XML for points with data (.vtp), arrays appended as they lie in memory. Host only; no further
// library.
#pragma once
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "padding/asset/file.h"

namespace padder {

// An array of point data as the file announces it: kind 'f' or 'u' or 'i' and bytes of a number, as in
// NpyHead, and how many of them a point has.
struct VtpHead {
  std::string name;
  char kind = 'f';
  int size = 8;
  int components = 1;
};

// A file whose arrays nobody holds as a whole: the place of each is known from the heads, so that all can be
// filled side by side. Each point gets a vertex, so that ParaView shows it. Holds no more than the heads.
class VtpWriter {
 public:
  VtpWriter(std::uint64_t points, std::vector<VtpHead> heads, WriteAt write);
  // The arrays that follow those of `heads`: of each point its position, three doubles; of each vertex its
  // point, and the end of its list of points, as std::int64_t: point k is vertex k, whose list ends at k + 1.
  std::size_t positions() const { return arrays_.size() - 3; }
  std::size_t connectivity() const { return arrays_.size() - 2; }
  std::size_t offsets() const { return arrays_.size() - 1; }

  // The next bytes of the array.
  void append(std::size_t array, std::string_view bytes);
  template <class T>
  void append(std::size_t array, const std::vector<T>& values) {
    append(array, {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)});
  }
  // The same for who writes the bytes at their place in the file, which is returned: several threads can then
  // write at once.
  std::uint64_t place(std::size_t array, std::uint64_t size);
  std::uint64_t size() const { return head_.size() + end_; }  // of what the last lines follow
  // Heads, and the vertices when their arrays have got nothing. Throws Error when another array has not got
  // its bytes.
  void finish();

 private:
  struct Array {
    std::string name;
    std::uint64_t at, size, got = 0;  // from the beginning of the appended data; 8 bytes of size come first
  };
  std::string announce(const VtpHead& head);
  void append_numbers(std::size_t array, std::int64_t first);

  WriteAt write_;
  std::uint64_t points_, end_ = 0;
  std::string head_;  // all before the appended data
  std::vector<Array> arrays_;
};

}  // namespace padder
