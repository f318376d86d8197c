// SPDX-License-Identifier: MIT
// Private to padding/import: one function for each format that holds spheres.
#pragma once
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "padding/asset/cluster.h"
#include "padding/asset/error.h"

namespace padder::importing {

// The spheres of one link, clump or body.
struct Part {
  std::string name;
  std::vector<Point> centers;
  std::vector<double> radii;
  std::vector<std::uint32_t> family, mask;  // empty, or one a sphere
};
using Parts = std::vector<Part>;

// Every message of an Error begins with `where`.
Parts read_csv(std::string_view text, const std::string& where);   // DEM-Engine
Parts read_list(std::string_view text, const std::string& where);  // LIGGGHTS, YADE
Parts read_mercury(const std::filesystem::path& folder);           // Clump/Clump.txt in it
Parts read_npz(std::string_view bytes, const std::string& where);
Parts read_vtp(std::string_view bytes, const std::string& where);
Parts read_yaml(const std::string& text, const std::string& where);  // cuRobo, XRDF
Parts read_xml(const std::string& text, const std::string& where);   // URDF, SRDF, MJCF

}  // namespace padder::importing
