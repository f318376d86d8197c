// SPDX-License-Identifier: MIT
#include "detect/boxes/box_input.h"

#include <algorithm>
#include <string>

#include "detect/core/errors.h"
#include "padding/asset/error.h"

namespace padder::detect {
namespace {

template <class From>
void copy_pose(const From& from, Body& to) {
  std::copy_n(from.rotation, 9, to.rotation), std::copy_n(from.position, 3, to.position);
}

}  // namespace

void check_box_input(const Input& input) {
  check_arrays(input);
  const Spheres& s = input.spheres;
  if ((s.count && s.memory == Memory::device) || (input.poses && input.pose_memory == Memory::device))
    throw Error(
        "detection by boxes reads spheres and poses from host memory: copy them, or use one Detector");
}

Input BodyKeeper::settle(const Input& input) {
  const bool known =
      input.revision != 0 && input.revision == revision_ && input.bodies.size() == bodies_.size();
  revision_ = 0;  // set when all is copied
  for (const std::uint32_t k : input.moved)
    if (k >= input.bodies.size())
      throw Error("body " + std::to_string(k) + " is said to have moved, but there are " +
                  std::to_string(input.bodies.size()));
  Input settled = input;
  settled.revision = 0, settled.moved = {}, settled.poses = nullptr;
  if (input.revision == 0 && !input.poses) return settled;
  if (!known) bodies_.assign(input.bodies.begin(), input.bodies.end());
  if (input.poses) {
    for (std::size_t k = 0; k < bodies_.size(); k++)
      if (!known || !bodies_[k].is_static) copy_pose(input.poses[k], bodies_[k]);
  } else if (known) {
    for (const std::uint32_t k : input.moved)
      if (!bodies_[k].is_static) copy_pose(input.bodies[k], bodies_[k]);
  }
  settled.bodies = bodies_;
  revision_ = input.revision;
  return settled;
}

}  // namespace padder::detect
