// SPDX-License-Identifier: GPL-3.0-or-later
// Triangle soup to the surface of a body: closed, oriented outward, without self-intersections.
#pragma once
#include <string>

#include "padding/geometry/surface.h"

namespace padder {

// How far repair may go.
enum class RepairMode {
  automatic,  // clean and close; an open terrain stays a sheet; what is still no solid is wrapped
  never,  // trust the file: equal points merged, nothing else; a closed mesh is a body, an open one a sheet;
          // inside is where its winding number is above 0
  wrap,   // wrap whatever comes
};

// What the repaired surface is.
enum class BodyKind {
  solid,  // closed, the input's own surface
  wrap,   // closed, an alpha wrap around the input
  sheet,  // open: below its normals is inside
};

// Lengths in the mesh's unit; 0 chooses.
struct RepairOptions {
  RepairMode mode = RepairMode::automatic;
  double accuracy = 0;     // distance error asked for; 0: diagonal/500
  double alpha = 0;        // ball that a wrap keeps out; 0: 2.75 accuracy, from diagonal/400 to diagonal/150
  double offset = 0;       // of a wrap from the input; 0: a third of the accuracy, at most diagonal/1500
  double hole_size = 0.1;  // holes whose rim is no longer than this share of the diagonal are closed
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

// Soup tools of CGAL's polygon mesh processing (merge, orient, stitch, fill), else its 3D alpha wrap
// (Portaneri, Rouxel-Labbé, Hemmer, Cohen-Steiner, Alliez: Alpha wrapping with an offset, 2022). The wrap
// encloses the input, so its surface lies outside by at least nothing and, away from slots and creases
// narrower than 2 alpha, by at most the offset. Deterministic. Throws Error, with `name` in the sentence,
// when no triangle has an area, or in mode `never` when the mesh is not manifold and oriented. Cost: about n
// log n for solids; a wrap grows with (diagonal / alpha)^2: 5 s at 150.
Repaired repair(const Mesh& soup, const RepairOptions& options, const std::string& name);

}  // namespace padder
