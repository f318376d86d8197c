// SPDX-License-Identifier: MIT
// One sphere a triangle at a depth ratio: the paper's sphere fitting (section 2.3, its figure 24).
#pragma once
#include <cstdint>
#include <vector>

#include "padding/asset/mesh.h"
#include "padding/geometry/balls.h"

namespace padder {

// A sphere and where it came from.
struct FittedBall {
  Ball ball;
  double cap = 0;              // how far it may stand out of the surface: depth ratio x circumradius; length
  std::uint32_t triangle = 0;  // of the remeshed surface
};

// For a triangle with circumradius R and the depth ratio d the cap stands h = d R above the triangle's plane
// on its outer side, so the sphere through the three corners has the radius r = R (1 + d^2) / (2 d) and its
// centre lies r - h below the circumcentre. d = 1 puts the centre on the plane (r = R); small d makes large,
// flat-lying spheres: r / R = 2.6 at 0.2.
//
// `sliver_limit` (length) guards against triangles so thin that R runs away: one whose R is larger gets the
// sphere over its smallest enclosing circle (half the longest edge), which covers it but passes through two
// corners only. 0 < depth <= 1, else Error. One ball a triangle, in order.
std::vector<FittedBall> fit(const Mesh& mesh, double depth, double sliver_limit);

}  // namespace padder
