// VTK's XML for points with data (.vtp), arrays appended as they lie in memory. Host only; no further
// library.
#pragma once
#include <cstdint>
#include <string>
#include <type_traits>
#include <vector>

#include "padding/mesh.h"

namespace padder {

// Points, each with a vertex so that ParaView shows it, and arrays of one entry (or `components`) a point.
class VtpWriter {
 public:
  explicit VtpWriter(std::vector<Point> points) : points_(std::move(points)) {}

  // T: double, std::uint32_t or std::int64_t; values holds components a point.
  template <class T>
  void add(const char* name, const std::vector<T>& values, int components = 1) {
    append(point_data_, name, components, values);
  }
  std::string bytes() const;

 private:
  template <class T>
  void append(std::string& xml, const char* name, int components, const std::vector<T>& values) {
    static_assert(std::is_same_v<T, double> || std::is_same_v<T, std::uint32_t> ||
                  std::is_same_v<T, std::int64_t>);
    const char* type = std::is_same_v<T, double>         ? "Float64"
                       : std::is_same_v<T, std::int64_t> ? "Int64"
                                                         : "UInt32";
    append_bytes(xml, name, type, components, values.data(), values.size() * sizeof(T));
  }
  void append_bytes(std::string& xml, const char* name, const char* type, int components, const void* data,
                    std::uint64_t size);

  std::vector<Point> points_;
  std::string point_data_, data_;
};

}  // namespace padder
