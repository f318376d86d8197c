// SPDX-License-Identifier: MIT
// The fewest spheres for what a scene asks: a tolerance, a count, limits of size, true volume, small means,
// smoothness.
#pragma once
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "padding/by_tolerance/cover.h"

namespace padder {

// What the freedom within the tolerances is spent on. Spheres dilated by the whole tolerance are the fewest,
// but too large on the whole; a smaller dilation costs more spheres.
enum class Balance {
  none,    // the fewest
  volume,  // the union's volume within 1 % of the body's
  mean,  // the smallest sum of mean protrusion and mean gap, with at most max_spheres (or half as many again
         // as the fewest)
};
std::optional<Balance> balance_of(std::string_view name);  // "none", "volume", "mean"

// Lengths in the surface's unit; made for surfaces of about unit size near the origin.
struct CullOptions {
  double tolerance = 0;  // of protrusion and gap; 0: none given, the count decides
  std::uint64_t max_spheres =
      0;  // 0: no limit; else the smallest error that so many can keep, never below `tolerance`
  double min_radius = 0;
  double max_radius = std::numeric_limits<double>::infinity();
  Balance balance = Balance::none;
  double smooth = 0;  // degrees, of the mean normal error asked for; 0: not asked
  int effort = 1;     // as in CoverOptions
};

// What cull() left.
struct Culled {
  std::vector<Ball> balls;
  std::vector<std::uint32_t> triangle;  // of the surface, that each ball was grown from
  double protrusion = 0,
         gap = 0;           // the bounds that hold; both at most the tolerance, if the count allowed it
  bool covered = false;     // the gap holds everywhere: false only where radius limits forbid a cover
  bool proved = false;      // both bounds hold: never on an open surface, nor where it faces inward
  bool within = true;       // false when max_spheres was too few for the tolerance
  double normal_error = 0;  // degrees, estimated; only when `smooth` was asked for
  double volume_ratio = 0;  // estimated, over the body's; only for Balance::volume
};

// One cover for none; a search over the sum of both errors otherwise, which costs 3 to 8 covers. With the sum
// fixed, centres and count are too, and the dilation can still move between the two bounds without breaking
// the proof: balls smaller by s stand out by s less and leave a gap larger by s. Throws Error when neither a
// tolerance nor a count is given, and what cover_surface throws.
Culled cull(const Surface& surface, const CullOptions& options);

// How many entries such spheres make in a grid of bins of this edge when each is entered in all bins that its
// box touches, at random positions: the sum of (1 + 2 r / bin)^3.
double grid_entries(const std::vector<Ball>& balls, double bin);

}  // namespace padder
