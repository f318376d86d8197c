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
  const Spheres& s = input.spheres;
  if (s.count && s.world && s.memory == Memory::device) return true;
  std::uint32_t one = kEveryWorld;
  const auto is_another = [&](std::uint32_t world) {
    if (one == kEveryWorld) one = world;
    return !worlds_meet(one, world);
  };
  if (std::ranges::any_of(input.bodies, is_another, &Body::world)) return true;
  if (!s.world) return s.count && is_another(s.world_of_all);
  return std::any_of(s.world, s.world + s.count, is_another);
}

}  // namespace padder::detect
