// SPDX-License-Identifier: MIT
#include "padding/asset/vtp.h"

#include <algorithm>

#include "padding/asset/error.h"

namespace padder {
namespace {

constexpr std::string_view kTail = "\n</AppendedData>\n</VTKFile>\n";

std::string_view bytes_of(const std::uint64_t& value) {
  return {reinterpret_cast<const char*>(&value), sizeof value};
}

}  // namespace

// Gives the array its place, and its line of XML.
std::string VtpWriter::announce(const VtpHead& h) {
  const std::uint64_t size = points_ * static_cast<std::uint64_t>(h.components * h.size);
  const std::string line = "<DataArray type=\"" +
                           std::string(h.kind == 'f'   ? "Float"
                                       : h.kind == 'u' ? "UInt"
                                                       : "Int") +
                           std::to_string(8 * h.size) + "\" Name=\"" + h.name + "\" NumberOfComponents=\"" +
                           std::to_string(h.components) + "\" format=\"appended\" offset=\"" +
                           std::to_string(end_) + "\"/>\n";
  arrays_.push_back({h.name, end_ + sizeof size, size});
  end_ += sizeof size + size;
  return line;
}

VtpWriter::VtpWriter(std::uint64_t points, std::vector<VtpHead> heads, WriteAt write,
                     const std::string& fields)
    : write_(std::move(write)), points_(points) {
  std::string data;
  for (const VtpHead& h : heads) data += announce(h);
  const std::string positions = announce({"points", 'f', 8, 3});
  std::string vertices = announce({"connectivity", 'i', 8, 1});
  vertices += announce({"offsets", 'i', 8, 1});
  const std::string count = std::to_string(points);
  head_ =
      "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" "
      "header_type=\"UInt64\">\n<PolyData>\n" +
      (fields.empty() ? "" : "<FieldData>\n" + fields + "</FieldData>\n") + "<Piece NumberOfPoints=\"" +
      count + "\" NumberOfVerts=\"" + count + "\">\n<PointData>\n" + data + "</PointData>\n<Points>\n" +
      positions + "</Points>\n<Verts>\n" + vertices +
      "</Verts>\n</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_";
}

std::uint64_t VtpWriter::place(std::size_t array, std::uint64_t size) {
  Array& a = arrays_[array];
  if (size > a.size - a.got) throw Error("more bytes than the array " + a.name + " was said to have");
  const std::uint64_t offset = head_.size() + a.at + a.got;
  a.got += size;
  return offset;
}

void VtpWriter::append(std::size_t array, std::string_view bytes) {
  write_(place(array, bytes.size()), bytes);
}

// As many whole numbers as there are points, from `first` on.
void VtpWriter::append_numbers(std::size_t array, std::int64_t first) {
  std::vector<std::int64_t> block;
  for (std::uint64_t done = 0; done < points_; done += block.size()) {
    block.resize(std::min<std::uint64_t>(points_ - done, 1 << 16));
    for (std::int64_t& v : block) v = first++;
    append(array, block);
  }
}

void VtpWriter::finish() {
  if (arrays_[connectivity()].got == 0) append_numbers(connectivity(), 0);
  if (arrays_[offsets()].got == 0) append_numbers(offsets(), 1);
  write_(0, head_);
  for (const Array& a : arrays_) {
    if (a.got != a.size) throw Error("fewer bytes than the array " + a.name + " was said to have");
    write_(head_.size() + a.at - sizeof a.size, bytes_of(a.size));
  }
  write_(head_.size() + end_, kTail);
}

}  // namespace padder
