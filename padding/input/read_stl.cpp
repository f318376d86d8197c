// SPDX-License-Identifier: MIT
// Reads STL: text in double precision, and binary files, which hold floats. assimp 5.2 takes a facet of four
// vertices for one of three, knows no upper case, and refuses a file with some bytes behind the facets.
#include <algorithm>
#include <bit>
#include <cstring>

#include "padding/asset/excerpt.h"
#include "padding/input/read_internal.h"

static_assert(std::endian::native == std::endian::little, "binary STL is little-endian");

namespace padder::reading {
namespace {

// Takes the name of a solid off the front of the line. It ends with the line, or where a facet begins.
void pass_name(std::string_view& line) {
  constexpr std::string_view begin = "facet normal";
  const auto same = [](char a, char b) { return (a >= 'A' && a <= 'Z' ? a - 'A' + 'a' : a) == b; };
  for (std::string_view facet = line;; facet.remove_prefix(1)) {
    facet = {std::search(facet.begin(), facet.end(), begin.begin(), begin.end(), same), facet.end()};
    std::string_view rest = facet.substr(std::min(begin.size(), facet.size()));
    double number = 0;
    if (facet.empty() || parse_real(next_word(rest), number) != Number::malformed) return void(line = facet);
  }
}

Soup read_text_stl(std::string_view text, const std::string& where) {
  Soup soup;
  Lines lines(text);
  int vertices = -1;  // of the facet that is open; -1 outside
  bool ended = false;
  const auto fail_here = [&](const std::string& what) {
    fail(where, at_line(lines.number()) + what + ": export the mesh again");
  };
  const auto statement = [&](const std::string& key, std::string_view& line) {
    if (key == "facet") {
      if (vertices >= 0) fail_here("a facet begins inside another");
      vertices = 0;
    } else if (key == "normal") {
      for (int k = 0; k < 3; k++) next_word(line);
    } else if (key == "vertex") {
      if (vertices < 0) fail_here("a vertex outside of a facet");
      soup.corners.push_back(static_cast<std::uint32_t>(soup.points.size()));
      soup.points.push_back(parse_point(line, where, lines.number()));
      soup.lines.push_back(lines.number());
      vertices++;
    } else if (key == "endfacet") {
      if (vertices != 3)
        fail_here("a facet of " + std::to_string(std::max(vertices, 0)) + " vertices, where STL has three");
      vertices = -1;
      soup.close_face();
    } else if (key == "solid" || key == "endsolid") {
      ended = key == "endsolid";
      pass_name(line);
    } else if (key != "outer" && key != "loop" && key != "endloop") {
      fail_here(printable(key) + " is no word of STL");
    }
  };
  for (std::string_view line; lines.next(line);)
    for (std::string key; !(key = lower_case(next_word(line))).empty();) statement(key, line);
  if (vertices >= 0) fail(where, "it ends inside a facet: the file is cut short, export it again");
  if (!ended) soup.notes.push_back("no endsolid stands behind the last facet: the file may be cut short");
  check_counts(soup.points.size(), soup.ends.size(), where);
  return soup;
}

// 80 bytes of anything (they may begin with "solid"), the number of facets, and 50 bytes for each.
constexpr std::size_t kHead = 84, kFacet = 50;

Soup read_binary_stl(std::string_view bytes, std::size_t facets, const std::string& where) {
  check_counts(3 * facets, facets, where);
  Soup soup;
  for (std::size_t f = 0; f < facets; f++) {
    float numbers[12];  // the normal and three vertices
    std::memcpy(numbers, bytes.data() + kHead + kFacet * f, sizeof numbers);
    for (int k = 3; k < 12; k += 3) {
      soup.corners.push_back(static_cast<std::uint32_t>(soup.points.size()));
      soup.points.emplace_back(numbers[k], numbers[k + 1], numbers[k + 2]);
    }
    soup.close_face();
  }
  return soup;
}

}  // namespace

Soup read_stl(const std::string& bytes, const std::string& where) {
  std::uint32_t facets = 0;
  if (bytes.size() >= kHead) std::memcpy(&facets, bytes.data() + kHead - sizeof facets, sizeof facets);
  const std::size_t wanted = kHead + kFacet * std::size_t{facets};
  if (bytes.size() == wanted) return read_binary_stl(bytes, facets, where);

  const std::string_view head = std::string_view(bytes).substr(0, 1024);
  Lines lines(head);
  std::string_view start;
  while (start.empty() && lines.next(start)) start = next_word(start);
  if (lower_case(start.substr(0, 5)) == "solid" && head.find('\0') == head.npos)
    return read_text_stl(bytes, where);
  if (bytes.size() < kHead)
    fail(where,
         "too short for a binary STL and no text STL either: the file is cut short or of another format");
  const std::size_t room = (bytes.size() - kHead) / kFacet;
  if (bytes.size() < wanted)
    fail(where, "as a binary STL it promises " + std::to_string(facets) + " facets, but has room for " +
                    std::to_string(room) + ": the file is cut short or of another format, export it again");
  if (room > facets)
    fail(where, "as a binary STL it promises " + std::to_string(facets) + " facets, but has " +
                    std::to_string(room) + ": which of both is true cannot be known, export it again");
  Soup soup = read_binary_stl(bytes, facets, where);
  soup.notes.push_back(std::to_string(bytes.size() - wanted) + " bytes behind the last facet left out");
  return soup;
}

}  // namespace padder::reading
