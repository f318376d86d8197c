// SPDX-License-Identifier: GPL-3.0-or-later
// Runs the program bench in a folder of the test's own.
#pragma once
#include <nlohmann/json.hpp>

#include "tests/program_test.h"

namespace padder {

using Json = nlohmann::ordered_json;

inline Json scaling_document(const Json& one, const Json& other) {
  return {{"bench", "scaling"},
          {"machine", "a processor"},
          {"device", "a GPU"},
          {"rows", Json::array({one, other})}};
}

// The text of the document with another value at this place.
inline std::string changed(Json document, const std::string& pointer, const Json& value) {
  document[Json::json_pointer(pointer)] = value;
  return document.dump();
}

class BenchProgram : public ProgramTest {
 protected:
  Outcome bench(const std::string& arguments, const std::string& before = "") const {
    return run("bench", arguments, before);
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
