// SPDX-License-Identifier: MIT
#include "padding/asset/file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <system_error>
#include <utility>

#include "padding/asset/excerpt.h"

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

// Files in the making. Fixed places, because a signal handler may neither take locks nor touch memory that
// another thread may be freeing.
struct Unfinished {
  std::atomic<int> state{0};  // 0: free, 1: being filled, 2: holds the name of a file
  char name[4001];
};
Unfinished unfinished[64];

}  // namespace

UnfinishedFile::UnfinishedFile(const std::filesystem::path& path) {
  const std::string& name = path.native();
  if (name.size() >= sizeof unfinished->name) return;
  for (int k = 0; k < 64 && place_ < 0; k++)
    if (int free = 0; unfinished[k].state.compare_exchange_strong(free, 1)) {
      unfinished[k].name[name.copy(unfinished[k].name, name.size())] = 0;
      unfinished[k].state = 2;
      place_ = k;
    }
}

UnfinishedFile::~UnfinishedFile() {
  if (place_ >= 0) unfinished[place_].state = 0;
}

void remove_unfinished_files() noexcept {
  for (const Unfinished& u : unfinished)
    if (u.state == 2) ::unlink(u.name);
}

std::string ending_of(const std::filesystem::path& path) { return lower_case(path.extension().string()); }

std::filesystem::path behind_links(const std::filesystem::path& path) {
  std::filesystem::path file = path;
  std::error_code code;
  for (int k = 0; k < 40 && std::filesystem::is_symlink(file, code); k++)  // Linux follows 40
    file = file.parent_path() / std::filesystem::read_symlink(file, code);
  return file;
}

std::string read_file(const std::filesystem::path& path, std::uintmax_t most) {
  if (path.empty()) throw Error("the name of the file to read is empty: name one");
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

FileWriter::FileWriter(const std::filesystem::path& path)
    : path_(path), target_(behind_links(path)), beside_(target_) {
  struct stat about {};
  const bool is_there = ::stat(path.c_str(), &about) == 0;
  // Not only a circle of links: in a shared folder the system does not follow those of strangers.
  if (!is_there && errno != ENOENT) fail(errno);
  if (is_there && !S_ISREG(about.st_mode) && !S_ISDIR(about.st_mode))
    throw Error("cannot write " + path.string() +
                ": it is a device, a pipe or a socket: name a regular file, or - for the standard output");
  // The process id keeps two runs that write the same asset at once out of each other's half-written file.
  beside_ += ".part" + std::to_string(::getpid());
  unfinished_.emplace(beside_);  // before it is there: a signal may come in between
  // Exclusively: a link of this name, which somebody else may have put there, would be followed. What a
  // killed process of this id has left is removed.
  const auto open = [&] { return ::open(beside_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666); };
  file_ = open();
  if (file_ < 0 && errno == EEXIST && ::unlink(beside_.c_str()) == 0) file_ = open();
  if (file_ < 0) fail(errno);
  if (is_there) (void)::fchmod(file_, about.st_mode & 07777);
}

FileWriter::~FileWriter() {
  if (file_ >= 0) ::close(file_), ::unlink(beside_.c_str());
}

void FileWriter::fail(int error) const {
  const std::string sentence = "cannot write " + path_.string() + " (" +
                               std::generic_category().message(error) +
                               "): check that the folder exists, may be written and has room";
  if (error == ENOSPC || error == EDQUOT || error == EROFS || error == EIO) throw DiskError(sentence);
  throw Error(sentence);
}

void FileWriter::append(std::string_view bytes) {
  write_at(end_, bytes);
  end_ += bytes.size();
}

void FileWriter::write_at(std::uint64_t offset, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::pwrite(file_, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) fail(written < 0 ? errno : EIO);
    offset += static_cast<std::uint64_t>(written);
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
}

void FileWriter::reserve(std::uint64_t bytes) {
  if (bytes == 0 || ::fallocate(file_, 0, 0, static_cast<off_t>(bytes)) == 0) return;
  if (errno == ENOSPC || errno == EDQUOT || errno == EFBIG) fail(errno);
}

void FileWriter::write_out(std::uint64_t offset, std::uint64_t bytes) const noexcept {
  // What fails here is said by a later write, or when the file is closed.
  (void)::sync_file_range(file_, static_cast<off_t>(offset), static_cast<off_t>(bytes),
                          SYNC_FILE_RANGE_WRITE);
}

std::uint64_t FileWriter::size() const noexcept {
  struct stat about {};
  return ::fstat(file_, &about) == 0 ? static_cast<std::uint64_t>(about.st_size) : 0;
}

void FileWriter::commit() {
  // Some file systems say only on closing that there is no room.
  if (::close(std::exchange(file_, -1)) == 0 && ::rename(beside_.c_str(), target_.c_str()) == 0) return;
  const int error = errno;
  ::unlink(beside_.c_str());
  fail(error);
}

WriteAt write_into(std::string& out) {
  return [&out](std::uint64_t offset, std::string_view bytes) {
    if (out.size() < offset + bytes.size()) out.resize(offset + bytes.size());
    bytes.copy(out.data() + offset, bytes.size());
  };
}

void write_file(const std::filesystem::path& path, std::string_view bytes) {
  FileWriter out(path);
  out.append(bytes);
  out.commit();
}

}  // namespace padder
