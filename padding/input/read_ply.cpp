// SPDX-License-Identifier: MIT
// Reads PLY. assimp 5.2 reads a triangle strip as one triangle, keeps doubles as floats, and crashes on a
// damaged file or makes up faces from it.
#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

#include "padding/asset/excerpt.h"
#include "padding/input/read_internal.h"

namespace padder::reading {
namespace {

struct Property {
  std::string name;
  int type = -1, count_type = -1;  // index into kTypeNames; a list has a count_type >= 0
};
struct Element {
  std::string name;
  std::int64_t count = 0;
  std::vector<Property> properties;
};
struct Header {
  std::string format;
  std::vector<Element> elements;
  std::size_t body = 0;  // byte offset
};

constexpr const char* kTypeNames[][2] = {{"char", "int8"},     {"uchar", "uint8"},   {"short", "int16"},
                                         {"ushort", "uint16"}, {"int", "int32"},     {"uint", "uint32"},
                                         {"float", "float32"}, {"double", "float64"}};

int type_of(std::string_view word) {
  for (int k = 0; k < 8; k++)
    if (word == kTypeNames[k][0] || word == kTypeNames[k][1]) return k;
  return -1;
}

Header read_header(std::string_view bytes, const std::string& where) {
  Header header;
  Lines lines(bytes);
  std::string_view line;
  bool first = true;
  while (lines.next(line)) {
    const std::string_view whole = line;
    const std::string_view key = next_word(line);
    if (first) {
      if (lower_case(key) != "ply")
        fail(where, "a PLY file begins with the line ply: give the file the ending of its format");
      first = false;
      continue;
    }
    const auto here = [&](const std::string& what) {
      fail(where, at_line(lines.number()) + what + ": export the mesh again");
    };
    if (key == "end_header") {
      header.body = lines.offset();
      if (header.format.empty()) fail(where, "its header names no format: export the mesh again");
      return header;
    }
    if (key == "format") {
      header.format = next_word(line);
      if (header.format != "ascii" && header.format != "binary_little_endian" &&
          header.format != "binary_big_endian")
        here("the format " + printable(header.format) +
             " is not ascii, binary_little_endian or binary_big_endian");
    } else if (key == "element") {
      Element element;
      element.name = next_word(line);
      const std::string_view count = next_word(line);
      if (!parse_whole(count, element.count) || element.count < 0)
        here("the number of elements is " + printable(count) + ", where a whole number from 0 is wanted");
      header.elements.push_back(std::move(element));
    } else if (key == "property") {
      Property property;
      std::string_view type = next_word(line);
      if (header.elements.empty()) here("a property before the first element");
      if (type == "list") {
        const std::string_view count = next_word(line);
        property.count_type = type_of(count);
        if (property.count_type < 0 || property.count_type > 5)
          here(printable(count) + " is no type for the length of a list");
        type = next_word(line);
      }
      property.type = type_of(type);
      property.name = next_word(line);
      if (property.type < 0) here(printable(type) + " is no type of PLY");
      if (property.name.empty()) here("a property without a name");
      header.elements.back().properties.push_back(std::move(property));
    } else if (!key.empty() && key != "comment" && key != "obj_info") {
      here("the header cannot hold " + printable(whole));
    }
  }
  fail(where, "its header has no end_header line: the file is cut short or damaged, export it again");
}

// Gives the numbers of the body one by one.
class Body {
 public:
  virtual ~Body() = default;
  // Returns false at the end of the file, and where no number of this type stands.
  virtual bool read(int type, double& value) = 0;
  virtual std::size_t left() const = 0;  // bytes that are left
};

class Binary : public Body {
 public:
  Binary(std::string_view bytes, bool big)
      : bytes_(bytes), swap_(big == (std::endian::native == std::endian::little)) {}
  // The types are numbered as in kTypeNames.
  bool read(int type, double& value) override {
    static constexpr bool (Binary::*kTakes[])(double&) = {
        &Binary::take<std::int8_t>,   &Binary::take<std::uint8_t>, &Binary::take<std::int16_t>,
        &Binary::take<std::uint16_t>, &Binary::take<std::int32_t>, &Binary::take<std::uint32_t>,
        &Binary::take<float>,         &Binary::take<double>};
    return (this->*kTakes[type])(value);
  }
  std::size_t left() const override { return bytes_.size(); }

 private:
  template <class T>
  bool take(double& value) {
    char raw[sizeof(T)];
    if (bytes_.size() < sizeof(T)) return false;
    std::copy_n(bytes_.data(), sizeof(T), raw);
    if (swap_) std::reverse(raw, raw + sizeof(T));
    T number;
    std::memcpy(&number, raw, sizeof(T));
    value = static_cast<double>(number);
    bytes_.remove_prefix(sizeof(T));
    return true;
  }
  std::string_view bytes_;
  bool swap_;
};

class Text : public Body {
 public:
  explicit Text(std::string_view bytes) : lines_(bytes), size_(bytes.size()) {}
  bool read(int type, double& value) override {
    std::string_view word;
    while ((word = next_word(line_)).empty())
      if (!lines_.next(line_)) return false;
    if (type >= 6) return parse_real(word, value) != Number::malformed;
    std::int64_t whole;
    if (!parse_whole(word, whole)) return false;
    value = static_cast<double>(whole);
    return true;
  }
  std::size_t left() const override { return size_ - std::min(size_, lines_.offset()) + line_.size(); }
  // The first word that was not read, and the line it is in, counted from 1; "" at the end of the file.
  std::pair<std::string_view, std::uint32_t> next() {
    std::string_view word;
    while ((word = next_word(line_)).empty() && lines_.next(line_)) continue;
    return {word, lines_.number()};
  }

 private:
  Lines lines_;
  std::string_view line_;
  std::size_t size_;
};

// What a property is used for.
enum class Role { none, x, y, z, corners };

Role role_of(const Element& e, const Property& p) {
  const bool list = p.count_type >= 0;
  if (e.name == "vertex" && !list && p.name.size() == 1 && p.name >= "x" && p.name <= "z")
    return p.name == "x" ? Role::x : p.name == "y" ? Role::y : Role::z;
  const bool faces = e.name == "face" || e.name == "tristrips";
  return faces && list && (p.name == "vertex_indices" || p.name == "vertex_index") ? Role::corners
                                                                                   : Role::none;
}

// Refuses a header of which something would be left out or misunderstood.
void check_elements(const Header& header, const std::string& where) {
  for (std::size_t k = 0; k < header.elements.size(); k++) {
    const Element& e = header.elements[k];
    for (std::size_t i = 0; i < k; i++)
      if (header.elements[i].name == e.name)
        fail(where, "its header names element " + printable(e.name) + " twice: export the mesh again");
    std::array<int, 5> found{};
    for (const Property& p : e.properties) {
      const Role role = role_of(e, p);
      found[static_cast<std::size_t>(role)]++;
      if (role == Role::corners && p.type >= 6)
        fail(where, "its " + e.name + " have indices that are no whole numbers: export the mesh again");
      if (role == Role::none && p.count_type >= 0 && e.name != "face" && p.name.starts_with("vertex_ind"))
        fail(where, "its element " + printable(e.name) + " has vertex indices, and faces are read from " +
                        "'face' and 'tristrips' alone: export the mesh again");
    }
    const auto once = [&](Role role, const char* name) {
      if (const int n = found[static_cast<std::size_t>(role)]; n != 1)
        fail(where, "its element " + printable(e.name) + " has " +
                        (n ? "more than one property " : "no property ") + name + ": export the mesh again");
    };
    if (e.name == "vertex") {
      check_counts(static_cast<std::uint64_t>(e.count), 0, where);
      once(Role::x, "x"), once(Role::y, "y"), once(Role::z, "z");
    } else if ((e.name == "face" || e.name == "tristrips") && e.count > 0) {
      once(Role::corners, "vertex_indices");
    }
  }
}

class PlyReader {
 public:
  PlyReader(const Header& header, Body& body, const std::string& where)
      : header_(header), body_(body), where_(where) {
    for (const Element& e : header.elements)
      if (e.name == "vertex") vertices_ = e.count;
  }

  Soup read() {
    for (const Element& e : header_.elements) {
      // Each row takes at least one byte, so a count beyond the file is noticed before any loop.
      if (!e.properties.empty() && static_cast<std::uint64_t>(e.count) > body_.left())
        cut(e, static_cast<std::int64_t>(body_.left()));
      for (std::int64_t row = 0; row < e.count && !e.properties.empty(); row++) read_row(e, row);
    }
    return std::move(soup_);
  }

 private:
  [[noreturn]] void cut(const Element& e, std::int64_t row) const {
    fail(where_, "its header promises " + std::to_string(e.count) + " of element " + printable(e.name) +
                     ", but number " + std::to_string(row + 1) +
                     " cannot be read: the file is cut short or damaged, export it again");
  }

  void read_row(const Element& e, std::int64_t row) {
    Point position = Point::Zero();
    for (const Property& p : e.properties) {
      const Role role = role_of(e, p);
      double value = 0, length = 1;
      if (p.count_type >= 0 && (!body_.read(p.count_type, length) || length < 0)) cut(e, row);
      if (length > static_cast<double>(body_.left())) cut(e, row);
      corners_.clear();
      for (double k = 0; k < length; k++) {
        if (!body_.read(p.type, value)) cut(e, row);
        if (role == Role::corners) corners_.push_back(corner(e, row, value));
      }
      // A text may have more digits than the float that it declares.
      if (role == Role::x || role == Role::y || role == Role::z)
        position[static_cast<int>(role) - 1] = p.type == 6 ? static_cast<float>(value) : value;
      if (role == Role::corners) e.name == "face" ? add_face() : add_strips();
    }
    if (e.name == "vertex") soup_.points.push_back(position);
  }

  // Returns -1 where a strip ends.
  std::int64_t corner(const Element& e, std::int64_t row, double value) const {
    if (value == -1 && e.name == "tristrips") return -1;
    if (!(value >= 0 && value < static_cast<double>(vertices_)))
      fail(where_, (e.name == "face" ? "face " : "strip ") + std::to_string(row + 1) + " of " +
                       std::to_string(e.count) + " (counted from 1) names vertex " +
                       std::to_string(static_cast<std::int64_t>(value)) + ", but there are only 0 to " +
                       std::to_string(vertices_ - 1) + ": export the mesh again");
    return static_cast<std::int64_t>(value);
  }

  void add_face() {
    if (corners_.size() < 3) {
      soup_.thin++;
      return;
    }
    for (const std::int64_t v : corners_) soup_.corners.push_back(static_cast<std::uint32_t>(v));
    soup_.close_face();
  }

  // From the third on, each corner of a strip makes a triangle with the two corners before it, every second
  // one the other way round. Triangles with a corner twice only lead the strip elsewhere.
  void add_strips() {
    std::size_t begin = 0;
    for (std::size_t k = 0; k < corners_.size(); k++) {
      if (corners_[k] < 0) {
        begin = k + 1;
        continue;
      }
      if (k < begin + 2) continue;
      std::int64_t a = corners_[k - 2], b = corners_[k - 1];
      const std::int64_t c = corners_[k];
      if (a == b || b == c || c == a) continue;
      if ((k - begin) % 2 != 0) std::swap(a, b);
      for (const std::int64_t v : {a, b, c}) soup_.corners.push_back(static_cast<std::uint32_t>(v));
      soup_.close_face();
    }
  }

  const Header& header_;
  Body& body_;
  const std::string& where_;
  std::int64_t vertices_ = 0;
  std::vector<std::int64_t> corners_;  // of the current row
  Soup soup_;
};

}  // namespace

Soup read_ply(const std::string& bytes, const std::string& where) {
  const Header header = read_header(bytes, where);
  check_elements(header, where);
  const std::string_view rest = std::string_view(bytes).substr(header.body);
  Soup soup;
  if (header.format == "ascii") {
    Text body(rest);
    soup = PlyReader(header, body, where).read();
    const auto head =
        static_cast<std::uint32_t>(std::count(bytes.begin(), bytes.end() - std::ssize(rest), '\n'));
    if (const auto [word, line] = body.next(); !word.empty())
      fail(where, at_line(head + line) + printable(word) +
                      " stands behind the last element: the header promises " +
                      "fewer than there are, export the mesh again");
  } else {
    Binary body(rest, header.format == "binary_big_endian");
    soup = PlyReader(header, body, where).read();
    if (body.left() > 0)
      soup.notes.push_back(std::to_string(body.left()) + " bytes behind the last element left out");
  }
  for (const Element& e : header.elements)
    if (e.count > 0 && e.name == "edge") soup.notes.push_back(std::to_string(e.count) + " edges left out");
  return soup;
}

}  // namespace padder::reading
