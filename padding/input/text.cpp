// SPDX-License-Identifier: MIT
#include "padding/input/text.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>

#include "padding/asset/excerpt.h"

namespace padder::reading {

bool Lines::next(std::string_view& line) {
  if (at_ >= text_.size()) return false;
  const std::size_t end = std::min(text_.find_first_of("\r\n", at_), text_.size());
  line = text_.substr(at_, end - at_);
  at_ = std::min(end + (text_.substr(end, 2) == "\r\n" ? 2 : 1), text_.size());  // the last may have no end
  number_++;
  return true;
}

std::string_view next_word(std::string_view& line) {
  const char* blank = " \t\v\f";
  line.remove_prefix(std::min(line.find_first_not_of(blank), line.size()));
  const std::string_view word = line.substr(0, line.find_first_of(blank));
  line.remove_prefix(word.size());
  return word;
}

Number parse_real(std::string_view word, double& value) {
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);
  const char* end = word.data() + word.size();
  auto [stop, code] = std::from_chars(word.data(), end, value);
  // A number too small for a double is 0, one too large is infinite.
  if (code == std::errc::result_out_of_range)
    value =
        word.find_first_of("eE") != word.npos && word.substr(word.find_first_of("eE") + 1).starts_with('-')
            ? 0
            : std::numeric_limits<double>::infinity();
  else if (code != std::errc())
    return Number::malformed;
  if (stop != end) {
    if (std::string_view(stop, end).substr(0, 2) != "#I" && std::string_view(stop, end).substr(0, 2) != "#Q")
      return Number::malformed;
    value = std::numeric_limits<double>::quiet_NaN();  // 1.#INF, 1.#IND or 1.#QNAN, from an old C library
  }
  return std::isfinite(value) ? Number::finite : Number::not_finite;
}

bool parse_whole(std::string_view word, std::int64_t& value) {
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);
  const auto [stop, code] = std::from_chars(word.data(), word.data() + word.size(), value);
  return code == std::errc() && stop == word.data() + word.size();
}

Point parse_point(std::string_view& line, const std::string& where, std::uint32_t line_number) {
  Point p;
  for (int k = 0; k < 3; k++) {
    const std::string_view word = next_word(line);
    if (word.empty())
      fail(where, at_line(line_number) + "a vertex needs three coordinates, here are " + std::to_string(k) +
                      ": export the mesh again");
    if (parse_real(word, p[k]) == Number::malformed)
      fail(where, at_line(line_number) + printable(word) + " is not a number" +
                      (word.find(',') < word.size() ? " (decimals need a point, not a comma)" : "") +
                      ": export the mesh again");
  }
  return p;
}

std::string printable(std::string_view word) { return "'" + excerpt(word) + "'"; }

std::string at_line(std::uint32_t line) { return "line " + std::to_string(line) + ": "; }

}  // namespace padder::reading
