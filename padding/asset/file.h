// SPDX-License-Identifier: MIT
// Files in and out. Writing is all or nothing: beside the target first, then renamed over it.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "padding/asset/error.h"

namespace padder {

// The most that read_file takes into memory: 8 GiB.
constexpr std::uintmax_t kMostBytes = std::uintmax_t(8) << 30;
// The most of a text that becomes many times as large in memory (JSON, YAML, XML): 1 GiB.
constexpr std::uintmax_t kMostText = std::uintmax_t(1) << 30;

// Thrown by a FileWriter when the disk is at fault and not the name: it is full, beyond its quota, read-only
// or broken. Whatever else is written there will fail, too.
class DiskError : public Error {
 public:
  using Error::Error;
};

// The bytes of a regular file. Throws Error when it cannot be read, is larger than `most`, or is a folder, a
// device, a pipe, a socket or one of the system's files without a size: these may have no end, or never
// answer.
std::string read_file(const std::filesystem::path& path, std::uintmax_t most = kMostBytes);

// The ending of a name in lower case, as ".stl" of PART.STL: what a file is does not depend on the case.
std::string ending_of(const std::filesystem::path& path);

// The file that a name leads to: links are followed, also to what is not there yet. The name itself where it
// is no link, and some link of a circle.
std::filesystem::path behind_links(const std::filesystem::path& path);

// Removes what the process has in the making, as a handler of SIGINT does before it ends the process. It
// calls only what a signal handler may call. Knows of 64 files at a time, with names of up to 4000 bytes.
void remove_unfinished_files() noexcept;

// While it lives, remove_unfinished_files() removes the file of this name, if there is one.
class UnfinishedFile {
 public:
  explicit UnfinishedFile(const std::filesystem::path& path);
  ~UnfinishedFile();
  UnfinishedFile(const UnfinishedFile&) = delete;
  UnfinishedFile& operator=(const UnfinishedFile&) = delete;

 private:
  int place_ = -1;  // none: it goes without
};

// A file that is written in portions, so that its content need not be held as a whole. It grows beside its
// target, in the same folder, and commit() renames it to the target: a reader sees the old file or the new
// one, never half of it. The destructor removes a file that was not committed, and so does
// remove_unfinished_files(). If the name is a link, the target is the file that it leads to, and the link
// stays; the new file has the old one's mode. Every function throws Error if the folder is absent, full or
// not writable, and the constructor if the target is a device, a pipe or a socket, or a link to one. The
// sentence names the file as it was given and what the system said. After that the writer must not be used.
class FileWriter {
 public:
  explicit FileWriter(const std::filesystem::path& path);
  ~FileWriter();
  FileWriter(const FileWriter&) = delete;
  FileWriter& operator=(const FileWriter&) = delete;

  // Each call writes at once, without a buffer: hand over kilobytes, not words. Bytes are counted from the
  // beginning of the file; append() goes on behind the last byte that was appended.
  void append(std::string_view bytes);
  void write_at(std::uint64_t offset, std::string_view bytes);
  // Takes room on the disk for the first `bytes` of the file, all of which must be written. Writing is then
  // twice as fast where it jumps between places of a large file, and a full disk throws before the work.
  // Does nothing where the file system has no such request.
  void reserve(std::uint64_t bytes);
  // Asks the system to begin writing what it holds of these bytes of the file. It waits only while the disk
  // has more requests than it takes. Another thread may write meanwhile.
  void write_out(std::uint64_t offset, std::uint64_t bytes) const noexcept;
  std::uint64_t size() const noexcept;  // bytes, as the system says
  void commit();

 private:
  [[noreturn]] void fail(int error) const;

  std::filesystem::path path_, target_, beside_;  // as it was given, where it is, and the file in the making
  std::optional<UnfinishedFile> unfinished_;
  int file_ = -1;
  std::uint64_t end_ = 0;
};

// Takes bytes that belong at `offset` of some content: a FileWriter's write_at(), or what write_into() gives.
using WriteAt = std::function<void(std::uint64_t offset, std::string_view bytes)>;

// Puts bytes at their places in `out`, which grows as needed.
WriteAt write_into(std::string& out);

// Content that is at hand: one append() and a commit() of a FileWriter.
void write_file(const std::filesystem::path& path, std::string_view bytes);

}  // namespace padder
