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

// Writes a file and holds only the heads of its arrays. The heads tell where each array goes, so several
// threads can fill the arrays at once. Each point gets a vertex, so that ParaView shows it.
class VtpWriter {
 public:
  // `fields` is XML of DataArrays that are about the file as a whole.
  VtpWriter(std::uint64_t points, std::vector<VtpHead> heads, WriteAt write, const std::string& fields = {});
  // Three arrays follow those of `heads`: the position of each point, three doubles; the point of each
  // vertex; and where the list of points of each vertex ends. The last two are std::int64_t. Vertex k is
  // point k, and its list ends at k + 1.
  std::size_t positions() const { return arrays_.size() - 3; }
  std::size_t connectivity() const { return arrays_.size() - 2; }
  std::size_t offsets() const { return arrays_.size() - 1; }

  // Writes the next bytes of the array.
  void append(std::size_t array, std::string_view bytes);
  template <class T>
  void append(std::size_t array, const std::vector<T>& values) {
    append(array, {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)});
  }
  // The same, but the caller writes the bytes: returns their place in the file. So several threads can write
  // at once.
  std::uint64_t place(std::size_t array, std::uint64_t size);
  std::uint64_t size() const { return head_.size() + end_; }  // bytes before the last lines
  // Writes the heads and the last lines, and the vertices if their arrays have got nothing. Throws Error if
  // another array has not got all its bytes.
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
