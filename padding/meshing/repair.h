// SPDX-License-Identifier: GPL-3.0-or-later
// Repairs a triangle soup: it becomes the surface of a body, closed, oriented outward, without
// self-intersections.
#pragma once
#include <limits>
#include <string>
#include <utility>

#include "padding/geometry/repaired.h"

namespace padder {

// How far repair may go.
enum class RepairMode {
  automatic,  // keep the surface: unite what crosses, close holes of solids, keep sheets as sheets
  united,     // the same, but a shell inside another one is a part of the body and no cavity
  fill,       // close every hole that encloses a volume
  sheet,      // close no hole: what is open is a sheet
  // Trust the file: merge equal points and do nothing else. A closed mesh is a body whose inside is where the
  // winding number is above 0; an open mesh is a sheet.
  never,
  wrap,  // wrap every input: an alpha wrap around the triangles replaces them
};
// By the names that users give them.
inline constexpr std::pair<const char*, RepairMode> kRepairModes[] = {
    {"auto", RepairMode::automatic}, {"union", RepairMode::united}, {"fill", RepairMode::fill},
    {"sheet", RepairMode::sheet},    {"never", RepairMode::never},  {"wrap", RepairMode::wrap}};

// Lengths are in the mesh's unit; 0 means that repair chooses.
struct RepairOptions {
  RepairMode mode = RepairMode::automatic;
  // The protrusion that a wrap must leave room for: it stands off the input by less, unless that needs an
  // alpha below diagonal/600. Comes before `accuracy` and `alpha`. Cracks wider than a quarter of it are not
  // closed. 0: none is promised.
  double tolerance = 0;
  // Corners farther apart are not joined, nor those farther apart than a crack may be wide. 0: none are.
  double join_width = std::numeric_limits<double>::infinity();
  // A closed piece that crosses itself in folds no larger than this (count_folds() in cells/contacts.h), and
  // nowhere else, is kept as it is.
  double fold_size = 0;
  double accuracy = 0;  // error asked for, which a wrap must not spoil; 0: diagonal/500
  // Radius of the ball that a wrap keeps out; 0: 2.75 times the accuracy, from diagonal/400 to diagonal/150.
  double alpha = 0;
  double thickness = 0;  // of sheets, half on either side; 0: their spheres stand out by the protrusion alone
  bool below_terrain = false;  // a sheet that all faces one way is solid below its normals, as far as known
  // Where more pairs of triangles cross, or three triangles at more places, they are not cut apart:
  // `automatic` wraps the mesh, and the other modes throw Error. A million pairs take 40 s on one core, and
  // 3 GB.
  std::size_t most_pairs = 1'000'000;
};

// The radius of the ball that a wrap keeps out, whatever these options say of it.
double wrap_alpha(const RepairOptions& options, double diagonal);

// A closed mesh that meets itself nowhere is kept as it is, turned outward (CGAL's Polygon Mesh Processing).
// Everything else is mended (mend.h): its triangles stay where they are, unless their corners are joined
// (RepairSteps::joined), and the body is where their winding number is above 0. Only a wrap replaces the
// surface, with CGAL's 3D Alpha Wrapping (Portaneri, Rouxel-Labbé, Hemmer, Cohen-Steiner, Alliez: Alpha
// wrapping with an offset, 2022). A wrap encloses the input. Its surface lies outside it by at most the
// offset, except in slots and creases narrower than 2 alpha.
//
// Deterministic. Throws Error, with `name` in the sentence, when no triangle has an area, and in mode `never`
// when the mesh is not manifold and oriented, or when too many triangles cross. Cost: about n log n, and some
// microseconds for each pair of triangles that cross. A wrap grows with (diagonal / alpha)^2: 5 s at 150.
Repaired repair(const Mesh& soup, const RepairOptions& options, const std::string& name);

}  // namespace padder
