// SPDX-License-Identifier: MIT
// Words and numbers of text files, for the readers of meshes. Not installed.
#pragma once
#include <cstdint>
#include <string>
#include <string_view>

#include "padding/asset/error.h"
#include "padding/asset/mesh.h"

namespace padder::reading {

// Throws Error: "FILE: what is wrong and what to do".
[[noreturn]] inline void fail(const std::string& where, const std::string& what) {
  throw Error(where + ": " + what);
}

// Some programs for Windows begin a text with it.
inline constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";

// The lines of a text, counted from 1. They may end with \n, \r\n or \r. A byte order mark is passed over.
class Lines {
 public:
  explicit Lines(std::string_view text)
      : text_(text), at_(text.starts_with(kByteOrderMark) ? kByteOrderMark.size() : 0) {}
  bool next(std::string_view& line);
  std::uint32_t number() const { return number_; }
  std::size_t offset() const { return at_; }  // where the next line begins

 private:
  std::string_view text_;
  std::size_t at_;
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

std::string at_line(std::uint32_t line);  // "line 7: "

}  // namespace padder::reading
