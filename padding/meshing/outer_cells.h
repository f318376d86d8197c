// SPDX-License-Identifier: GPL-3.0-or-later
// Cuts triangles where they cross, and keeps of the pieces those that bound the body.
#pragma once
#include <cstdint>
#include <vector>

#include "padding/meshing/contacts.h"

namespace padder {

// What a triangle stands for.
enum class TriangleRole : std::uint8_t {
  bounds,  // a part of the closed surface that has the body inside
  patch,   // so too, but it closes a hole, and is not in the input
  sheet    // bounds nothing by itself
};

// The pieces that are kept. The body is where the winding number of all `bounds` and `patch` triangles is
// above 0.
struct OuterCells {
  // First the boundary of the body, facing outward, then what lies outside with nothing inside (sheets, and
  // the few pieces of which rounding leaves open where they lie). Pieces that meet share their points.
  Mesh mesh;
  std::size_t boundary = 0;           // the number of triangles of the first kind
  std::vector<std::uint32_t> source;  // for each, the triangle of the soup that it is a part of
  double buried_area = 0;             // of the pieces with the body on both sides, which are left out
};

// `soup` is indexed: equal points have one index; `contacts` are those of its triangles, whichever way they
// face. The `bounds` and `patch` triangles close: along each edge their directions cancel. A piece that no
// other triangle crosses has one winding number on either side, so one ray decides on it; an undecided piece
// is kept, which is the safe side for a cover. Triangles too thin to have a normal are left out. Runs on all
// threads; the result does not depend on their number.
OuterCells outer_cells(const Mesh& soup, const std::vector<TriangleRole>& roles, const Contacts& contacts);

}  // namespace padder
