// SPDX-License-Identifier: MIT
// How few spheres could do: a proved lower bound of the number of spheres in any cover of a surface.
#pragma once
#include <cstdint>
#include <limits>

#include "padding/geometry/surface.h"

namespace padder {

// Lengths are in the surface's unit. The search is made for surfaces of about unit size near the origin.
struct LowerBoundOptions {
  double protrusion = 0;  // no ball may stand out of the body by more, as the certificate bounds it
  double gap = 0;  // no surface point may lie farther outside the union; the sum of both must be above 0
  double max_radius = std::numeric_limits<double>::infinity();
  std::size_t boxes =
      24;  // that the proof may look at for each medial ball: more of them give a higher bound
};

// A cover is meant as the certificate proves it (padding/verify/certify.h): with the signed distance d(c) of
// its centre to the surface, negative inside the body, each ball has a radius of at most protrusion - d(c).
//
// Points of the surface get weights. If no ball can cover points with a sum of weights above 1, each ball of
// a cover takes up at most 1 of the sum, so that at least as many balls are needed as the sum says. The
// weights come from the linear programme that is dual to choosing balls in fractions. Branch and bound over
// all places of a centre finds the largest sum that a ball could cover; the weights are divided by it. So the
// bound is proved, however the weights were found. docs/tolerance.md has the proof.
//
// At least 1 for a surface with triangles; 1 for an open surface, which has no inside. Throws what
// sample_surface() throws. Runs on all threads; the result does not depend on their number.
std::uint64_t fewest_balls(const Surface& surface, const LowerBoundOptions& options);

}  // namespace padder
