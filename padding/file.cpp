#include "padding/file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <fstream>
#include <system_error>
#include <utility>

#include "padding/error.h"

namespace padder {

std::string read_file(const std::filesystem::path& path) {
  std::error_code code;
  if (std::filesystem::is_directory(path, code)) throw Error(path.string() + " is a folder: name a file");
  std::ifstream in(path, std::ios::binary);
  if (!in) throw Error("cannot open " + path.string() + ": check the name and that it may be read");
  std::string bytes((std::istreambuf_iterator<char>(in)), {});
  if (in.bad()) throw Error("cannot read " + path.string() + " to its end");
  return bytes;
}

FileWriter::FileWriter(const std::filesystem::path& path) : path_(path), beside_(path) {
  // The process id keeps two runs that write the same asset at once out of each other's half-written file.
  beside_ += ".part" + std::to_string(::getpid());
  file_ = ::open(beside_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (file_ < 0) fail(errno);
}

FileWriter::~FileWriter() {
  if (file_ >= 0) ::close(file_), ::unlink(beside_.c_str());
}

void FileWriter::fail(int error) const {
  throw Error("cannot write " + path_.string() + " (" + std::generic_category().message(error) +
              "): check that the folder exists, may be written and has room");
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

void FileWriter::commit() {
  // Some file systems say only on closing that there is no room.
  if (::close(std::exchange(file_, -1)) == 0 && ::rename(beside_.c_str(), path_.c_str()) == 0) return;
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
