// SPDX-License-Identifier: MIT
// The outer surface of a union of balls, estimated: its volume, and how far it lies from the surface of a
// body.
#pragma once
#include "padding/geometry/balls.h"
#include "padding/geometry/surface.h"

namespace padder {

// These estimates serve to choose between covers. Reports measure again (padding/verify/accuracy.h).
struct UnionShape {
  double volume = 0;  // of the union, overlaps counted once
  // Mean distance to the body, over the part of the union's surface that lies outside it.
  double protrusion = 0;
  double gap = 0;  // mean distance of the body's surface to the union, 0 where it is covered
  // Mean angle between the normals of the union's surface and those of the body, degrees.
  double normal_error = 0;
};

// Samples about `samples` points spread evenly over the balls (spirals of equal area, at least 24 points on
// each ball) and about as many on the surface. The volume follows from the exposed points by the divergence
// theorem. Uses no random numbers and runs on all threads; the result does not depend on their number.
UnionShape union_shape(const Surface& surface, const std::vector<Ball>& balls, std::int64_t samples = 100000);

}  // namespace padder
