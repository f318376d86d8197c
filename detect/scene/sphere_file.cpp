// SPDX-License-Identifier: MIT
#include "detect/scene/sphere_file.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <map>
#include <string_view>
#include <system_error>
#include <vector>

#include "padding/asset/error.h"
#include "padding/asset/npz.h"

namespace padder::detect {
namespace {

Scalar checked_scalar(const NpyView& a, const std::string& where) {
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
  const NpyView a = npy_view({data_, size_}, where_);
  if (a.shape.size() != 2 || a.shape[1] != 4)
    throw Error(where_ + ": the array must be of shape (N, 4): x, y, z, r of each sphere");
  spheres_.scalar = checked_scalar(a, where_), spheres_.count = a.shape[0];
  spheres_.centers = a.bytes.data(), spheres_.radii = a.bytes.data() + 3 * a.size;
  spheres_.center_stride = spheres_.radius_stride = 4;
}

void SphereFile::read_npz() {
  const std::map<std::string, NpzEntry> entries = npz_entries({data_, size_}, where_);
  const auto array = [&](const char* name) { return npy_view(entries.at(name).bytes, where_ + ": " + name); };
  if (!entries.contains("centers") || !entries.contains("radii"))
    throw Error(where_ + ": the arrays \"centers\" and \"radii\" are needed");
  const NpyView c = array("centers"), r = array("radii");
  if (c.shape.size() != 2 || c.shape[1] != 3 || r.shape.size() != 1 || r.shape[0] != c.shape[0])
    throw Error(where_ + ": \"centers\" must be of shape (N, 3) and \"radii\" of shape (N)");
  spheres_.scalar = checked_scalar(c, where_), spheres_.count = r.shape[0];
  if (checked_scalar(r, where_) != spheres_.scalar)
    throw Error(where_ + ": save \"centers\" and \"radii\" in the same type");
  spheres_.centers = c.bytes.data(), spheres_.radii = r.bytes.data();
  for (const auto& [name, to] : {std::pair("family", &spheres_.family), std::pair("mask", &spheres_.mask),
                                 std::pair("world", &spheres_.world)}) {
    if (!entries.contains(name)) continue;
    const NpyView a = array(name);
    if (a.shape != r.shape || a.kind != 'u' || a.size != 4)
      throw Error(where_ + ": \"" + name + "\" must be uint32, one number for each sphere");
    *to = reinterpret_cast<const std::uint32_t*>(a.bytes.data());
  }
}

}  // namespace padder::detect
