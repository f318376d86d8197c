// SPDX-License-Identifier: MIT
#include "detect/core/input.h"

#include <algorithm>

namespace padder::detect {

std::uint64_t sphere_count(const Input& input) {
  std::uint64_t n = loose_count(input);
  for (const Body& b : input.bodies) {
    const std::uint64_t more = input.shapes[b.shape].count;
    n = n > ~std::uint64_t(0) - more ? ~std::uint64_t(0) : n + more;
  }
  return n;
}

Body body_at(const Input& input, std::size_t k) {
  Body body = input.bodies[k];
  if (input.poses) set_pose(body, input.poses[k]);
  return body;
}

bool bodies_have_worlds(const Input& input) {
  return std::any_of(input.bodies.begin(), input.bodies.end(), [](const Body& b) { return b.world != 0; });
}

bool has_worlds(const Input& input) {
  if (!input.bodies.empty()) return loose_have_worlds(input) || bodies_have_worlds(input);
  const Spheres& s = input.spheres;
  return s.world && std::any_of(s.world, s.world + s.count, [&](std::uint32_t w) { return w != s.world[0]; });
}

}  // namespace padder::detect
