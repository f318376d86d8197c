// SPDX-License-Identifier: MIT
#include "detect/scene/sphere_file.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <map>
#include <system_error>

#include "padding/asset/error.h"
#include "padding/asset/npz.h"

namespace padder::detect {
namespace {

Scalar checked_scalar(const NpyView& a, const std::string& where) {
  if (a.kind != 'f') throw Error(where + ": spheres must be float32 or float64");
  return a.size == 4 ? Scalar::f32 : Scalar::f64;
}

std::vector<double> doubles(const NpyView& a) {
  NpyArray copy;
  copy.kind = a.kind, copy.size = a.size, copy.shape = a.shape, copy.bytes = a.bytes;
  return copy.as<double>();
}

// The files that are mapped now. Fixed places, because a signal handler may not take locks. A file that finds
// none goes without a name.
struct Mapping {
  std::atomic<const char*> begin = nullptr;  // null: the place is free
  std::atomic<std::uint64_t> size = 0;
  std::atomic<const char*> name = nullptr;
};
constinit Mapping mappings[16];
const char* ended_program = nullptr;
void (*before_ending)() = nullptr;

void remember(const char* begin, std::uint64_t size, const char* name) {
  for (Mapping& m : mappings) {
    const char* free = nullptr;
    if (!m.begin.compare_exchange_strong(free, begin)) continue;
    m.name = name, m.size = size;
    return;
  }
}

void forget(const char* begin) {
  for (Mapping& m : mappings)
    if (m.begin == begin) {
      m.size = 0, m.begin = nullptr;
      return;
    }
}

void say(const char* text) {
  if (::write(STDERR_FILENO, text, std::strlen(text)) < 0) return;
}

void end_at_a_shortened_file(int signal, siginfo_t* info, void*) {
  const char* const at = static_cast<const char*>(info->si_addr);
  for (const Mapping& m : mappings) {
    if (at < m.begin || at >= m.begin + m.size) continue;
    static std::atomic_flag first;
    while (first.test_and_set()) ::pause();  // several threads read: one tells
    if (before_ending) before_ending();
    say(ended_program), say(": "), say(m.name);
    say(": the file was shortened while it was read: leave it as it is and start again\n");
    ::_exit(1);
  }
  std::signal(signal, SIG_DFL);  // no file of ours: the access comes again, and ends the program
}

}  // namespace

void SphereFile::end_program_if_shortened(const char* program, void (*before)()) {
  ended_program = program, before_ending = before;
  struct sigaction action = {};
  action.sa_sigaction = end_at_a_shortened_file, action.sa_flags = SA_SIGINFO;
  ::sigaction(SIGBUS, &action, nullptr);
}

SphereFile::SphereFile(const std::filesystem::path& path) : where_(path.string()) {
  const std::string ending = path.extension().string();
  if (ending != ".npy" && ending != ".npz") throw Error(where_ + ": spheres are mapped from .npy or .npz");
  const auto fail = [&](int error) {
    throw Error(where_ + (error == ENOENT ? ": there is no such file: check the name"
                                          : ": cannot be mapped: " + std::generic_category().message(error) +
                                                ": check the name and that it may be read"));
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
  remember(data_, size_, where_.c_str());
  try {
    is_npz_ = ending == ".npz";
    is_npz_ ? read_npz() : read_npy();
  } catch (...) {
    unmap();
    throw;
  }
}

SphereFile::~SphereFile() { unmap(); }

void SphereFile::unmap() {
  forget(data_);
  ::munmap(const_cast<char*>(data_), size_);
}

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
  spheres_.count = r.shape[0];
  if (c.kind == 'f' && r.kind == 'f' && c.size == r.size) {
    spheres_.scalar = c.size == 4 ? Scalar::f32 : Scalar::f64;
    spheres_.centers = c.bytes.data(), spheres_.radii = r.bytes.data();
  } else {
    spheres_.scalar = Scalar::f64;
    centers_ = doubles(c), radii_ = doubles(r);
    spheres_.centers = centers_.data(), spheres_.radii = radii_.data();
  }
  const auto tags = [&](const char* name, std::vector<std::uint32_t>& copy) -> const std::uint32_t* {
    if (!entries.contains(name)) return nullptr;
    const NpyView a = array(name);
    if (a.shape == r.shape && a.kind == 'u' && a.size == 4)
      return reinterpret_cast<const std::uint32_t*>(a.bytes.data());
    copy = whole_numbers(a, spheres_.count, where_ + ": " + name);
    return copy.data();
  };
  spheres_.family = tags("family", families_), spheres_.mask = tags("mask", masks_);
  spheres_.world = tags("world", worlds_);
}

void SphereFile::check() const {
  if (!is_npz_) return;
  for (const auto& [name, entry] : npz_entries({data_, size_}, where_))
    check_sum(entry, where_ + ": " + name);
}

}  // namespace padder::detect
