// SPDX-License-Identifier: MIT
// A body: a shape (the spheres of a padded cluster) at a pose. For host and device; poses are in double.
#pragma once
#include <algorithm>

#include "detect/contact.h"

namespace padder::detect {

// The spheres of one asset, in its own frame. They lie in host memory.
struct Shape {
  const Sphere* spheres = nullptr;
  std::uint64_t count = 0;
};

// A shape at a pose. The caller answers for the rotation: the detector does not check whether the matrix is
// orthonormal. One that is not, such as one of zeros, places the spheres wherever it maps them, and contacts
// may be missing. rotation_of() makes one that is orthonormal. Python checks those in host memory.
struct Body {
  double rotation[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};  // an orthonormal matrix, row by row
  double position[3] = {0, 0, 0};
  std::uint32_t shape = 0;  // index in Input::shapes
  std::uint32_t family = 0, mask = 0;
  bool is_static = false;   // it does not move; two static bodies are never a contact
  std::uint32_t world = 0;  // it meets what is in this world or in kEveryWorld, which meets all
};

// Where a body is; the same members as in Body.
struct Pose {
  double rotation[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  double position[3] = {0, 0, 0};
};
// Host code.
inline Pose pose_of(const Body& body) {
  Pose pose;
  std::copy_n(body.rotation, 9, pose.rotation), std::copy_n(body.position, 3, pose.position);
  return pose;
}
inline void set_pose(Body& body, const Pose& pose) {
  std::copy_n(pose.rotation, 9, body.rotation), std::copy_n(pose.position, 3, body.position);
}

// Writes the rotation matrix of the quaternion w + xi + yj + zk, row by row. The quaternion may have any
// length. Throws Error if it is 0, infinite or not a number; the caller adds where it came from. Host code.
void rotation_of(double w, double x, double y, double z, double (&m)[9]);

// Where a sphere of the shape is while the body stands at its pose. Both backends use this function, so they
// compute the same bits.
PADDER_HD Sphere placed(const Body& b, const Sphere& s) {
  const double* m = b.rotation;
  return {add(add(add(mul(m[0], s.x), mul(m[1], s.y)), mul(m[2], s.z)), b.position[0]),
          add(add(add(mul(m[3], s.x), mul(m[4], s.y)), mul(m[5], s.z)), b.position[1]),
          add(add(add(mul(m[6], s.x), mul(m[7], s.y)), mul(m[8], s.z)), b.position[2]), s.r};
}

}  // namespace padder::detect
