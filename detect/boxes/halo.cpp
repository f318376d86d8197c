// SPDX-License-Identifier: MIT
#include "detect/boxes/halo.h"

#include <algorithm>

namespace padder::detect {

ShapeExtent extent_of(const Shape& shape) {
  ShapeExtent e;
  e.count = shape.count;
  for (std::uint64_t k = 0; k < shape.count; k++) {
    const Sphere& s = shape.spheres[k];
    if (fault_of(s) != Fault::none) e.faulty = true;
    const double c[3] = {s.x, s.y, s.z};
    for (int a = 0; a < 3; a++) e.low[a] = std::min(e.low[a], c[a]), e.high[a] = std::max(e.high[a], c[a]);
    e.largest_radius = std::max(e.largest_radius, s.r);
  }
  return e;
}

void middle_of(const Body& body, const ShapeExtent& shape, double (&at)[3]) {
  const Sphere middle{(shape.low[0] + shape.high[0]) / 2, (shape.low[1] + shape.high[1]) / 2,
                      (shape.low[2] + shape.high[2]) / 2, 0};
  const Sphere there = placed(body, middle);
  at[0] = there.x, at[1] = there.y, at[2] = there.z;
}

// Interval arithmetic. Every product and sum, here and in placed(), is off by at most u of `size`, the sum of
// the magnitudes: 6 u there, 6 u here, and the 30 u of the theorem. kHaloRounding is 128 u.
Bounds halo_of(const Body& body, const ShapeExtent& shape, double largest_radius, double margin) {
  Bounds b{{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
  if (shape.count == 0) return b;
  double low[3], high[3], size[3];
  for (int a = 0; a < 3; a++) {
    low[a] = high[a] = body.position[a], size[a] = magnitude(body.position[a]);
    for (int k = 0; k < 3; k++) {
      const double m = body.rotation[3 * a + k], p = m * shape.low[k], q = m * shape.high[k];
      low[a] += std::min(p, q), high[a] += std::max(p, q);
      size[a] += std::max(magnitude(p), magnitude(q));
    }
  }
  const double extent = std::max({size[0], size[1], size[2]}), r = shape.largest_radius;
  const double reach =
      r + margin / 2 + (kHaloRounding * (extent + r + largest_radius + margin) + kHaloUnderflow);
  for (int a = 0; a < 3; a++) {
    b.low[a] = low[a] - reach, b.high[a] = high[a] + reach;
    if (!(b.low[a] <= b.high[a])) b.low[a] = -INFINITY, b.high[a] = INFINITY;  // not a number
  }
  return b;
}

}  // namespace padder::detect
