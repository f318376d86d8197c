// SPDX-License-Identifier: GPL-3.0-or-later
// Which files a run reads and which it will write: no result may take the place of an input, nor of another
// result.
#pragma once
#include <sys/stat.h>

#include <filesystem>
#include <string>
#include <system_error>
#include <unordered_map>
#include <unordered_set>

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
    std::filesystem::path place = file;
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

}  // namespace padder::cli
