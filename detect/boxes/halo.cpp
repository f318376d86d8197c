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

}  // namespace padder::detect
