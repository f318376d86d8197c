#include "padding/vtp.h"

#include <numeric>

namespace padder {

void VtpWriter::append_bytes(std::string& xml, const char* name, const char* type, int components,
                             const void* data, std::uint64_t size) {
  xml += "<DataArray type=\"" + std::string(type) + "\" Name=\"" + name + "\" NumberOfComponents=\"" +
         std::to_string(components) + "\" format=\"appended\" offset=\"" + std::to_string(data_.size()) +
         "\"/>\n";
  data_.append(reinterpret_cast<const char*>(&size), sizeof size);
  data_.append(static_cast<const char*>(data), size);
}

std::string VtpWriter::bytes() const {
  VtpWriter whole = *this;  // points and vertices follow the data of the points
  const std::size_t n = points_.size();
  std::vector<double> positions;
  positions.reserve(3 * n);
  for (const Point& p : points_) positions.insert(positions.end(), {p.x(), p.y(), p.z()});
  std::vector<std::int64_t> connectivity(n), offsets(n);
  std::iota(connectivity.begin(), connectivity.end(), 0), std::iota(offsets.begin(), offsets.end(), 1);
  std::string points, verts;
  whole.append(points, "points", 3, positions);
  whole.append(verts, "connectivity", 1, connectivity);
  whole.append(verts, "offsets", 1, offsets);
  const std::string count = std::to_string(n);
  return "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" "
         "header_type=\"UInt64\">\n<PolyData>\n<Piece NumberOfPoints=\"" +
         count + "\" NumberOfVerts=\"" + count + "\">\n<PointData>\n" + point_data_ +
         "</PointData>\n<Points>\n" + points + "</Points>\n<Verts>\n" + verts +
         "</Verts>\n</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_" + whole.data_ +
         "\n</AppendedData>\n</VTKFile>\n";
}

}  // namespace padder
