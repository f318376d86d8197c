// NumPy's .npz: named arrays in a zip archive, stored without compression. Host only; no further library.
#pragma once
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

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

// The archive as bytes, arrays in alphabetical order: equal arrays give equal bytes. Throws Error beyond 4
// GiB.
std::string npz_bytes(const Npz& arrays);

// Throws Error, which begins with `where`, for anything but an archive of uncompressed little-endian arrays.
Npz npz_from_bytes(std::string_view bytes, const std::string& where);

}  // namespace padder
