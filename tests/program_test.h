// SPDX-License-Identifier: MIT
// A test that runs one of the project's programs as a user does, in a folder of the test's own.
#pragma once
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <set>
#include <string>

#include "padding/asset/file.h"
#include "tests/temporary_folder.h"

namespace padder {

struct Outcome {
  int code = -1;  // of the exit; 128 + signal when one ended the program
  std::string out, err;
};

class ProgramTest : public ::testing::Test, protected TemporaryFolder {
 protected:
  // `before` stands before the program in the shell's command.
  Outcome run(const std::string& program, const std::string& arguments,
              const std::string& before = "") const {
    const std::filesystem::path out = folder_ / ".out", err = folder_ / ".err";
    const int status =
        std::system(("cd '" + folder_.string() + "' && " + before + " '" PADDER_BIN "/" + program + "' " +
                     arguments + " >'" + out.string() + "' 2>'" + err.string() + "' </dev/null")
                        .c_str());
    const Outcome outcome{WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status), read_file(out),
                          read_file(err)};
    std::filesystem::remove(out), std::filesystem::remove(err);
    return outcome;
  }
  // What lies in the folder, by its path from there.
  std::set<std::string> files() const {
    std::set<std::string> names;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder_))
      if (entry.is_regular_file()) names.insert(std::filesystem::relative(entry.path(), folder_).string());
    return names;
  }
};

}  // namespace padder
