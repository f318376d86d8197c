// SPDX-License-Identifier: MIT
// The inner medial ball: the largest ball inside a body that touches its surface at a given point.
#pragma once
#include "padding/geometry/balls.h"
#include "padding/geometry/surface.h"

namespace padder {

// The ball with its centre on p - t normal (0 <= t <= largest) that touches the surface at p and holds no
// surface point inside, by the shrinking-ball iteration (Ma, Bae and Choi, 3D medial axis point approximation
// using nearest neighbors and the normal field, 2012). `p` lies on the surface, `normal` is of unit length
// and points out of the body there; it need not be the facet's own. At a convex edge or where the normal is
// off, the exact ball would vanish: the iteration stops as soon as the ball misses p by no more than
// `tolerance` > 0.
//
// What holds whatever the input:
//   the centre lies inside the body or on its surface,
//   the radius is the distance of the centre to the surface (so the same ball, dilated by h, stands out of
//   the body by at most h), and |p - center| <= radius + tolerance, unless no such ball was found: then it is
//   {p, 0}.
// Costs a few nearest-point queries, typically 4 to 8.
Ball inner_medial_ball(const Surface& surface, const Point& p, const Vector& normal, double largest,
                       double tolerance);

}  // namespace padder
