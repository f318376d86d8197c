// SPDX-License-Identifier: MIT
// The surface that every step after repair works on. Repair itself is in padding/meshing: measuring and
// proving need its result, but not its code.
#pragma once
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "padding/geometry/surface.h"

namespace padder {

// What the repaired surface is.
enum class BodyKind {
  solid,  // it bounds a body; parts of it may be sheets
  wrap,   // closed: an alpha wrap around the input
  sheet,  // it bounds nothing: the body is all that lies within half the thickness
};

// A hole that repair closed: what of the surface is no part of the input.
struct Patch {
  double area = 0, rim = 0;              // of the patch; length of the border that it closes
  Point place = Point::Zero();           // its middle
  std::vector<std::uint32_t> triangles;  // of the repaired surface
};

// What repair did, as numbers. Lengths and areas are in the mesh's unit.
struct RepairSteps {
  std::size_t pieces = 0;          // triangles that hang together by edges
  std::size_t crossing_pairs = 0;  // of triangles that cross, touch or overlap without sharing an edge
  std::size_t repeated = 0;        // triangles that were there more than once
  std::size_t turned = 0;          // triangles that faced the other way than their neighbours
  std::size_t turned_pieces = 0;   // closed pieces that faced inward and are no cavities
  std::size_t cavities = 0;        // closed pieces inside another one, which bound a hollow
  std::size_t copies = 0;          // closed pieces just inside another one, which they repeat
  double buried_area = 0;          // of the input's surface that has the body on both sides, and is left out
  std::size_t joined = 0;          // corners that were moved to another one
  std::size_t split = 0;           // edges that were split at corners that lie on them
  double joined_width = 0;         // how far the surface was moved by both
  std::size_t cracks = 0;          // triangles that close cracks; they are in no patch
  double crack_width = 0;          // the widest of them
  double sheet_area = 0;           // of the surface that bounds nothing
  std::size_t sheet_pieces = 0;    // open pieces that are no solid with a hole
  // Why: the mean winding number inside of the sheet that comes nearest to a solid (1: closed), and the
  // circumference of a circle with the area of its widest hole, over its diagonal.
  double sheet_winding = 0, sheet_rim = 0;
};

// Surface that repair left out, put in or takes for a sheet, to be shown in a colour of its own.
enum class MarkKind : std::uint8_t {
  patch,   // over a hole; no part of the input
  buried,  // of the input, but nothing outside can touch it
  slot,    // of a wrap, where it bridges the input farther than the tolerance allows
  sheet    // of the input, of a body with an inside: it bounds nothing by itself, and is padded on both sides
};
// Some of that surface.
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
  std::vector<Mark> marks;       // what is buried
  // Of a wrap, for each triangle: no point of it is farther from the input than this.
  std::vector<double> standoff;
  RepairSteps steps;
  // The closed surface whose winding number says what is inside, where it is not `mesh`: then `mesh` has only
  // the parts of it that bound the body, cut where they cross, and behind them `sheet` triangles.
  std::shared_ptr<const Surface> solid;
  std::size_t sheet = 0;
  double thickness = 0;  // of the sheet
  // Exact predicates have shown that the surface is closed, oriented outward and free of self-intersections.
  // Then the pseudonormal tells the side of a point, which costs less than the winding number.
  bool checked = false;
  std::optional<Surface> ready;  // what surface() would build, where repair has built it already

  SideBy side() const { return checked ? SideBy::pseudonormal : SideBy::winding; }
  Surface surface() const {
    Surface out(mesh, side(), solid);
    if (sheet > 0) out.set_sheet(mesh.triangles.size() - sheet, thickness);
    return out;
  }
  // The part of `mesh` that bounds the body.
  Mesh boundary() const {
    Mesh out = mesh;
    out.triangles.resize(mesh.triangles.size() - sheet);
    return out;
  }
};

}  // namespace padder
