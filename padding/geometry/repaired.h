// SPDX-License-Identifier: MIT
// The surface that every step after repair works on. Repair itself is in padding/meshing: measuring and
// proving need its result, but not its code.
#pragma once
#include <string>

#include "padding/geometry/surface.h"

namespace padder {

// What the repaired surface is.
enum class BodyKind {
  solid,  // closed: the input's own surface
  wrap,   // closed: an alpha wrap around the input
  sheet,  // open: inside is below its normals
};

// The surface that is padded, and what became of the input.
struct Repaired {
  Mesh mesh;
  BodyKind kind = BodyKind::solid;
  std::string report;  // what was done, in words: "closed 2 holes; wrapped (open: 327 border edges)"
  double alpha = 0, offset = 0;  // of the wrap, otherwise 0
  Mesh flat;                     // the input's triangles without area, which are not in `mesh`
  std::size_t filled = 0;        // number of holes that were closed, of a solid
  double filled_area = 0;        // of the patches that close them; they are no part of the input
  // Exact predicates have shown that the surface is closed, oriented outward and free of self-intersections.
  // Then the pseudonormal tells the side of a point, which costs less than the winding number.
  bool checked = false;

  SideBy side() const { return checked || kind == BodyKind::sheet ? SideBy::pseudonormal : SideBy::winding; }
};

}  // namespace padder
