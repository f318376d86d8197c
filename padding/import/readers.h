// SPDX-License-Identifier: MIT
// Private to padding/import: one function for each format that holds spheres.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "padding/asset/cluster.h"
#include "padding/asset/error.h"
#include "padding/export/model.h"

namespace padder::importing {

// The spheres of one link, clump or body.
struct Part {
  std::string name;
  std::vector<Point> centers;
  std::vector<double> radii;
  std::vector<std::uint32_t> family, mask;  // empty, or one a sphere
};
using Parts = std::vector<Part>;

// Two parts that may not touch, by their names, and why if the file says it.
struct ApartNames {
  std::string a, b, reason;
};

// What a file says.
struct Content {
  Parts parts;
  std::string unit = {};  // "" where the file does not say it
  // The parts are links, each in its own frame, and the file does not say where they are.
  bool links = false;
  std::vector<ApartNames> apart = {};
  std::uint64_t switched_off = 0;  // spheres without a radius, which were left out
};

// The word for what an array `unit_in_metres` holds. Throws Error if it is not one number that has a word.
std::string unit_of(const std::vector<double>& array, const std::string& where);

// The parts of spheres of which each says its body; one part if none does.
Parts parts_by_body(Part all, const std::vector<std::uint32_t>& body);

// Every message of an Error begins with `where`.
Content read_csv(std::string_view text, const std::string& where);   // DEM-Engine
Content read_list(std::string_view text, const std::string& where);  // LIGGGHTS, YADE
// The file that it reads, Clump/Clump.txt in the folder; "" where there is none.
std::filesystem::path mercury_spheres(const std::filesystem::path& folder);
Content read_mercury(const std::filesystem::path& folder);
Content read_npz(std::string_view bytes, const std::string& where);
Content read_vtp(std::string_view bytes, const std::string& where);
Content read_yaml(const std::string& text, const std::string& where);  // cuRobo, XRDF
Content read_xml(const std::string& text, const std::string& where);   // URDF, SRDF, MJCF

}  // namespace padder::importing
