// SPDX-License-Identifier: GPL-3.0-or-later
// Makes a body of triangles that cross, overlap, nest, repeat or leave holes, and keeps them as they are.
#pragma once
#include <optional>
#include <string>

#include "padding/geometry/repaired.h"
#include "padding/meshing/repair.h"

namespace padder {

// A soup bounds a body as soon as it closes: the directions of its triangles cancel along each edge. So no
// piece is moved, and no manifold is made:
//
// 1. Pieces that hang together are turned alike (pieces.h). Cracks and holes get triangles that close them
//    (holes.h), if the hole is small or the piece is a solid but for the hole; other open pieces are sheets.
// 2. A closed piece faces outward, unless it is a cavity: it meets nothing and lies within another one, or it
//    faces inward in the file and was cut out of the others: no more than half of it sticks out.
// 3. The body is where the winding number of all closed pieces is above 0. Of the triangles, cut where they
//    cross, those with the body on one side bound it; those with none on both sides are sheets
//    (outer_cells.h).
//
// Where more than options.most_pairs of triangles meet, or three of them at so many places, there is no
// result; nor is there in mode `automatic` where open pieces enclose more together than each with its own
// patches, as strips of a scan do. `why_not` gets the reason.
//
// `input` holds triangles with and without area. Deterministic for any number of threads.
std::optional<Repaired> mend(const Mesh& input, const RepairOptions& options, std::string* why_not = nullptr);

// The same for one closed piece that faces outward (one_closed_piece() of pieces.h).
std::optional<Repaired> mend_piece(std::shared_ptr<const Surface> piece, const RepairOptions& options,
                                   std::string* why_not);

}  // namespace padder
