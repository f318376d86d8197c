// SPDX-License-Identifier: MIT
// From a closed surface and a tolerance to the fewest balls, with the proof that they keep it.
// docs/tolerance.md.
#pragma once
#include "padding/verify/certify.h"

namespace padder {

// Lengths in the surface's unit; made for surfaces of about unit size near the origin.
struct CoverOptions {
  double protrusion = 0;  // no ball stands out of the body by more
  double gap = 0;         // no surface point lies outside the union by more; the sum of both > 0
  double min_radius = 0;  // what only smaller balls could cover stays open, and the result is not proved
  double max_radius = std::numeric_limits<double>::infinity();
  int effort = 1;            // 0: greedy only, 1: local search, 2 and 3: finer, each about twice as long
  std::size_t large = 1000;  // above so many balls (at effort 2 and 3 always) the search goes on: 8 % fewer
};

// What cover() found.
struct Cover {
  std::vector<Ball> balls;              // with the whole protrusion allowed
  std::vector<std::uint32_t> triangle;  // of the surface, that each ball was grown from
  bool covered = false;  // the gap holds everywhere; false only where radius limits forbid a cover
  bool proved = false;   // so does the protrusion: never on an open surface, nor where it faces inward
};

// A ball grown from an inner medial ball of radius m to m + protrusion covers what lies within m + protrusion
// + gap of its centre: both tolerances widen the disc on the surface that it answers for. Choosing the fewest
// is a set cover problem over samples of the surface, solved by greedy and local search; balls are tried at
// finer places around the chosen; the certificate then names the spots that the samples missed, which become
// samples, until none is left. Throws Error for a surface without triangles and for a tolerance far too small
// for the mesh. Runs on all threads, the same result for any number of them.
Cover cover_surface(const Surface& surface, const CoverOptions& options);

// The fewest of given balls that leave no more of the surface farther out than `gap` than all of them do.
// Returns indices, ascending.
std::vector<std::uint32_t> thin_balls(const Surface& surface, const std::vector<Ball>& balls, double gap,
                                      int effort = 1);

}  // namespace padder
