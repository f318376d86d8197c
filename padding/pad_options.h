// SPDX-License-Identifier: GPL-3.0-or-later
// What a user asks of padding, and the checks that refuse what cannot be meant.
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "padding/by_tolerance/cull.h"
#include "padding/geometry/length.h"
#include "padding/meshing/repair.h"

namespace padder {

// There are two ways to pad. By depth ratio: one sphere for each triangle, as in the paper. By tolerance,
// count or ladder of tolerances: the fewest spheres that keep it. With both a depth ratio and a tolerance,
// the spheres are those of the depth ratio, thinned to the ones that the tolerance needs.
struct PadOptions {
  // Cap height over circumradius, above 0 and at most 1; 0.2 when nothing else is asked for.
  std::optional<double> depth_ratio;
  Length edge_length;  // of the remeshed triangles; not given: caps are a 400th of the diagonal high
  // Degrees, 1 to 180: remeshing keeps edges that turn by more. Ignored on a wrap, whose edges are ripples.
  double sharp_angle = 40;

  Length tolerance;  // of protrusion and gap
  // Each error by itself, instead of the tolerance or beside it, where each replaces one side of it.
  // Length::of(0) is a gap of 0, with which no point of the body lies outside the spheres, or a protrusion of
  // 0, with which no point of a sphere lies outside the body. Not both may be 0.
  std::optional<Length> protrusion, gap;
  std::uint64_t max_spheres = 0;  // 0: no limit; else the smallest error for so many; at most 2^32 - 1
  Length min_radius, max_radius;
  Balance balance = Balance::none;  // what to aim for within the tolerance
  double smooth = 0;                // mean normal error asked for, degrees, below 180; 0: not asked
  int effort = 1;                   // 0 to 3: a longer search finds fewer spheres
  bool lower_bound = false;         // also prove how few spheres could do (PadReport::fewest)
  std::vector<Length> lod;  // tolerances of a ladder: the finest makes the cluster, the others its lods

  // Of the smallest grain that will touch the part: surface that it cannot reach is not padded.
  Length min_grain_radius;
  RepairMode repair = RepairMode::automatic;
  Length thickness;          // of sheets: surface that bounds nothing; not given: none
  bool force = false;        // accept values that check_meant would refuse
  std::uint32_t family = 0;  // of the asset; 0: none
  std::uint32_t mask = 0;    // bit k: no contact with family k + 1
  // A program that wants mass and moments: a mesh without volume is refused for it before it is covered.
  std::string volume_for = {};

  bool each_error() const { return protrusion || gap; }
  Length protrusion_used() const { return protrusion.value_or(tolerance); }
  Length gap_used() const { return gap.value_or(tolerance); }
  bool by_tolerance() const { return tolerance.given() || each_error() || max_spheres > 0 || !lod.empty(); }
  bool by_depth() const { return depth_ratio || !by_tolerance(); }
  double depth_ratio_used() const { return depth_ratio.value_or(0.2); }
};

// Throws Error for values that make no sense for any mesh: numbers that are negative, not finite or outside
// the ranges above, limits that exclude each other, limits that the chosen way of padding would ignore.
void check(const PadOptions& options);

// Throws Error, with `name` in the sentence, for lengths that are hardly meant for a part with this box,
// unless options.force is set:
//   a tolerance above half the thinnest extent and above a tenth of the diagonal,
//   an edge length, a smallest grain or a smallest radius above half the diagonal,
//   a smallest grain below a 2000th of the diagonal: its wrap would take hours.
void check_meant(const PadOptions& options, const Box& box, const std::string& name);

// A JSON object with all that is needed to make the cluster again. Lengths are in the mesh's unit, as they
// were used, and so is `edge_length`.
std::string settings_json(const PadOptions& options, double diagonal, double edge_length);

}  // namespace padder
