// SPDX-License-Identifier: MIT
// What the readers of mesh files share. Not installed.
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

// Polygons as a file has them.
struct Soup {
  std::vector<Point> points;
  std::vector<std::uint32_t> corners;  // indices of the corners of all faces, one face after the other
  std::vector<std::uint64_t> ends;     // the corners of face f end before ends[f]
  std::vector<std::uint32_t> lines;    // for each point its line in a text file; may be empty
  std::uint64_t thin = 0;              // number of faces with one or two corners, which are left out
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

// Calls `read` in a forked process and brings its soup (without lines) or its Error here. A crash, an abort,
// an endless loop or endless memory there becomes one sentence here. The process has 30 s and 4 GiB, and more
// for large files. Only the calling thread lives on in it, so `read` must not wait for another thread or use
// OpenMP.
Soup in_child(const std::function<Soup()>& read, std::size_t file_size, const std::string& where);

// Refuses faults for which assimp would give a wrong mesh. Mends the others and adds a note.
void check_stl(std::string& bytes, const std::string& where, std::vector<std::string>& notes);

// The lines of a text, counted from 1. They may end with \n, \r\n or \r.
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

// Takes the next word off the front of the line. The word is empty at the end of the line.
std::string_view next_word(std::string_view& line);

enum class Number { finite, not_finite, malformed };
// The decimal point is a point in every locale. The value is correctly rounded.
Number parse_real(std::string_view word, double& value);
bool parse_whole(std::string_view word,
                 std::int64_t& value);  // false, too, when it overflows or more follows

// Takes x, y and z off the front of the line. Throws Error for a word that is not a number, but accepts nan,
// inf and numbers that overflow.
Point parse_point(std::string_view& line, const std::string& where, std::uint32_t line_number);

std::string printable(std::string_view word);  // its excerpt in quotes

}  // namespace padder::reading
