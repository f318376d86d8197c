// SPDX-License-Identifier: MIT
// One sphere for each triangle at a depth ratio: the sphere fitting of the paper (section 2.3, figure 24).
#pragma once
#include <cstdint>
#include <vector>

#include "padding/asset/mesh.h"
#include "padding/geometry/balls.h"

namespace padder {

// A sphere and the triangle that it was fitted to.
struct FittedBall {
  Ball ball;
  double cap = 0;              // how far it may stand out: depth ratio times circumradius, a length
  std::uint32_t triangle = 0;  // of the remeshed surface
};

// A triangle with circumradius R at the depth ratio d gets a cap that stands h = d R above its plane, on the
// outer side. So the sphere through its three corners has the radius r = R (1 + d^2) / (2 d), and its centre
// lies r - h below the circumcentre. d = 1 puts the centre on the plane (r = R). A small d makes large
// spheres that lie flat: r / R = 2.6 at d = 0.2.
//
// `sliver_limit` (a length) guards against triangles so thin that R runs away. A triangle whose R is larger
// gets the sphere over its smallest enclosing circle (half the longest edge). This sphere covers the triangle
// but passes through two of its corners only. Throws Error unless 0 < depth_ratio <= 1. Returns one ball for
// each triangle, in their order.
std::vector<FittedBall> fit(const Mesh& mesh, double depth_ratio, double sliver_limit);

}  // namespace padder
