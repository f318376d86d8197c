// SPDX-License-Identifier: MIT
// Folders that are made for files.
#pragma once
#include <filesystem>
#include <system_error>
#include <vector>

namespace padder {

// Makes folders. Its end removes those that are empty, so that none stays where the writing of their files
// has failed.
class NewFolders {
 public:
  NewFolders() = default;
  NewFolders(const NewFolders&) = delete;
  NewFolders& operator=(const NewFolders&) = delete;
  ~NewFolders() {
    std::error_code code;  // one that is not empty stays
    for (auto folder = made_.rbegin(); folder != made_.rend(); ++folder)
      std::filesystem::remove(*folder, code);
  }

  // The folder and those above it, where they are missing. If that fails, writing the file fails and names
  // the reason.
  void make(const std::filesystem::path& folder) {
    std::error_code code;
    if (folder.empty() || std::filesystem::exists(folder, code)) return;
    make(folder.parent_path());
    if (std::filesystem::create_directory(folder, code)) made_.push_back(folder);
  }

 private:
  std::vector<std::filesystem::path> made_;
};

}  // namespace padder
