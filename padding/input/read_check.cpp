// SPDX-License-Identifier: MIT
// Checks an STL before assimp reads it. Otherwise assimp 5.2 takes a facet of four vertices for one of three,
// and refuses a file with some bytes behind the facets.
#include <algorithm>

#include "padding/input/read_internal.h"

namespace padder::reading {
namespace {

void check_ascii_stl(std::string_view text, const std::string& where) {
  Lines lines(text);
  int vertices = -1;  // of the facet that is open; -1 outside
  for (std::string_view line; lines.next(line);) {
    const std::string key = lower_case(next_word(line));
    const auto here = [&](const std::string& what) {
      fail(where, at_line(lines.number()) + what + ": export the mesh again");
    };
    if (key == "facet") {
      if (vertices >= 0) here("a facet begins inside another");
      vertices = 0;
    } else if (key == "vertex") {
      if (vertices < 0) here("a vertex outside of a facet");
      parse_point(line, where, lines.number());
      vertices++;
    } else if (key == "endfacet") {
      if (vertices != 3)
        here("a facet of " + std::to_string(std::max(vertices, 0)) + " vertices, where STL has three");
      vertices = -1;
    } else if (!key.empty() && key != "outer" && key != "endloop" && key != "endsolid" && key != "solid") {
      here(printable(key) + " is no word of STL");
    }
  }
  if (vertices >= 0) fail(where, "it ends inside a facet: the file is cut short, export it again");
}

}  // namespace

void check_stl(std::string& bytes, const std::string& where, std::vector<std::string>& notes) {
  // A binary file has 80 bytes of anything (it may begin with "solid"), the number of facets, and 50 bytes
  // for each.
  std::uint64_t facets = 0, wanted = 84;
  if (bytes.size() >= 84) {
    for (int k = 3; k >= 0; k--)
      facets = facets << 8 | static_cast<unsigned char>(bytes[80 + static_cast<std::size_t>(k)]);
    wanted += 50 * facets;
    if (bytes.size() == wanted) {
      if (facets == 0) fail(where, "a binary STL without a facet: export the mesh again");
      return;
    }
  }
  if (bytes.starts_with(kByteOrderMark)) bytes.erase(0, kByteOrderMark.size());
  const std::string_view head = std::string_view(bytes).substr(0, 1024);
  std::string_view start = head;
  start.remove_prefix(std::min(start.find_first_not_of(" \t\r\n"), start.size()));
  if (lower_case(start.substr(0, 5)) == "solid" && head.find('\0') == head.npos) {
    check_ascii_stl(bytes, where);
    // assimp knows neither upper case nor blanks before the first word.
    bytes = lower_case(bytes).substr(head.size() - start.size());
    return;
  }
  if (bytes.size() < 84)
    fail(where,
         "too short for a binary STL and no text STL either: the file is cut short or of another format");
  if (bytes.size() < wanted)
    fail(where, "as a binary STL it promises " + std::to_string(facets) + " facets, but has room for " +
                    std::to_string((bytes.size() - 84) / 50) +
                    ": the file is cut short or of another format, export it again");
  if (facets == 0 || bytes.size() - wanted >= 50)
    fail(where, "as a binary STL it promises " + std::to_string(facets) + " facets, but has " +
                    std::to_string((bytes.size() - 84) / 50) +
                    ": which of both is true cannot be known, export it again");
  notes.push_back(std::to_string(bytes.size() - wanted) + " bytes behind the last facet left out");
  bytes.resize(wanted);
}

}  // namespace padder::reading
