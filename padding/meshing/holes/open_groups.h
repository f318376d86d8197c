// SPDX-License-Identifier: GPL-3.0-or-later
// Closes the open pieces of a mesh, and tells which of them are solids but for their holes.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

#include "padding/geometry/repaired.h"
#include "padding/meshing/holes/holes.h"
#include "padding/meshing/repair.h"

namespace padder {

// Pieces that hang together by points, one of them open.
struct OpenGroup {
  std::vector<std::uint32_t> triangles;  // of the input, then those that close it
  std::size_t own = 0;                   // of the input
  std::vector<DirectedEdge> missing;     // once the cracks are closed
  std::vector<std::vector<std::uint32_t>> rims;
  std::vector<Triangles> patches;  // of each rim
  std::vector<char> is_long;       // of each rim: it is not closed without asking
  Triangles cracks;
  double crack_width = 0;
  // The widest hole that is not closed anyway: the circumference of a circle of its area. The length of its
  // rim would say little, because a seam that is open is long.
  double opening = 0, diagonal = 0;
  double winding = 0;                  // mean, without the patches of such rims
  bool solid = false, inward = false;  // inward: with its patches it faced so in the file
};

struct OpenGroups {
  std::vector<OpenGroup> groups;
  // In mode `automatic`: together they enclose more than each with its own patches, as strips of a scan do,
  // and a wrap encloses it, too.
  bool parts_of_one = false;
};

// Closes the cracks and holes of the open triangles. Those that close them are added to the mesh, and each
// group faces outward then. `units` are closed pieces, which face outward: a hole that they cover needs no
// evidence. In mode `sheet` nothing is closed.
OpenGroups close_open_pieces(Mesh& mesh, const std::vector<std::uint32_t>& open,
                             const std::vector<std::vector<std::uint32_t>>& units,
                             const RepairOptions& options, double diagonal, RepairSteps& steps);

}  // namespace padder
