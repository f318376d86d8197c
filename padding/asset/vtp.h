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
  // Behind what the array has got. The one behind those of `heads` is the positions, three doubles a point.
  void append(std::size_t array, std::string_view bytes);
  template <class T>
  void append(std::size_t array, const std::vector<T>& values) {
    append(array, {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)});
  }
  void finish();  // heads and vertices; throws Error when an array has not got its bytes

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
