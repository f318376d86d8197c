// SPDX-License-Identifier: GPL-3.0-or-later
// A program's standard input and output where it expects a file: "-" on the command line.
#pragma once
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <string>

#include "padding/asset/error.h"
#include "padding/asset/file.h"
#include "tools/cli.h"

namespace padder::cli {

inline bool is_stream(const std::string& path) { return path == "-"; }

// All of the standard input, if it takes no more than `limit` bytes and a quarter of the machine's memory: it
// may have no end.
inline std::string read_stdin(std::uint64_t limit = UINT64_MAX) {
  const std::uint64_t quarter =
      std::uint64_t(::sysconf(_SC_PHYS_PAGES)) / 4 * std::uint64_t(::sysconf(_SC_PAGESIZE));
  const std::uint64_t most = std::min(limit, quarter);
  std::string text, piece(std::size_t{1} << 20, 0);
  for (std::size_t n; (n = std::fread(piece.data(), 1, piece.size(), stdin)) > 0;) {
    text.append(piece, 0, n);
    if (text.size() > most)
      throw Error("the standard input is longer than " + std::to_string(most >> 20) + " MiB" +
                  (quarter < limit ? ", a quarter of this machine's memory" : "") + ": name a file instead");
  }
  if (std::ferror(stdin)) throw Error("the standard input cannot be read");
  if (text.empty()) throw Error("the standard input is empty");
  return text;
}

// A folder of temporary files, for readers and writers that choose the format by the ending. It goes with the
// object, and when a signal ends the program.
class StreamFiles {
 public:
  StreamFiles() = default;
  ~StreamFiles() {
    std::error_code code;
    if (!temporary.empty()) std::filesystem::remove_all(temporary, code);
    when_ended() = nullptr;
  }
  StreamFiles(const StreamFiles&) = delete;
  StreamFiles& operator=(const StreamFiles&) = delete;

  // The file NAME that holds what came from the standard input.
  std::string spool(const std::string& name) {
    const std::filesystem::path path = folder() / name;
    note(0, path);
    write_file(path, read_stdin());
    return path.string();
  }

  // A file to write that deliver() prints.
  std::string output(const std::string& name) {
    std::filesystem::create_directories(folder() / "out");
    output_ = folder() / "out" / name;
    note(1, output_), note(2, output_.parent_path());
    return output_.string();
  }

  // Prints the output on the standard output. Throws Error if the format is of several files.
  void deliver() const {
    if (output_.empty()) return;
    for (const auto& entry : std::filesystem::directory_iterator(output_.parent_path()))
      if (entry.path() != output_ || !entry.is_regular_file())
        throw Error("this format is more than one file (" + entry.path().filename().string() +
                    " as well), which do not fit into the standard output: name a file with -o");
    const std::string bytes = read_file(output_);
    std::cout.write(bytes.data(), std::streamsize(bytes.size()));
    flush_results();  // while errno still says why it failed
  }

  // A sentence without the name of the temporary folder.
  static std::string spoken(std::string sentence) {
    if (temporary.empty()) return sentence;
    for (const std::string& prefix : {(temporary / "out").string() + "/", temporary.string() + "/"})
      for (std::size_t at; (at = sentence.find(prefix)) != std::string::npos;)
        sentence.erase(at, prefix.size());
    return sentence;
  }

 private:
  const std::filesystem::path& folder() {
    if (!temporary.empty()) return temporary;
    std::error_code code;  // set when TMPDIR names no folder
    std::string name = (std::filesystem::temp_directory_path(code) / "padder-XXXXXX").string();
    if (code || !::mkdtemp(name.data()))
      throw Error(name + ": a temporary folder cannot be made: set TMPDIR to another");
    temporary = name;
    note(3, temporary);
    when_ended() = [] {  // calls only what a signal handler may call
      for (const int file : {0, 1}) ::unlink(left_behind[file]);
      for (const int folder : {2, 3}) ::rmdir(left_behind[folder]);
    };
    return temporary;
  }

  void note(int number, const std::filesystem::path& path) {
    std::snprintf(left_behind[number], sizeof left_behind[number], "%s", path.c_str());
  }

  // What is removed when a signal ends the program: two files, then the folders that they are in.
  inline static char left_behind[4][4096];
  inline static std::filesystem::path temporary;
  std::filesystem::path output_;
};

}  // namespace padder::cli
