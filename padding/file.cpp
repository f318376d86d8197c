#include "padding/file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <system_error>

#include "padding/error.h"
#include "padding/excerpt.h"

namespace padder {

namespace {

// An open file.
struct Handle {
  int number;
  explicit Handle(const std::filesystem::path& path)
      // A pipe that nobody writes to would keep open() waiting, were it not for O_NONBLOCK.
      : number(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)) {}
  ~Handle() {
    if (number >= 0) ::close(number);
  }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;

  // Bytes read; fewer than `size` at the end of the file, -1 for an error.
  ssize_t read(char* to, std::size_t size) const {
    std::size_t done = 0;
    while (done < size) {
      const ssize_t n = ::read(number, to + done, std::min(size - done, std::size_t(1) << 30));
      if (n < 0 && errno == EINTR) continue;
      if (n < 0) return -1;
      if (n == 0) break;
      done += static_cast<std::size_t>(n);
    }
    return static_cast<ssize_t>(done);
  }
};

}  // namespace

std::string read_file(const std::filesystem::path& path, std::uintmax_t most) {
  const std::string name = excerpt(path.string(), 4096);
  const Handle file(path);
  struct stat about {};
  if (file.number < 0 || ::fstat(file.number, &about) != 0)
    throw Error("cannot open " + name + ": check the name and that it may be read");
  if (S_ISDIR(about.st_mode)) throw Error(name + " is a folder: name a file");
  if (!S_ISREG(about.st_mode)) throw Error(name + " is a device, a pipe or a socket: name a regular file");
  const auto size = static_cast<std::uintmax_t>(about.st_size);
  if (size > most)
    throw Error(name + " has " + std::to_string(size) + " bytes, and at most " + std::to_string(most) +
                " are read: split it");
  std::string bytes(size, '\0');
  const ssize_t got = file.read(bytes.data(), size);
  if (got < 0) throw Error("cannot read " + name + " to its end: check the disk");
  bytes.resize(static_cast<std::size_t>(got));  // it may have been cut meanwhile
  // A file of /proc has no size, and yet bytes or an error.
  if (char more; size == 0 && file.read(&more, 1) != 0)
    throw Error(name + " is a file of the system without a size: name a regular file");
  return bytes;
}

void write_file(const std::filesystem::path& path, std::string_view bytes) {
  // The process id keeps two runs that write the same asset at once out of each other's half-written file.
  std::filesystem::path beside = path;
  beside += ".part" + std::to_string(::getpid());
  std::error_code code;
  {
    std::ofstream out(beside, std::ios::binary | std::ios::trunc);
    if (out) out.write(bytes.data(), static_cast<std::streamsize>(bytes.size())).flush();
    if (!out) {
      out.close();
      std::filesystem::remove(beside, code);
      throw Error("cannot write " + path.string() +
                  ": check that the folder exists, may be written and has room");
    }
  }
  std::filesystem::rename(beside, path, code);
  if (code) {
    const std::string why = code.message();
    std::filesystem::remove(beside, code);
    throw Error("cannot write " + path.string() + ": " + why);
  }
}

}  // namespace padder
