// SPDX-License-Identifier: GPL-3.0-or-later
// What padding is asked for, and which of it cannot be meant.
#pragma once
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "padding/by_tolerance/cull.h"
#include "padding/meshing/repair.h"

namespace padder {

// In the mesh's unit, or as a share of its bounding box's diagonal.
struct Length {
  double value = 0;    // 0: not given
  bool share = false;  // value is a share: 0.01 is 1 %

  bool given() const { return value != 0; }
  double of(double diagonal) const { return share ? value * diagonal : value; }
};

// "0.01" is in the mesh's unit, "1%" or "1 %" a share of its diagonal. None for anything else: the number
// must be decimal, finite and above 0, and nothing may stand before or behind it.
std::optional<Length> length_of(std::string_view text);

// Two ways to say what is wanted. A depth ratio: one sphere a triangle, as in the paper. A tolerance, a count
// or a ladder: the fewest spheres that keep it. Both a depth and a tolerance: the spheres of the depth,
// thinned to those that the tolerance needs.
struct PadOptions {
  std::optional<double>
      depth;           // cap height over circumradius, 0 < depth <= 1; 0.2 when nothing else is asked for
  Length edge_length;  // of the remeshed triangles; not given: caps a 400th of the diagonal high
  double sharp_angle =
      40;  // degrees, 1 to 180; remeshing keeps edges that turn by more (a wrap's are noise: none)

  Length tolerance;               // of protrusion and gap alike
  std::uint64_t max_spheres = 0;  // 0: no limit; else the best error for a count, at most 2^32 - 1
  Length min_radius, max_radius;
  Balance balance = Balance::none;  // what the freedom within the tolerance is spent on
  double smooth = 0;                // degrees of mean normal error asked for, below 180; 0: not asked
  int effort = 1;                   // 0 to 3: longer search, fewer spheres
  std::vector<Length> lod;          // tolerances of a ladder: the finest is the cluster, the others its lods

  Length reach;  // radius of the smallest grain: what it cannot touch is not padded
  RepairMode repair = RepairMode::automatic;
  bool force = false;        // take values that check_meant refuses
  std::uint32_t family = 0;  // of the asset; 0: none
  std::uint32_t mask = 0;    // bit k: no contact with family k + 1

  bool by_tolerance() const { return tolerance.given() || max_spheres > 0 || !lod.empty(); }
  double depth_used() const { return depth.value_or(0.2); }
};

// Throws Error for values that make no sense whatever the mesh: numbers that are negative or not finite, out
// of the ranges above, limits that exclude each other, limits that the way chosen would ignore.
void check(const PadOptions& options);

// Throws Error, with `name` in the sentence, for lengths that cannot be meant for a part with this box,
// unless options.force is set: a tolerance beyond half the thinnest extent (a thin part may have up to a
// tenth of the diagonal), an edge, a reach or a smallest radius beyond half the diagonal, a reach below a
// 2000th of it, whose wrap would take hours.
void check_meant(const PadOptions& options, const Box& box, const std::string& name);

// A JSON object: all that is needed to make the cluster again. Lengths in the mesh's unit, as they were used;
// `edge_length` likewise.
std::string settings_json(const PadOptions& options, double diagonal, double edge_length);

}  // namespace padder
