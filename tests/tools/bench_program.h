// SPDX-License-Identifier: GPL-3.0-or-later
// Runs the program bench in a folder of the test's own.
#pragma once
#include <set>

#include "tests/program_test.h"

namespace padder {

class BenchProgram : public ProgramTest {
 protected:
  Outcome bench(const std::string& arguments, const std::string& before = "") const {
    return run("bench", arguments, before);
  }
  std::set<std::string> files() const {
    std::set<std::string> names;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder_))
      if (entry.is_regular_file() && entry.path().filename().string()[0] != '.')
        names.insert(std::filesystem::relative(entry.path(), folder_).string());
    return names;
  }
  // Fails with one sentence that begins like this, and prints nothing else.
  void expect_refused(const std::string& arguments, const std::string& sentence) const {
    const Outcome r = bench(arguments);
    EXPECT_EQ(r.code, 1) << sentence;
    EXPECT_EQ(r.err.find("bench: " + sentence), 0u) << r.err;
    EXPECT_EQ(r.err.find('\n'), r.err.size() - 1) << "one sentence: " << r.err;
    EXPECT_EQ(r.out, "");
  }
  std::string read(const std::string& name) const { return read_file(folder_ / name); }
  void write(const std::string& name, const std::string& bytes) const { write_file(folder_ / name, bytes); }
  static std::string source_folder() { return std::filesystem::path(PADDER_ASSETS).parent_path().string(); }
};

}  // namespace padder
