// SPDX-License-Identifier: MIT
// The surface that every step after repair works on. It has a header without CGAL of its own, because
// measuring and proving need the description and not the repair.
#pragma once
#include <string>

#include "padding/geometry/surface.h"

namespace padder {

// What the repaired surface is.
enum class BodyKind {
  solid,  // closed, the input's own surface
  wrap,   // closed, an alpha wrap around the input
  sheet,  // open: below its normals is inside
};

// The surface that is padded, and what became of the input.
struct Repaired {
  Mesh mesh;
  BodyKind kind = BodyKind::solid;
  std::string report;  // what was done, for a person: "closed 2 holes; wrapped (open: 327 border edges)"
  double alpha = 0, offset = 0;  // of the wrap, else 0
  Mesh flat;                     // the input's triangles without area, which are not in `mesh`
  std::size_t filled = 0;        // holes that were closed, of a solid
  double filled_area = 0;        // of their patches, which are no part of the input
  // Known to be closed, oriented outward and free of self-intersections, by exact predicates: then a
  // pseudonormal tells the side of a point.
  bool checked = false;

  SideBy side() const { return checked || kind == BodyKind::sheet ? SideBy::pseudonormal : SideBy::winding; }
};

}  // namespace padder
