// SPDX-License-Identifier: MIT
// What the sources of read.h share. Not installed.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "padding/asset/error.h"
#include "padding/asset/mesh.h"

namespace padder::reading {

// Polygons as a reader finds them.
struct Soup {
  std::vector<Point> points;
  std::vector<std::uint32_t> corners;  // of all faces, one face after the other
  std::vector<std::uint64_t> ends;     // the corners of face f end before ends[f]
  std::vector<std::uint32_t> lines;    // of each point in a text file; may be empty
  std::uint64_t thin = 0;              // faces of one or two corners, left out
  std::string unit;                    // the file's own, or ""
  std::vector<std::string> notes;

  void close_face() { ends.push_back(corners.size()); }
};

[[noreturn]] inline void fail(const std::string& where, const std::string& what) {
  throw Error(where + ": " + what);
}

// Throws when 32-bit indices do not suffice.
void check_counts(std::uint64_t points, std::uint64_t triangles, const std::string& where);

Soup read_obj(std::string& bytes, const std::string& where);
Soup read_off(const std::string& bytes, const std::string& where);
Soup read_ply(const std::string& bytes, const std::string& where);
Soup read_3mf(const std::string& bytes, const std::string& where);
Soup read_scene(const std::string& bytes, const std::filesystem::path& path, const std::string& ending);

// Calls `read` in a forked process and brings its soup (without lines) or its Error here: a crash,
// an abort, an endless loop or boundless memory there is one sentence here. The process has 30 s and 4 GiB,
// more for large files. Only the calling thread lives on in it: `read` may wait for no other, and uses no
// OpenMP.
Soup in_child(const std::function<Soup()>& read, std::size_t file_size, const std::string& where);

// Faults that assimp answers with a wrong mesh are refused, and what can be mended is, which a note says.
void check_stl(std::string& bytes, const std::string& where, std::vector<std::string>& notes);

// Text: the lines of a file, whatever ends them (\n, \r\n or \r), counted from 1.
class Lines {
 public:
  explicit Lines(std::string_view text) : text_(text) {}
  bool next(std::string_view& line);
  std::uint32_t number() const { return number_; }
  std::size_t offset() const { return at_; }  // where the next line begins

 private:
  std::string_view text_;
  std::size_t at_ = 0;
  std::uint32_t number_ = 0;
};

// Takes the next word off the front of the line; empty at its end.
std::string_view next_word(std::string_view& line);

enum class Number { finite, not_finite, malformed };
Number parse_real(std::string_view word,
                  double& value);  // decimal point whatever the locale; correctly rounded
bool parse_whole(std::string_view word, std::int64_t& value);  // the whole word; false also when it overflows

// Reads x y z off the line. A number that is no number is refused; nan, inf and what overflows is kept as
// such.
Point parse_point(std::string_view& line, const std::string& where, std::uint32_t line_number);

std::string printable(std::string_view word);  // its excerpt, quoted

}  // namespace padder::reading
