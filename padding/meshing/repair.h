// SPDX-License-Identifier: GPL-3.0-or-later
// Triangle soup to the surface of a body: closed, oriented outward, without self-intersections.
#pragma once
#include <string>

#include "padding/geometry/repaired.h"

namespace padder {

// How far repair may go.
enum class RepairMode {
  automatic,  // clean and close; an open terrain stays a sheet; what is still no solid is wrapped
  never,  // trust the file: equal points merged, nothing else; a closed mesh is a body, an open one a sheet;
          // inside is where its winding number is above 0
  wrap,   // wrap whatever comes
};

// Lengths in the mesh's unit; 0 chooses.
struct RepairOptions {
  RepairMode mode = RepairMode::automatic;
  double accuracy = 0;     // distance error asked for; 0: diagonal/500
  double alpha = 0;        // ball that a wrap keeps out; 0: 2.75 accuracy, from diagonal/400 to diagonal/150
  double offset = 0;       // of a wrap from the input; 0: a third of the accuracy, at most diagonal/1500
  double hole_size = 0.1;  // holes whose rim is no longer than this share of the diagonal are closed
};

// Soup tools of CGAL's polygon mesh processing (merge, orient, stitch, fill), else its 3D alpha wrap
// (Portaneri, Rouxel-Labbé, Hemmer, Cohen-Steiner, Alliez: Alpha wrapping with an offset, 2022). The wrap
// encloses the input, so its surface lies outside by at least nothing and, away from slots and creases
// narrower than 2 alpha, by at most the offset. Deterministic. Throws Error, with `name` in the sentence,
// when no triangle has an area, or in mode `never` when the mesh is not manifold and oriented. Cost: about n
// log n for solids; a wrap grows with (diagonal / alpha)^2: 5 s at 150.
Repaired repair(const Mesh& soup, const RepairOptions& options, const std::string& name);

}  // namespace padder
