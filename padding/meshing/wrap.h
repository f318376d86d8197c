// SPDX-License-Identifier: GPL-3.0-or-later
// The alpha wrap: a closed surface around triangles that bound no body.
#pragma once
#include <string>
#include <vector>

#include "padding/meshing/cgal_mesh.h"
#include "padding/meshing/repair.h"

namespace padder {

// Triangles without connectivity: each names its points by index.
struct Soup {
  std::vector<CgalPoint> points;
  std::vector<std::vector<std::size_t>> triangles;
};

// Wraps `soup` with CGAL's 3D Alpha Wrapping. `why` is the reason, for the report.
Repaired wrap(const Soup& soup, const RepairOptions& options, double diagonal, const std::string& why);

}  // namespace padder
