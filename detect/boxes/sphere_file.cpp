// SPDX-License-Identifier: MIT
#include "detect/boxes/sphere_file.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <map>
#include <string_view>
#include <system_error>
#include <vector>

#include "padding/asset/error.h"
#include "padding/asset/excerpt.h"

namespace padder::detect {
namespace {

// An array inside the mapped file.
struct MappedArray {
  char kind;  // as NumPy writes it: 'f', 'u', …
  int size;   // bytes a number
  std::vector<std::uint64_t> shape;
  const char* data;
};

std::uint64_t little_endian(std::string_view in, std::uint64_t at, int bytes, const std::string& where) {
  if (at > in.size() || in.size() - at < static_cast<std::uint64_t>(bytes))
    throw Error(where + ": the file is cut off");
  std::uint64_t value = 0;
  for (int k = bytes; k-- > 0;)
    value = value << 8 | static_cast<unsigned char>(in[at + static_cast<std::uint64_t>(k)]);
  return value;
}

// The numbers between the parentheses of the shape.
std::vector<std::uint64_t> shape_of(std::string_view header, const std::string& where) {
  std::vector<std::uint64_t> shape;
  auto at = header.find("'shape':");
  at = at == std::string_view::npos ? at : header.find('(', at);
  if (at == std::string_view::npos) throw Error(where + ": the array has no shape");
  for (at++; at < header.size() && header[at] != ')';) {
    if (header[at] < '0' || header[at] > '9') {
      at++;
      continue;
    }
    std::uint64_t n = 0;
    for (; at < header.size() && header[at] >= '0' && header[at] <= '9'; at++) {
      if (n > (std::uint64_t(1) << 50)) throw Error(where + ": the array's shape is not possible");
      n = 10 * n + static_cast<std::uint64_t>(header[at] - '0');
    }
    shape.push_back(n);
  }
  return shape;
}

MappedArray array_of(std::string_view in, const std::string& where) {
  if (in.size() < 12 || in.substr(0, 6) != "\x93NUMPY") throw Error(where + ": no NumPy array");
  const int wide = in[6] == 1 ? 2 : 4;
  const std::uint64_t length = little_endian(in, 8, wide, where),
                      begin = 8 + static_cast<std::uint64_t>(wide) + length;
  if (begin > in.size()) throw Error(where + ": the file is cut off");
  const std::string_view header = in.substr(8 + static_cast<std::uint64_t>(wide), length);
  const auto descr = header.find("'descr': '<");
  if (descr == std::string_view::npos || descr + 13 >= header.size())
    throw Error(where + ": numbers must be little-endian of 4 or 8 bytes: save float32, float64 or uint32");
  MappedArray a{header[descr + 11], header[descr + 12] - '0', shape_of(header, where), in.data() + begin};
  if (header.find("'fortran_order': False") == std::string_view::npos)
    throw Error(where + ": save the array in C order");
  std::uint64_t bytes = static_cast<std::uint64_t>(a.size);
  bool possible = a.size == 4 || a.size == 8;
  for (const std::uint64_t n : a.shape) possible &= !__builtin_mul_overflow(bytes, n, &bytes);
  if (!possible || in.size() - begin < bytes)
    throw Error(where + ": the array's data does not fit its shape");
  return a;
}

// A field of 32 bits with all bits set stands for one of 64 bits in the extra field (ZIP64).
constexpr std::uint64_t kContinued = 0xffffffff;
void widen(std::string_view in, std::uint64_t at, std::uint64_t extra, std::uint64_t& size,
           std::uint64_t& local, const std::string& where) {
  if (size != kContinued && local != kContinued) return;
  for (const std::uint64_t end = at + extra; at + 4 <= end;) {
    const std::uint64_t kind = little_endian(in, at, 2, where), length = little_endian(in, at + 2, 2, where);
    std::uint64_t field = at + 4;
    at = field + length;
    if (kind != 1) continue;
    // The sizes come first, as they are and compressed; then the place.
    if (size == kContinued) size = little_endian(in, field, 8, where), field += 16;
    if (local == kContinued) local = little_endian(in, field, 8, where);
    return;
  }
  throw Error(where + ": the archive's directory is damaged");
}

// The arrays of a stored archive, by name.
std::map<std::string, MappedArray> arrays_of(std::string_view in, const std::string& where) {
  const std::uint64_t tail = in.size() - std::min<std::uint64_t>(in.size(), 65536 + 22);
  const auto found = in.substr(tail).rfind("PK\x05\x06");
  if (found == std::string_view::npos) throw Error(where + ": not an .npz archive");
  const std::uint64_t end = tail + found, files = little_endian(in, end + 10, 2, where);
  std::uint64_t at = little_endian(in, end + 16, 4, where);
  if (at == kContinued) {  // the place of ZIP64's longer end stands before the plain one
    if (end < 20 || little_endian(in, end - 20, 4, where) != 0x07064b50)
      throw Error(where + ": the archive's end is damaged");
    at = little_endian(in, little_endian(in, end - 12, 8, where) + 48, 8, where);
  }
  std::map<std::string, MappedArray> arrays;
  for (std::uint64_t k = 0; k < files; k++) {
    if (little_endian(in, at, 4, where) != 0x02014b50)
      throw Error(where + ": the archive's directory is damaged");
    const auto field = [&](std::uint64_t offset, int bytes) {
      return little_endian(in, at + offset, bytes, where);
    };
    const std::uint64_t method = field(10, 2), name_size = field(28, 2), extra = field(30, 2),
                        comment = field(32, 2);
    std::uint64_t size = field(24, 4), local = field(42, 4);
    field(46 + name_size, 0);  // the name is there
    std::string name(in.substr(at + 46, name_size));
    if (method != 0)
      throw Error(where + ": " + excerpt(name) +
                  " is compressed: save with numpy.savez, not savez_compressed");
    widen(in, at + 46 + name_size, extra, size, local, where);
    const std::uint64_t data =
        local + 30 + little_endian(in, local + 26, 2, where) + little_endian(in, local + 28, 2, where);
    if (data > in.size() || in.size() - data < size) throw Error(where + ": the file is cut off");
    if (name.ends_with(".npy")) name.resize(name.size() - 4);
    if (name == "centers" || name == "radii" || name == "family" || name == "mask")
      arrays.insert_or_assign(name, array_of(in.substr(data, size), where + ": " + name));
    at += 46 + name_size + extra + comment;
  }
  return arrays;
}

Scalar checked_scalar(const MappedArray& a, const std::string& where) {
  if (a.kind != 'f') throw Error(where + ": spheres must be float32 or float64");
  return a.size == 4 ? Scalar::f32 : Scalar::f64;
}

}  // namespace

SphereFile::SphereFile(const std::filesystem::path& path) : where_(path.string()) {
  const std::string ending = path.extension().string();
  if (ending != ".npy" && ending != ".npz") throw Error(where_ + ": spheres are mapped from .npy or .npz");
  const auto fail = [&](int error) {
    throw Error(where_ + ": cannot be mapped: " + std::generic_category().message(error));
  };
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (file < 0) fail(errno);
  struct stat about;
  const int known = ::fstat(file, &about);
  const bool regular = known == 0 && S_ISREG(about.st_mode) && about.st_size > 0;
  void* const mapped =
      regular ? ::mmap(nullptr, static_cast<std::size_t>(about.st_size), PROT_READ, MAP_SHARED, file, 0)
              : MAP_FAILED;
  const int error = errno;
  ::close(file);
  if (!regular) throw Error(where_ + ": not a file, or an empty one");
  if (mapped == MAP_FAILED) fail(error);
  data_ = static_cast<const char*>(mapped), size_ = static_cast<std::uint64_t>(about.st_size);
  try {
    ending == ".npy" ? read_npy() : read_npz();
  } catch (...) {
    ::munmap(const_cast<char*>(data_), size_);
    throw;
  }
}

SphereFile::~SphereFile() { ::munmap(const_cast<char*>(data_), size_); }

void SphereFile::read_npy() {
  const MappedArray a = array_of({data_, size_}, where_);
  if (a.shape.size() != 2 || a.shape[1] != 4)
    throw Error(where_ + ": the array must be of shape (N, 4): x, y, z, r of each sphere");
  spheres_.scalar = checked_scalar(a, where_), spheres_.count = a.shape[0];
  spheres_.centers = a.data, spheres_.radii = a.data + 3 * a.size;
  spheres_.center_stride = spheres_.radius_stride = 4;
}

void SphereFile::read_npz() {
  const std::map<std::string, MappedArray> arrays = arrays_of({data_, size_}, where_);
  const auto centers = arrays.find("centers"), radii = arrays.find("radii");
  if (centers == arrays.end() || radii == arrays.end())
    throw Error(where_ + ": the arrays \"centers\" and \"radii\" are needed");
  const MappedArray &c = centers->second, &r = radii->second;
  if (c.shape.size() != 2 || c.shape[1] != 3 || r.shape.size() != 1 || r.shape[0] != c.shape[0])
    throw Error(where_ + ": \"centers\" must be of shape (N, 3) and \"radii\" of shape (N)");
  spheres_.scalar = checked_scalar(c, where_), spheres_.count = r.shape[0];
  if (checked_scalar(r, where_) != spheres_.scalar)
    throw Error(where_ + ": save \"centers\" and \"radii\" in the same type");
  spheres_.centers = c.data, spheres_.radii = r.data;
  for (const auto& [name, to] : {std::pair("family", &spheres_.family), std::pair("mask", &spheres_.mask)}) {
    const auto found = arrays.find(name);
    if (found == arrays.end()) continue;
    const MappedArray& a = found->second;
    if (a.shape != r.shape || a.kind != 'u' || a.size != 4)
      throw Error(where_ + ": \"" + name + "\" must be uint32, one number for each sphere");
    *to = reinterpret_cast<const std::uint32_t*>(a.data);
  }
}

}  // namespace padder::detect
