// SPDX-License-Identifier: MIT
#include "detect/core/input.h"

#include <algorithm>
#include <string>

#include "padding/asset/error.h"

namespace padder::detect {
namespace {

std::uint64_t plus(std::uint64_t a, std::uint64_t b) {
  return a > ~std::uint64_t(0) - b ? ~std::uint64_t(0) : a + b;
}

}  // namespace

BodyTally tally_of(const Input& input) {
  BodyTally t;
  t.of_shape.resize(input.shapes.size()), t.moving_of_shape.resize(input.shapes.size());
  for (std::size_t k = 0; k < input.bodies.size(); k++) {
    const Body& b = input.bodies[k];
    if (b.shape >= input.shapes.size())
      throw Error("body " + std::to_string(k) + " names shape " + std::to_string(b.shape) +
                  ", but there are " + std::to_string(input.shapes.size()));
    t.of_shape[b.shape]++, t.moving_of_shape[b.shape] += !b.is_static;
    t.spheres = plus(t.spheres, input.shapes[b.shape].count);
    t.moving += !b.is_static, t.have_worlds = t.have_worlds || b.world != 0;
    if (t.world == kEveryWorld) t.world = b.world;
    t.apart = t.apart || !worlds_meet(t.world, b.world);
  }
  return t;
}

std::uint64_t sphere_count(const BodyTally& bodies, std::uint64_t loose) {
  return plus(bodies.spheres, loose);
}

Body body_at(const Input& input, std::size_t k) {
  Body body = input.bodies[k];
  if (input.poses) set_pose(body, input.poses[k]);
  return body;
}

bool has_worlds(const BodyTally& bodies, const Input& input) {
  std::uint32_t one = bodies.world;
  const auto is_another = [&](std::uint32_t world) {
    if (one == kEveryWorld) one = world;
    return !worlds_meet(one, world);
  };
  const auto has_another = [&](const Spheres& s) {
    if (s.count == 0 || !s.world) return s.count > 0 && is_another(s.world_of_all);
    return s.memory == Memory::device || std::any_of(s.world, s.world + s.count, is_another);
  };
  return bodies.apart || has_another(input.spheres) || (input.around && has_another(input.around->spheres));
}

}  // namespace padder::detect
