// SPDX-License-Identifier: MIT
// Points spread evenly over a sphere, without random numbers.
#pragma once
#include <algorithm>
#include <cmath>
#include <numbers>

#include "padding/asset/mesh.h"

namespace padder {

// Point k of n on a spiral over the unit sphere: each point stands for the same area, and none gather at the
// poles (Gonzalez, Measurement of areas on a sphere using Fibonacci and latitude-longitude lattices, 2010).
// `turn` turns the spiral, in radians: neighbouring balls get different ones, so that they are not sampled
// alike.
inline Vector sphere_point(std::int64_t k, std::int64_t n, double turn = 0) {
  constexpr double golden_angle = std::numbers::pi * (3 - 2.2360679774997896964);
  const double z = 1 - (2 * double(k) + 1) / double(n), s = std::sqrt(std::max(0.0, 1 - z * z));
  const double angle = golden_angle * double(k) + turn;
  return {s * std::cos(angle), s * std::sin(angle), z};
}

}  // namespace padder
