// SPDX-License-Identifier: MIT
// From a surface and a tolerance to the fewest balls that cover it, with the proof that they keep the
// tolerance. docs/tolerance.md explains the method and proves it.
#pragma once
#include "padding/by_tolerance/open_spot.h"
#include "padding/by_tolerance/watch.h"
#include "padding/verify/certify.h"

namespace padder {

// The share of a tolerance, or of a radius limit, that is kept back. Scaling to another unit costs the last
// digits, which must not break the proof, or the limit.
constexpr double kKeptBack = 1e-9;

// Lengths are in the surface's unit. The search is made for surfaces of about unit size near the origin.
struct CoverOptions {
  double protrusion = 0;  // no ball may stand out of the body by more
  // No surface point may lie farther outside the union. Below 0, each lies so deep inside a ball. The sum of
  // both must be above 0.
  double gap = 0;
  // Surface that only smaller balls could cover stays open, and the result is not proved.
  double min_radius = 0;
  double max_radius = std::numeric_limits<double>::infinity();
  // 0: greedy only. 1: local search. 2 and 3 go on from what the effort before has found, so they never give
  // more balls; each takes about three times as long.
  int effort = 1;
  // Whoever looks for a tolerance that so many balls can keep does not need a cover of many more: where its
  // last stage begins with more than eight times as many, it is returned unfinished.
  std::uint64_t most_balls = std::numeric_limits<std::uint64_t>::max();
  TellShare tell;  // may be empty; called some ten times, from any thread, never from two at once
};

// What cover_surface() found.
struct Cover {
  std::vector<Ball> balls;              // each dilated by the whole protrusion that is allowed
  std::vector<std::uint32_t> triangle;  // for each ball, the triangle of the surface that it was grown from
  OpenSpot open;                        // where the gap is not kept, and why
  bool proved = false;  // both errors are kept; never on an open surface, nor where it faces inward
};

// Each ball is grown from an inner medial ball of radius m to the radius m + protrusion. It covers the
// surface within m + protrusion + gap of its centre, so both tolerances widen the disc that it covers.
// Choosing the fewest balls is a set cover problem over sample points, which a greedy choice and a local
// search solve. New balls are tried around the chosen ones. Each is then moved to the middle of what it alone
// covers, so that it covers the surface between the points, too. At last the certificate
// (padding/verify/certify.h) finds the spots that the sample points missed. These spots become sample points,
// until none is left.
//
// Throws Error for a surface without triangles and for a tolerance far too small for the mesh. Runs on all
// threads; the result does not depend on their number.
Cover cover_surface(const Surface& surface, const CoverOptions& options);

}  // namespace padder
