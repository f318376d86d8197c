// SPDX-License-Identifier: GPL-3.0-or-later
// Which files a run reads and which it will write: no result may take the place of an input, nor of another
// result.
#pragma once
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <string>
#include <system_error>
#include <unordered_map>
#include <unordered_set>

#include "padding/asset/error.h"
#include "padding/asset/file.h"
#include "tools/cli.h"

namespace padder::cli {

// Files are told apart by what they are, not by their names: a link, or a way through a folder that is not
// made yet, leads to the same file.
class RunFiles {
 public:
  void reads(const std::filesystem::path& file) { read_.insert(identity(file)); }

  // Throws UsageError if the run reads `file`, or if it was to write it before. `owner` says whose result it
  // is, as "-o x.vtp" or the name of a mesh, and `remedy` what to do.
  void writes(const std::filesystem::path& file, const std::string& owner, const std::string& remedy) {
    const std::string what = identity(file);
    if (read_.contains(what)) throw UsageError(file.string() + " is a file that this run reads: " + remedy);
    if (const auto [it, fresh] = written_.emplace(what, owner); !fresh)
      throw UsageError(owner + " and " + it->second + " would both write " + file.string() + ": " + remedy);
  }

 private:
  static std::string identity(const std::filesystem::path& file) {
    std::filesystem::path place = behind_links(file);
    struct stat about {};
    if (::stat(place.c_str(), &about) != 0) {
      std::error_code code;
      // The second time follows the links that stood behind a folder that is not there.
      for (int k = 0; k < 2 && !code; k++)
        place = std::filesystem::weakly_canonical(std::filesystem::absolute(place, code), code);
      if (code) return file.lexically_normal().string();
      if (::stat(place.c_str(), &about) != 0) return place.string();
    }
    return std::to_string(about.st_dev) + ':' + std::to_string(about.st_ino);
  }

  std::unordered_set<std::string> read_;
  std::unordered_map<std::string, std::string> written_;  // to the owner
};

// Throws Error where the folder of `file` is not there or may not be written: at the end of a long run that
// would be too late. Of folders that the run makes, the first that is there above them counts.
inline void check_writable(const std::filesystem::path& file, bool makes_folders = false) {
  struct stat about {};
  int error = ::stat(file.c_str(), &about) == 0 || errno == ENOENT ? 0 : errno;
  if (error == 0 && S_ISDIR(about.st_mode))
    throw Error("cannot write " + file.string() + ": it is a folder, so name a file");
  std::error_code code;
  std::filesystem::path folder = std::filesystem::absolute(behind_links(file), code).parent_path();
  while (error == 0 && ::stat(folder.c_str(), &about) != 0)
    if (error = errno; makes_folders && error == ENOENT && folder.has_relative_path())
      folder = folder.parent_path(), error = 0;
  if (error == 0 && !S_ISDIR(about.st_mode)) error = ENOTDIR;
  if (error == 0 && ::access(folder.c_str(), W_OK | X_OK) != 0) error = errno;
  if (error != 0)
    throw Error("cannot write " + file.string() + " (" + std::generic_category().message(error) +
                "): check that the folder exists, may be written and has room");
}

}  // namespace padder::cli
