// SPDX-License-Identifier: MIT
// The inner medial ball: the largest ball inside a body that touches the surface at a given point.
#pragma once
#include "padding/geometry/balls.h"
#include "padding/geometry/surface.h"

namespace padder {

// Finds the ball that has its centre on p - t normal (0 <= t <= largest), touches the surface at p and holds
// no surface point inside. The method is the shrinking-ball iteration (Ma, Bae and Choi, 3D medial axis point
// approximation using nearest neighbors and the normal field, 2012). `p` lies on the surface. `normal` has
// unit length and points out of the body; it need not be the normal of the facet. At a convex edge, or with a
// wrong normal, the exact ball would vanish. So the iteration stops as soon as the ball misses p by at most
// `tolerance`, which must be above 0. Where it stops beside p, on the same wall, the surface is rough there:
// as long as that gives a larger ball, it goes on below the point that stopped it.
//
// For any input:
// * the centre lies inside the body or on its surface;
// * the radius is the distance of the centre to the surface, so the ball dilated by h stands out of the body
//   by at most h;
// * |p - center| <= radius + 2 tolerance. Where no such ball was found the answer is {p, 0}.
// * On a sheet the answer is {p, half of its thickness, but at most `largest`}.
//
// In a surface with a hull (Surface::hull) the ball is the larger of those on both sides of p, its radius is
// what Surface::signed_nearest gives, and without such a ball the answer is also {p, 0}.
//
// `guess` is where the search for the radius begins, or 0: a radius that is a little larger than the one to
// be found saves queries. A point of `inner`, which is a ball inside the body that holds no surface point, is
// known to lie inside. Neither changes the contract. Costs a few nearest-point queries, typically 4 to 10.
Ball inner_medial_ball(const Surface& surface, const Point& p, const Vector& normal, double largest,
                       double tolerance, double guess = 0, const Ball& inner = {});

}  // namespace padder
