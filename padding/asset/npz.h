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
  NpyView() = default;
  NpyView(const NpyArray& a) : kind(a.kind), size(a.size), shape(a.shape), bytes(a.bytes) {}
  char kind = 'f';
  int size = 8;
  std::vector<std::uint64_t> shape;
  std::string_view bytes;
};

// One whole number for each of n spheres, a family or a mask say, stored as numbers of any type. Throws
// Error, which begins with `where`.
std::vector<std::uint32_t> whole_numbers(const NpyView& a, std::uint64_t n, const std::string& where);

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

// Writes an archive and holds only the heads of its arrays. The heads tell where each array goes, so several
// threads can fill the arrays at once. Equal arrays give equal bytes, whatever their portions were. Sizes and
// places beyond 4 GiB are written as ZIP64, which NumPy and zip programs read.
class NpzWriter {
 public:
  static constexpr std::uint64_t kPlain = 0xffffffff;  // what zip's own fields cannot hold

  // Sizes and places of `wide` bytes and more are written as ZIP64.
  NpzWriter(const std::vector<NpyHead>& heads, WriteAt write, std::uint64_t wide = kPlain);
  // Writes the next bytes of the array.
  void append(std::size_t array, std::string_view bytes);
  // The same, but the caller writes the bytes: returns their place in the archive. So several threads can
  // compute checksums and write at once. `checksum` is that of padding/asset/crc32.h.
  std::uint64_t place(std::size_t array, std::uint64_t size, std::uint32_t checksum);
  std::uint64_t size() const { return end_; }  // bytes of all arrays and heads
  // Writes the directory behind them. Throws Error if an array has not got all its bytes.
  void finish();

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

// A file of a zip archive, which is borrowed.
struct ZipEntry {
  std::string name;
  int method = 0;          // 0 stored, 8 deflated
  std::uint64_t size = 0;  // unpacked, as the directory says
  std::uint32_t checksum = 0;
  std::string_view packed;
};

// The directory of a zip archive (PKWARE's APPNOTE.TXT, sections 4.3 and 4.4), ZIP64 included. Throws Error,
// which begins with `where`, for bytes that are no zip archive, damaged or encrypted.
std::vector<ZipEntry> zip_entries(std::string_view bytes, const std::string& where);

// A .npy file of an archive, which is borrowed, and the checksum that the archive's directory gives for it.
struct NpzEntry {
  std::string_view bytes;
  std::uint32_t checksum;
};

// These four throw Error, which begins with `where`, for anything but uncompressed little-endian arrays.
// The .npy files of an archive, by their names without that ending. Does not compare the checksums.
std::map<std::string, NpzEntry> npz_entries(std::string_view bytes, const std::string& where);
// Throws Error if the bytes have another checksum.
void check_sum(const NpzEntry& entry, const std::string& where);
// The array of a .npy file.
NpyView npy_view(std::string_view bytes, const std::string& where);
// Copies of all arrays of an archive. Throws Error for a wrong checksum, too.
Npz npz_from_bytes(std::string_view bytes, const std::string& where);

}  // namespace padder
