// Checks of STL and PLY before assimp sees them. Without these, assimp 5.2 crashes on a PLY header that is
// cut, hangs on one without end_header, reads faces out of the memory behind a short PLY, asks for 48 GB when
// a header says so, takes an STL facet of four vertices for one of three, and refuses an STL with some bytes
// behind it.
#include <algorithm>
#include <bit>
#include <cctype>
#include <cstring>

#include "padding/read_internal.h"

namespace padder::reading {
namespace {

std::string line_at(std::uint32_t line) { return "line " + std::to_string(line) + ": "; }

std::string lower(std::string_view text) {
  std::string s(text);
  for (char& c : s) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return s;
}

void check_ascii_stl(std::string_view text, const std::string& where) {
  Lines lines(text);
  int vertices = -1;  // of the open facet; -1 outside of one
  for (std::string_view line; lines.next(line);) {
    const std::string key = lower(next_word(line));
    const auto here = [&](const std::string& what) {
      fail(where, line_at(lines.number()) + what + ": export the mesh again");
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

// PLY

struct Property {
  std::string name;
  int type = -1, count_type = -1;  // index into type_sizes; count_type >= 0: a list
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

constexpr int type_sizes[] = {1, 1, 2, 2, 4, 4, 4, 8};
constexpr const char* type_names[][2] = {{"char", "int8"},     {"uchar", "uint8"},   {"short", "int16"},
                                         {"ushort", "uint16"}, {"int", "int32"},     {"uint", "uint32"},
                                         {"float", "float32"}, {"double", "float64"}};

int type_of(std::string_view word) {
  for (int k = 0; k < 8; k++)
    if (word == type_names[k][0] || word == type_names[k][1]) return k;
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
      if (lower(key) != "ply")
        fail(where, "a PLY file begins with the line ply: give the file the ending of its format");
      first = false;
      continue;
    }
    const auto here = [&](const std::string& what) {
      fail(where, line_at(lines.number()) + what + ": export the mesh again");
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

// Numbers of the body, one by one.
class Body {
 public:
  virtual ~Body() = default;
  // False at the end of the file, or when there is no number of this type.
  virtual bool read(int type, double& value) = 0;
  virtual std::size_t left() const = 0;  // bytes
};

class Binary : public Body {
 public:
  Binary(std::string_view bytes, bool big)
      : bytes_(bytes), swap_(big == (std::endian::native == std::endian::little)) {}
  bool read(int type, double& value) override {
    switch (type) {
      case 0:
        return take<std::int8_t>(value);
      case 1:
        return take<std::uint8_t>(value);
      case 2:
        return take<std::int16_t>(value);
      case 3:
        return take<std::uint16_t>(value);
      case 4:
        return take<std::int32_t>(value);
      case 5:
        return take<std::uint32_t>(value);
      case 6:
        return take<float>(value);
      default:
        return take<double>(value);
    }
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

 private:
  Lines lines_;
  std::string_view line_;
  std::size_t size_;
};

// Also keeps the vertices that are declared as doubles, of which assimp would leave the digits of a float.
void check_body(const Header& header, Body& body, const std::string& where, std::vector<Point>& doubles) {
  std::int64_t vertices = 0;
  for (const Element& e : header.elements) vertices = e.name == "vertex" ? e.count : vertices;
  for (const Element& e : header.elements) {
    if (e.properties.empty()) continue;
    // Each row takes a byte at least: a count beyond the file is known before any loop.
    const auto cut = [&](std::int64_t row) {
      fail(where, "its header promises " + std::to_string(e.count) + " of element " + printable(e.name) +
                      ", but number " + std::to_string(row + 1) +
                      " cannot be read: the file is cut short or damaged, export it again");
    };
    if (static_cast<std::uint64_t>(e.count) > body.left()) cut(static_cast<std::int64_t>(body.left()));
    for (std::int64_t row = 0; row < e.count; row++) {
      Point position = Point::Zero();
      bool precise = false;
      for (const Property& p : e.properties) {
        double value = 0, length = 1;
        if (p.count_type >= 0 && (!body.read(p.count_type, length) || length < 0)) cut(row);
        const bool corner = e.name == "face" && p.count_type >= 0 && p.type < 6 &&
                            (p.name == "vertex_indices" || p.name == "vertex_index");
        if (length > static_cast<double>(body.left())) cut(row);
        for (double k = 0; k < length; k++) {
          if (!body.read(p.type, value)) cut(row);
          if (corner && !(value >= 0 && value < static_cast<double>(vertices)))
            fail(where, "face " + std::to_string(row + 1) + " of " + std::to_string(e.count) +
                            " (counted from 1) names vertex " +
                            std::to_string(static_cast<std::int64_t>(value)) + ", but there are only 0 to " +
                            std::to_string(vertices - 1) + ": export the mesh again");
        }
        if (e.name != "vertex" || p.count_type >= 0 || p.name.size() != 1 || p.name < "x" || p.name > "z")
          continue;
        position[p.name[0] - 'x'] = value;
        precise = precise || p.type == 7;
      }
      if (precise) doubles.push_back(position);
    }
  }
}

}  // namespace

void check_stl(std::string& bytes, const std::string& where, std::vector<std::string>& notes) {
  // Binary: 80 bytes of anything (it may begin with "solid"), the number of facets, 50 bytes for each.
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
  const std::string_view head = std::string_view(bytes).substr(0, 1024);
  std::string_view start = head;
  start.remove_prefix(std::min(start.find_first_not_of(" \t\r\n"), start.size()));
  if (lower(start.substr(0, 5)) == "solid" && head.find('\0') == head.npos) {
    check_ascii_stl(bytes, where);
    bytes = lower(bytes);  // assimp knows no FACET
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

std::vector<Point> check_ply(const std::string& bytes, const std::string& where,
                             std::vector<std::string>& notes) {
  std::vector<Point> doubles;
  const Header header = read_header(bytes, where);
  for (const Element& e : header.elements) {
    check_counts(e.name == "vertex" ? static_cast<std::uint64_t>(e.count) : 0, 0, where);
    if (e.name != "vertex") continue;
    for (const char* name : {"x", "y", "z"})
      if (std::ranges::find(e.properties, name, &Property::name) == e.properties.end())
        fail(where, std::string("its vertices have no property ") + name + ": export the mesh again");
  }
  const std::string_view rest = std::string_view(bytes).substr(header.body);
  if (header.format == "ascii") {
    Text body(rest);
    check_body(header, body, where, doubles);
  } else {
    Binary body(rest, header.format == "binary_big_endian");
    check_body(header, body, where, doubles);
    if (body.left() > 0)
      notes.push_back(std::to_string(body.left()) + " bytes behind the last element left out");
  }
  return doubles;
}

}  // namespace padder::reading
