// SPDX-License-Identifier: GPL-3.0-or-later
// Runs the program bench in a folder of the test's own.
#pragma once
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <set>
#include <string>

#include "padding/asset/file.h"

namespace padder {

struct Outcome {
  int code = -1;  // of the exit; 128 when a signal ended it
  std::string out, err;
};

class BenchProgram : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string name = (std::filesystem::temp_directory_path() / "padder-bench-XXXXXX").string();
    folder_ = ::mkdtemp(name.data());
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  // `before` stands before the program in the shell's command.
  Outcome bench(const std::string& arguments, const std::string& before = "") const {
    const std::filesystem::path out = folder_ / ".out", err = folder_ / ".err";
    const int status =
        std::system(("cd '" + folder_.string() + "' && " + before + " '" PADDER_BIN "/bench' " + arguments +
                     " >'" + out.string() + "' 2>'" + err.string() + "' </dev/null")
                        .c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : 128, read_file(out), read_file(err)};
  }
  std::set<std::string> files() const {
    std::set<std::string> names;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder_))
      if (entry.is_regular_file() && entry.path().filename().string()[0] != '.')
        names.insert(std::filesystem::relative(entry.path(), folder_).string());
    return names;
  }
  std::string read(const std::string& name) const { return read_file(folder_ / name); }
  void write(const std::string& name, const std::string& bytes) const { write_file(folder_ / name, bytes); }
  static std::string source_folder() { return std::filesystem::path(PADDER_ASSETS).parent_path().string(); }

  std::filesystem::path folder_;
};

}  // namespace padder
