// SPDX-License-Identifier: MIT
// The surface that every step after repair works on. Repair itself is in padding/meshing: measuring and
// proving need its result, but not its code.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "padding/geometry/surface.h"

namespace padder {

// What the repaired surface is.
enum class BodyKind {
  solid,  // closed: the input's own surface
  wrap,   // closed: an alpha wrap around the input
  sheet,  // open: inside is below its normals
};

// A hole that repair closed: what of the surface is no part of the input.
struct Patch {
  double area = 0, rim = 0;              // of the patch; length of the border that it closes
  Point place = Point::Zero();           // its middle
  std::vector<std::uint32_t> triangles;  // of the repaired surface
};

// Surface that repair left out or put in, to be shown in a colour of its own.
enum class MarkKind : std::uint8_t {
  patch,   // over a hole; no part of the input
  buried,  // of the input, but nothing outside can touch it
  slot,    // of a wrap, where it bridges the input farther than the tolerance allows
  dropped  // of the input, but no part of the body
};
struct Mark {
  MarkKind kind = MarkKind::patch;
  Mesh mesh;
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
  std::vector<Patch> patches;    // one for each hole that was closed
  std::vector<Mark> marks;       // what is buried and what was dropped
  // Of a wrap, for each triangle: no point of it is farther from the input than this.
  std::vector<double> standoff;
  // Exact predicates have shown that the surface is closed, oriented outward and free of self-intersections.
  // Then the pseudonormal tells the side of a point, which costs less than the winding number.
  bool checked = false;

  SideBy side() const { return checked || kind == BodyKind::sheet ? SideBy::pseudonormal : SideBy::winding; }
};

}  // namespace padder
