// SPDX-License-Identifier: MIT
// Reads the two text formats OBJ and OFF in double precision.
#include <algorithm>
#include <array>
#include <istream>
#include <streambuf>

#include "padding/asset/excerpt.h"
#include "padding/input/read_internal.h"

// Here tinyobjloader uses doubles. A program that links padder may use it with floats. Under a name of our
// own the two do not collide in the linker.
#define tinyobj padder_tinyobj
#define TINYOBJLOADER_USE_DOUBLE
#define TINYOBJLOADER_IMPLEMENTATION
#include <tiny_obj_loader.h>

namespace padder::reading {
namespace {

void refuse_binary(std::string_view bytes, const std::string& where, const char* kind) {
  if (bytes.substr(0, bytes.find('\n')).find("OFF BINARY") != bytes.npos)
    fail(where, "binary OFF is not read: save it as text, or as STL or PLY");
  const std::size_t zero = bytes.find('\0');
  if (zero == bytes.npos) return;
  const auto line = std::count(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(zero), '\n') + 1;
  fail(where, at_line(static_cast<std::uint32_t>(line)) + "a zero byte, so this is no " + kind +
                  " text (or a damaged one): give the file the ending of its format or export it again");
}

// A stream over the bytes, without a copy.
struct Bytes : std::streambuf {
  explicit Bytes(std::string& bytes) { setg(bytes.data(), bytes.data(), bytes.data() + bytes.size()); }
};

// The number before the first slash of a corner of a face.
std::int64_t corner_index(std::string_view word, const std::string& where, std::uint32_t line) {
  std::int64_t index = 0;
  const std::string_view head = word.substr(0, word.find('/'));
  if (!parse_whole(head, index))
    fail(where, at_line(line) + printable(word) + " is no vertex index: export the mesh again");
  if (index == 0)
    fail(where, at_line(line) + "a face names vertex 0, but OBJ counts from 1: export the mesh again");
  return index;
}

// Statements that have, or may have, a surface that is not read. A file with one of them is refused.
constexpr std::array<std::string_view, 9> kOtherSurfaces = {"surf", "fo",  "bzp",  "bsp", "cdc",
                                                            "cdp",  "res", "call", "csh"};

// Reads the vertices and refuses what tinyobjloader would accept in silence: it takes text that is no number
// for 0, reads a number only up to a comma, skips an empty face, and compares no index with the number of
// vertices.
void check_obj(std::string_view text, const std::string& where, Soup& soup) {
  std::int64_t largest = 0;
  std::uint32_t largest_line = 0;
  std::uint64_t others = 0;
  Lines lines(text);
  for (std::string_view line; lines.next(line);) {
    line = line.substr(0, line.find('#') == 0 ? 0 : line.size());
    const std::string_view key = next_word(line);
    if (key == "v") {
      soup.points.push_back(parse_point(line, where, lines.number()));
      soup.lines.push_back(lines.number());
      continue;
    }
    if (std::ranges::find(kOtherSurfaces, key) != kOtherSurfaces.end())
      fail(where,
           at_line(lines.number()) + "'" + std::string(key) +
               "' is a free-form surface or another file, which is not read: export the mesh as polygons");
    if (key == "l" || key == "p" || key == "curv" || key == "curv2") others++;
    if (key != "f") continue;
    int corners = 0;
    for (std::string_view word; !(word = next_word(line)).empty() && word[0] != '#'; corners++) {
      const std::int64_t index = corner_index(word, where, lines.number());
      const std::int64_t count = static_cast<std::int64_t>(soup.points.size());
      if (index < 0 && index < -count)
        fail(where, at_line(lines.number()) + "a face names vertex " + std::to_string(index) +
                        ", counted back from the last of " + std::to_string(count) +
                        ": there is none, export the mesh again");
      if (index > largest) largest = index, largest_line = lines.number();
    }
    if (corners == 0) fail(where, at_line(lines.number()) + "a face without corners: export the mesh again");
    if (corners < 3 && lines.offset() >= text.size() && !text.ends_with('\n'))
      fail(where, at_line(lines.number()) + "the file ends within a face of " + counted(corners, "corner") +
                      ": it is cut short, export it again");
  }
  if (others)
    soup.notes.push_back(counted(others, "line, curve or point", "lines, curves or points") + " left out");
  if (largest > static_cast<std::int64_t>(soup.points.size()))
    fail(where, at_line(largest_line) + "a face names vertex " + std::to_string(largest) +
                    ", but the file has only " + std::to_string(soup.points.size()) +
                    ": export the mesh again");
}

}  // namespace

Soup read_obj(std::string& bytes, const std::string& where) {
  refuse_binary(bytes, where, "OBJ");
  if (bytes.starts_with(kByteOrderMark)) bytes.erase(0, kByteOrderMark.size());  // for tinyobjloader
  // A backslash at the end of a line continues it on the next. tinyobjloader does not know that.
  for (std::size_t at = bytes.find('\\'); at != bytes.npos; at = bytes.find('\\', at + 1)) {
    const std::string_view tail = std::string_view(bytes).substr(at + 1, 2);
    const std::size_t length = tail == "\r\n" ? 3 : tail.starts_with('\n') || tail.starts_with('\r') ? 2 : 0;
    std::fill_n(bytes.begin() + static_cast<std::ptrdiff_t>(at), length, ' ');
  }
  Soup soup;
  check_obj(bytes, where, soup);
  check_counts(soup.points.size(), 0, where);

  // The vertices stay as the check has read them, because tinyobjloader's are off in the last digits. They
  // are still counted: a negative index counts back from the number of vertices so far.
  struct State {
    Soup& soup;
    std::int64_t vertices = 0;
  } state{soup};
  padder_tinyobj::callback_t callback;
  callback.vertex_cb = [](void* user, double, double, double, double) {
    static_cast<State*>(user)->vertices++;
  };
  callback.index_cb = [](void* user, padder_tinyobj::index_t* indices, int count) {
    State& s = *static_cast<State*>(user);
    const std::size_t begin = s.soup.corners.size();
    for (int k = 0; k < count && indices[k].vertex_index != 0; k++) {  // 0 means a comment behind the face
      const std::int64_t index = indices[k].vertex_index;
      s.soup.corners.push_back(static_cast<std::uint32_t>(index > 0 ? index - 1 : s.vertices + index));
    }
    if (s.soup.corners.size() - begin >= 3) return s.soup.close_face();
    s.soup.corners.resize(begin);
    s.soup.thin++;
  };
  Bytes buffer(bytes);
  std::istream stream(&buffer);
  std::string warning, error;
  if (!padder_tinyobj::LoadObjWithCallback(stream, callback, &state, nullptr, &warning, &error))
    fail(where, "tinyobjloader cannot read it (" + printable(error) + "): export the mesh again");
  // This can only happen if the check and tinyobjloader split a line differently.
  for (const std::uint32_t corner : soup.corners)
    if (corner >= soup.points.size())
      fail(where, "a face names a vertex that is not there: export the mesh again");
  return soup;
}

Soup read_off(const std::string& bytes, const std::string& where) {
  refuse_binary(bytes, where, "OFF");
  Lines lines(bytes);
  std::string_view line;
  const auto try_line = [&] {  // skips lines that hold only a comment
    while (lines.next(line)) {
      line = line.substr(0, line.find('#'));
      if (line.find_first_not_of(" \t\v\f") != line.npos) return true;
    }
    return false;
  };
  const auto next_line = [&](const std::string& wanted) {
    if (try_line()) return;
    fail(where, "it ends where " + wanted + " should stand: the file is cut short, export it again");
  };
  next_line("its header");
  const std::size_t magic = line.find("OFF");
  if (magic == line.npos || line.substr(0, magic).find_first_not_of(" \tSTCN4n") != line.npos)
    fail(where, at_line(lines.number()) + "an OFF file begins with OFF, not with " +
                    printable(next_word(line)) + ": give the file the ending of its format");
  if (line.substr(0, magic).find_first_of("4n") != line.npos)
    fail(where, "its points have four or n coordinates: export it as plain OFF");
  line.remove_prefix(magic + 3);

  std::int64_t counts[2] = {0, 0};
  for (int k = 0; k < 2; k++) {
    std::string_view word = next_word(line);
    if (word.empty() && k == 0) next_line("the numbers of vertices and faces"), word = next_word(line);
    if (word == "BINARY") fail(where, "binary OFF is not read: save it as text, or as PLY");
    if (!parse_whole(word, counts[k]) || counts[k] < 0)
      fail(where, at_line(lines.number()) + "the number of " + (k ? "faces" : "vertices") + " is " +
                      printable(word) + ": a whole number from 0 is wanted, export the mesh again");
    // A vertex takes at least six bytes ("0 0 0" and the end of the line), a face of one corner four.
    if (counts[k] > static_cast<std::int64_t>(bytes.size()) / (k ? 4 : 6) + 1)
      fail(where, at_line(lines.number()) + "the header says " + std::to_string(counts[k]) +
                      (k ? " faces" : " vertices") +
                      ", more than the file has room for: it is cut short or damaged, export it again");
  }
  Soup soup;
  for (std::int64_t v = 0; v < counts[0]; v++) {
    next_line("vertex " + std::to_string(v + 1) + " of " + std::to_string(counts[0]));
    soup.points.push_back(parse_point(line, where, lines.number()));
    soup.lines.push_back(lines.number());
  }
  for (std::int64_t f = 0; f < counts[1]; f++) {
    const std::string name = "face " + std::to_string(f + 1) + " of " + std::to_string(counts[1]);
    next_line(name);
    std::int64_t corners = 0, index = 0;
    bool broken = false;  // into several lines, as some programs write it
    std::string_view word = next_word(line);
    if (!parse_whole(word, corners) || corners < 1)
      fail(where, at_line(lines.number()) + name + " begins with " + printable(word) +
                      " where its number of corners should stand: export the mesh again");
    for (std::int64_t k = 0; k < corners; k++) {
      word = next_word(line);
      if (word.empty() && try_line()) word = next_word(line), broken = true;
      if (!parse_whole(word, index) || index < 0 || index >= counts[0])
        fail(where, at_line(lines.number()) + name + " has " +
                        (word.empty() ? "too few corners" : "a corner at vertex " + printable(word)) +
                        ", but needs " + std::to_string(corners) + " from 0 to " +
                        std::to_string(counts[0] - 1) + ": export the mesh again");
      soup.corners.push_back(static_cast<std::uint32_t>(index));
    }
    // Otherwise the line is the next face, and this one had too few corners.
    if (broken && !next_word(line).empty())
      fail(where, at_line(lines.number()) + name + " has too few corners, but needs " +
                      std::to_string(corners) + ": export the mesh again");
    if (corners >= 3)
      soup.close_face();
    else
      soup.corners.resize(soup.corners.size() - static_cast<std::size_t>(corners)), soup.thin++;
  }
  if (try_line())
    fail(where, at_line(lines.number()) + printable(next_word(line)) +
                    " stands behind the last face: the header says " + std::to_string(counts[1]) +
                    " and there are more, export the mesh again");
  return soup;
}

}  // namespace padder::reading
