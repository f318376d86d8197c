// SPDX-License-Identifier: MIT
// A folder of a test's own, which goes when the test ends: an object, or a base of the test's fixture.
#pragma once
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

namespace padder {

class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "padder-test-XXXXXX").string();
    folder_ = ::mkdtemp(name.data());
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  const std::filesystem::path& path() const { return folder_; }
  // Writes a file there and returns its path.
  std::filesystem::path put(const std::string& name, const std::string& bytes) const {
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
    return folder_ / name;
  }

 protected:
  std::filesystem::path folder_;
};

}  // namespace padder
