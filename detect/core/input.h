// SPDX-License-Identifier: MIT
// What every backend asks of an Input. Internal; host code.
#pragma once
#include "detect/detector.h"

namespace padder::detect {

// Spheres of all bodies and the loose ones; 2^64 - 1 if they are more than that.
std::uint64_t sphere_count(const Input& input);
// Body k at its pose, which must lie in host memory.
Body body_at(const Input& input, std::size_t k);
// Loose sphere k, which must lie in host memory.
inline Sphere loose_at(const Spheres& s, std::uint32_t k) {
  const std::uint64_t c = std::uint64_t(k) * s.center_stride, r = std::uint64_t(k) * s.radius_stride;
  const auto read = [&]<class T>(const T* centers, const T* radii) -> Sphere {
    return {centers[c], centers[c + 1], centers[c + 2], radii[r]};
  };
  if (s.scalar == Scalar::f32)
    return read(static_cast<const float*>(s.centers), static_cast<const float*>(s.radii));
  return read(static_cast<const double*>(s.centers), static_cast<const double*>(s.radii));
}

// Are there worlds other than world 0?
bool bodies_have_worlds(const Input& input);
inline bool loose_have_worlds(const Input& input) {
  return input.spheres.count > 0 && (input.spheres.world || input.spheres.world_of_all != 0);
}
inline bool has_worlds(const Input& input) { return loose_have_worlds(input) || bodies_have_worlds(input); }

}  // namespace padder::detect
