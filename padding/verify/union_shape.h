// SPDX-License-Identifier: MIT
// What a union of balls looks like from outside: points of its surface, its volume, how it stands to a body's
// surface.
#pragma once
#include "padding/geometry/balls.h"
#include "padding/geometry/surface.h"

namespace padder {

// Estimates for choosing between covers; a report measures again (padding/verify/accuracy.h).
struct UnionShape {
  double volume = 0;  // of the union, overlaps counted once
  double protrusion =
      0;           // mean distance to the body, over the part of the union's surface that lies outside of it
  double gap = 0;  // mean distance of the body's surface to the union, 0 where covered
  double normal_error =
      0;  // degrees, mean angle between the normals of the union's surface and of the body's there
};

// From `samples` points spread evenly over the balls (spirals of equal area, at least 24 a ball) and about as
// many on the surface. The volume follows from the exposed points by the divergence theorem. No random
// numbers; runs on all threads, the same result for any number of them.
UnionShape union_shape(const Surface& surface, const std::vector<Ball>& balls, std::int64_t samples = 100000);

}  // namespace padder
