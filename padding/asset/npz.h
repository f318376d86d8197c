// SPDX-License-Identifier: MIT
// NumPy's .npz: named arrays in a zip archive, stored without compression. Host only; no further library.
#pragma once
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "padding/asset/file.h"

namespace padder {

// One array, row by row. kind and size as NumPy writes them: 'f' 4, 'f' 8, 'u' 4, 'i' 8, …
struct NpyArray {
  char kind = 'f';
  int size = 8;                      // bytes a number
  std::vector<std::uint64_t> shape;  // {} for a single number
  std::string bytes;

  std::uint64_t count() const;
  template <class T>
  std::vector<T> as() const;  // converted, T one of float, double, std::uint32_t
};

using Npz = std::map<std::string, NpyArray>;

// The same inside memory that somebody else holds, a mapped file say.
struct NpyView {
  char kind = 'f';
  int size = 8;
  std::vector<std::uint64_t> shape;
  std::string_view bytes;
};

template <class T>
NpyArray npy_array(const T* data, std::vector<std::uint64_t> shape) {
  NpyArray a;
  a.kind = std::is_floating_point_v<T> ? 'f'
           : std::is_unsigned_v<T>     ? 'u'
                                       : 'i',
  a.size = sizeof(T), a.shape = std::move(shape);
  a.bytes.assign(reinterpret_cast<const char*>(data), a.count() * sizeof(T));
  return a;
}

// An array without its bytes, as an archive announces it.
struct NpyHead {
  std::string name;
  char kind = 'f';
  int size = 8;
  std::vector<std::uint64_t> shape;

  std::uint64_t bytes() const;
};

// An archive whose arrays nobody holds as a whole: the place of each is known from the heads, so that all can
// be filled side by side. Holds no more than the heads. Equal arrays give equal bytes, in whatever portions
// they came. Sizes and places beyond 4 GiB are written as ZIP64, which NumPy and zip programs read.
class NpzWriter {
 public:
  static constexpr std::uint64_t kPlain = 0xffffffff;  // what zip's own fields cannot hold

  // Sizes and places of `wide` bytes and more are written as ZIP64.
  NpzWriter(const std::vector<NpyHead>& heads, WriteAt write, std::uint64_t wide = kPlain);
  // The next bytes of the array.
  void append(std::size_t array, std::string_view bytes);
  // The same for who writes the bytes at their place in the archive, which is returned: several threads can
  // then sum and write at once. `checksum` is that of padding/asset/crc32.h.
  std::uint64_t place(std::size_t array, std::uint64_t size, std::uint32_t checksum);
  std::uint64_t size() const { return end_; }  // of what the directory follows
  void finish();  // heads and directory; throws Error when an array has not got its bytes

 private:
  struct Entry {
    std::string file, npy;        // NAME.npy, and NumPy's own head of the array
    std::uint64_t local, data;    // where the entry and its data begin
    std::uint64_t size, got = 0;  // bytes of npy and the array
    std::uint32_t crc = 0;
  };
  WriteAt write_;
  std::uint64_t wide_;
  std::vector<Entry> entries_;
  std::uint64_t end_ = 0;
};

// The archive as bytes, arrays in alphabetical order.
std::string npz_bytes(const Npz& arrays);

// A .npy file of an archive, which is borrowed, and the checksum that the archive's directory gives for it.
struct NpzEntry {
  std::string_view bytes;
  std::uint32_t checksum;
};

// These throw Error, which begins with `where`, for anything but uncompressed little-endian arrays. The .npy
// files of an archive, by their names without that ending, and their checksums not looked at; one of them, or
// a .npy file by itself; all arrays of an archive, copied, and refused when a checksum is another.
std::map<std::string, NpzEntry> npz_entries(std::string_view bytes, const std::string& where);
NpyView npy_view(std::string_view bytes, const std::string& where);
Npz npz_from_bytes(std::string_view bytes, const std::string& where);

}  // namespace padder
