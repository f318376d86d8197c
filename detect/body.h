// SPDX-License-Identifier: MIT
// Bodies: a shape (the spheres of a padded cluster) put at a place. Host and device; poses in double.
#pragma once
#include "detect/contact.h"

namespace padder::detect {

// The spheres of one asset in its own frame, in host memory: x, y, z, r each.
struct Shape {
  const Sphere* spheres = nullptr;
  std::uint64_t count = 0;
};

// A pose, and the shape that takes it.
struct Body {
  double rotation[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};  // rows; orthonormal
  double position[3] = {0, 0, 0};
  std::uint32_t shape = 0;  // index among the shapes
  std::uint32_t family = 0, mask = 0;
  bool is_static = false;  // stands still; two static ones are no contact
};

// Where a body is; as in Body.
struct Pose {
  double rotation[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  double position[3] = {0, 0, 0};
};

// Rows of the rotation of a quaternion w + xi + yj + zk of any length; host only. Throws Error for one that
// is zero, infinite or not a number: who reads it knows whose it is.
void rotation_of(double w, double x, double y, double z, double (&m)[9]);

// Written once, so that both backends place a sphere at the same bits.
PADDER_HD Sphere placed(const Body& b, const Sphere& s) {
  const double* m = b.rotation;
  return {add(add(add(mul(m[0], s.x), mul(m[1], s.y)), mul(m[2], s.z)), b.position[0]),
          add(add(add(mul(m[3], s.x), mul(m[4], s.y)), mul(m[5], s.z)), b.position[1]),
          add(add(add(mul(m[6], s.x), mul(m[7], s.y)), mul(m[8], s.z)), b.position[2]), s.r};
}

}  // namespace padder::detect
