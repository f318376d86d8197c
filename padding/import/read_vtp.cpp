// SPDX-License-Identifier: MIT
// Reads spheres from VTK's XML: the points, and the point data `radius`. Arrays may be ASCII, base64 or raw,
// and compressed by zlib.
#include <zlib.h>

#include <cmath>
#include <cstring>
#include <pugixml.hpp>

#include "padding/asset/excerpt.h"
#include "padding/import/readers.h"
#include "padding/import/xml.h"

namespace padder::importing {
namespace {

std::string from_base64(std::string_view text, const std::string& where) {
  std::string out;
  std::uint32_t bits = 0;
  int held = 0;
  for (const char c : text) {
    int v;
    if (c >= 'A' && c <= 'Z')
      v = c - 'A';
    else if (c >= 'a' && c <= 'z')
      v = c - 'a' + 26;
    else if (c >= '0' && c <= '9')
      v = c - '0' + 52;
    else if (c == '+')
      v = 62;
    else if (c == '/')
      v = 63;
    else if (c == '=') {  // the header of an array may end with padding of its own, before the data
      bits = 0, held = 0;
      continue;
    } else if (c == ' ' || c == '\n' || c == '\r' || c == '\t')
      continue;
    else
      throw Error(where + ": an array is not base64");
    bits = bits << 6 | static_cast<std::uint32_t>(v), held += 6;
    if (held >= 8) held -= 8, out += static_cast<char>(bits >> held & 255);
  }
  return out;
}

class Reader {
 public:
  Reader(std::string_view bytes, const std::string& where) : where_(where) {
    // Raw data may hold any byte, so it is cut out before the rest is read as XML.
    const auto appended = bytes.find("<AppendedData");
    std::string xml(bytes.substr(0, appended));
    if (appended != std::string_view::npos) {
      const auto close = bytes.find('>', appended), begin = bytes.find('_', close),
                 end = bytes.rfind("</AppendedData");
      if (close == std::string_view::npos || begin == std::string_view::npos ||
          end == std::string_view::npos || end <= begin)
        fail("the appended data is cut off");
      raw_ = bytes.substr(appended, close - appended).find("raw") != std::string_view::npos;
      appended_ = bytes.substr(begin + 1, end - begin - 1);
      xml += "</VTKFile>";
    }
    load_xml(document_, xml, where);
    const pugi::xml_node file = document_.child("VTKFile");
    if (!file.child("PolyData")) fail("not a VTK file of PolyData");
    if (std::string_view(file.attribute("byte_order").as_string("LittleEndian")) != "LittleEndian")
      fail("numbers must be little-endian");
    header_ = std::string_view(file.attribute("header_type").as_string("UInt32")) == "UInt64" ? 8 : 4;
    const std::string_view compressor = file.attribute("compressor").as_string();
    if (!compressor.empty() && compressor != "vtkZLibDataCompressor") fail("only zlib's compression is read");
    compressed_ = !compressor.empty();
  }

  Content content() {
    Part part;
    std::vector<std::uint32_t> body;
    for (const pugi::xml_node& piece : document_.child("VTKFile").child("PolyData").children("Piece")) {
      const std::vector<double> points = values(piece.child("Points").child("DataArray"));
      const pugi::xml_node data = piece.child("PointData");
      const pugi::xml_node radius = data.find_child_by_attribute("DataArray", "Name", "radius");
      if (!radius) fail("there is no point data called radius");
      const std::vector<double> radii = values(radius);
      if (points.size() != 3 * radii.size()) fail("radius has not one entry a point");
      for (std::size_t k = 0; k < radii.size(); k++) {
        part.centers.emplace_back(points[3 * k], points[3 * k + 1], points[3 * k + 2]);
        part.radii.push_back(radii[k]);
      }
      append_bits(part.family, data.find_child_by_attribute("DataArray", "Name", "family"), radii.size());
      append_bits(part.mask, data.find_child_by_attribute("DataArray", "Name", "mask"), radii.size());
      append_bits(body, data.find_child_by_attribute("DataArray", "Name", "body"), radii.size());
    }
    for (const auto* numbers : {&part.family, &part.mask, &body})
      if (!numbers->empty() && numbers->size() != part.radii.size())
        fail("a family, mask or body is stated in some pieces and not in others");
    Content out{parts_by_body(std::move(part), body)};
    const pugi::xml_node fields = document_.child("VTKFile").child("PolyData").child("FieldData");
    if (const pugi::xml_node unit = fields.find_child_by_attribute("DataArray", "Name", kUnitInMetres))
      out.unit = unit_of(values(unit), where_);
    return out;
  }

 private:
  [[noreturn]] void fail(const std::string& what) const { throw Error(where_ + ": " + what); }

  void append_bits(std::vector<std::uint32_t>& out, const pugi::xml_node& array, std::size_t n) {
    if (!array) return;
    const std::vector<double> v = values(array);
    if (v.size() != n) fail("families, masks and bodies must have one entry a point");
    for (const double f : v) {
      if (!(f >= 0 && f <= 4294967295.0) || f != std::floor(f))
        fail("a family, mask or body must be a whole number from 0 to 4294967295");
      out.push_back(static_cast<std::uint32_t>(f));
    }
  }

  std::uint64_t word(std::string_view in, std::uint64_t index) const {
    const auto size = static_cast<std::uint64_t>(header_);
    if (index >= in.size() / size) fail("an array is cut off");
    std::uint64_t value = 0;
    std::memcpy(&value, in.data() + index * size, size);
    return value;
  }

  // The data follow their length, or the lengths of their compressed blocks.
  std::string unpacked(std::string_view in) const {
    const auto size = static_cast<std::uint64_t>(header_);
    if (!compressed_) {
      const std::uint64_t bytes = word(in, 0);
      if (bytes > in.size() - size) fail("an array is cut off");
      return std::string(in.substr(size, bytes));
    }
    const std::uint64_t blocks = word(in, 0), whole = word(in, 1), last = word(in, 2);
    if (blocks > in.size()) fail("an array is cut off");
    std::uint64_t at = (3 + blocks) * size;
    std::string out;
    for (std::uint64_t b = 0; b < blocks; b++) {
      const std::uint64_t packed = word(in, 3 + b), plain = b + 1 == blocks && last ? last : whole;
      if (at > in.size() || packed > in.size() - at || plain > 1100 * packed + 1100)
        fail("an array is cut off");  // zlib packs 1032 to 1 at most
      std::string block(plain, '\0');
      uLongf length = plain;
      if (uncompress(reinterpret_cast<Bytef*>(block.data()), &length,
                     reinterpret_cast<const Bytef*>(in.data() + at), packed) != Z_OK ||
          length != plain)
        fail("an array cannot be unpacked");
      out += block;
      at += packed;
    }
    return out;
  }

  std::string bytes_of(const pugi::xml_node& array) const {
    const std::string_view format = array.attribute("format").as_string("ascii");
    if (format == "binary") return unpacked(from_base64(array.text().get(), where_));
    const std::uint64_t offset = array.attribute("offset").as_ullong();
    if (offset > appended_.size()) fail("an array is cut off");
    std::string_view rest = appended_.substr(offset);
    if (raw_) return unpacked(rest);
    // base64: where the array ends is not stated, so more than it is decoded, and the rest is ignored.
    return unpacked(from_base64(rest, where_));
  }

  template <class T>
  static std::vector<double> as(const std::string& bytes) {
    std::vector<double> out(bytes.size() / sizeof(T));
    for (std::size_t k = 0; k < out.size(); k++) {
      T v;
      std::memcpy(&v, bytes.data() + k * sizeof v, sizeof v);
      out[k] = static_cast<double>(v);
    }
    return out;
  }

  std::vector<double> values(const pugi::xml_node& array) const {
    if (!array) fail("an array is missing");
    const std::string_view type = array.attribute("type").as_string();
    if (std::string_view(array.attribute("format").as_string("ascii")) == "ascii") {
      auto out = numbers_in(array.text().get());
      if (!out) fail("an array holds something that is not a number");
      return std::move(*out);
    }
    const std::string bytes = bytes_of(array);
    if (type == "Float64") return as<double>(bytes);
    if (type == "Float32") return as<float>(bytes);
    if (type == "UInt32") return as<std::uint32_t>(bytes);
    if (type == "Int32") return as<std::int32_t>(bytes);
    if (type == "Int64") return as<std::int64_t>(bytes);
    if (type == "UInt64") return as<std::uint64_t>(bytes);
    if (type == "UInt8") return as<std::uint8_t>(bytes);
    fail("an array is of the type '" + excerpt(type) + "': save it as Float64, Float32, UInt32 or Int64");
  }

  const std::string& where_;
  pugi::xml_document document_;
  std::string_view appended_;
  bool raw_ = false, compressed_ = false;
  int header_ = 4;
};

}  // namespace

Content read_vtp(std::string_view bytes, const std::string& where) { return Reader(bytes, where).content(); }

}  // namespace padder::importing
