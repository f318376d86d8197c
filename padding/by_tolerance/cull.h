// SPDX-License-Identifier: MIT
// The fewest spheres for what a user asks of them: a tolerance, a count, limits of the radius, true volume,
// small mean errors, smoothness.
#pragma once
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "padding/by_tolerance/cover.h"

namespace padder {

// Spheres that are dilated by the whole tolerance are the fewest, but too large on the whole. A smaller
// dilation needs more spheres. This says what to aim for.
enum class Balance {
  none,    // the fewest spheres
  volume,  // a volume of the union within 1 % of the body's
  mean,    // the smallest sum of mean protrusion and mean gap, with at most max_spheres; without max_spheres,
           // with at most half as many again as the fewest
};
// By the names that users give them.
inline constexpr std::pair<const char*, Balance> kBalances[] = {
    {"none", Balance::none}, {"volume", Balance::volume}, {"mean", Balance::mean}};

// Lengths are in the surface's unit. The search is made for surfaces of about unit size near the origin.
struct CullOptions {
  double tolerance = 0;  // of protrusion and gap; 0: not given, max_spheres decides
  // Each error by itself. Where both are given, they replace the tolerance, and nothing else may be asked for
  // but radius limits and effort. A gap of 0 also covers the inside of the body, with balls that fill its
  // hollows; a protrusion of 0 leaves all balls inside the body. At least one of them is above 0. A gap below
  // 0 is one of 0 wherever each ball is moved by so much.
  std::optional<double> only_protrusion, only_gap;
  // 0: no limit; else the smallest error that so many can keep, but at least `tolerance`
  std::uint64_t max_spheres = 0;
  double min_radius = 0;
  double max_radius = std::numeric_limits<double>::infinity();
  Balance balance = Balance::none;
  double smooth = 0;  // the mean normal error asked for, degrees; 0: not asked
  int effort = 1;     // as in CoverOptions
  // May be empty; as in CoverOptions. The share of a search over several covers is an estimate.
  TellShare tell;

  // Takes off each error how far writing the balls down may move them, where there is room for that. A
  // protrusion of 0 falls below 0: then each ball stays so far inside the body. So does a gap of 0, even
  // where there is no room.
  void keep_back(double moved);
};

// What cull() left.
struct Culled {
  std::vector<Ball> balls;
  std::vector<std::uint32_t> triangle;  // for each ball, the triangle of the surface that it was grown from
  double protrusion = 0, gap = 0;  // the bounds that hold; at most the tolerance, if max_spheres allowed it
  OpenSpot open;                   // where the gap is not kept, and why
  bool proved = false;             // both bounds hold; never on an open surface, nor where it faces inward
  bool within = true;              // false when max_spheres was too few for the tolerance
  // Proved: no point of the body lies outside the balls, as far as they may move. Only for a gap of 0 or
  // below.
  bool filled = false;
};

// Balance::none takes one cover. The others search over the tolerance sum (protrusion plus gap), which takes
// 3 to 8 covers, and for a count up to 37, most of them of few balls. While the sum is fixed, the centres and
// the number of balls are fixed, too; the dilation can still move between the two bounds without breaking the
// proof, because balls smaller by s stand out by s less and leave a gap larger by s. Throws Error when
// neither a tolerance nor a count is given, and what cover_surface throws.
Culled cull(const Surface& surface, const CullOptions& options);

}  // namespace padder
