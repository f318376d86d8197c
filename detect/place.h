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
};

// Rows of the rotation of a quaternion w + xi + yj + zk of any length but zero; host only.
inline void rotation_of(double w, double x, double y, double z, double (&m)[9]) {
  const double s = 2 / (w * w + x * x + y * y + z * z);
  const double rows[9] = {1 - s * (y * y + z * z), s * (x * y - w * z),     s * (x * z + w * y),
                          s * (x * y + w * z),     1 - s * (x * x + z * z), s * (y * z - w * x),
                          s * (x * z - w * y),     s * (y * z + w * x),     1 - s * (x * x + y * y)};
  for (int k = 0; k < 9; k++) m[k] = rows[k];
}

// Written once, so that both backends place a sphere at the same bits.
PADDER_HD Sphere placed(const Body& b, const Sphere& s) {
  const double* m = b.rotation;
  return {add(add(add(mul(m[0], s.x), mul(m[1], s.y)), mul(m[2], s.z)), b.position[0]),
          add(add(add(mul(m[3], s.x), mul(m[4], s.y)), mul(m[5], s.z)), b.position[1]),
          add(add(add(mul(m[6], s.x), mul(m[7], s.y)), mul(m[8], s.z)), b.position[2]), s.r};
}

}  // namespace padder::detect
