// SPDX-License-Identifier: MIT
#include "detect/core/revision.h"

#include <algorithm>

#include "detect/core/input.h"
#include "padding/asset/error.h"

namespace padder::detect {
namespace {

void take_pose(const Pose& from, Body& to) {
  std::copy_n(from.rotation, 9, to.rotation), std::copy_n(from.position, 3, to.position);
}

}  // namespace

Input RevisionKeeper::resolve(const Input& input, const ReadPoses& read_poses) {
  const bool known =
      input.revision != 0 && input.revision == revision_ && input.bodies.size() == bodies_.size();
  revision_ = 0;  // set again at the end, when everything is copied
  for (const std::uint32_t k : input.moved)
    if (k >= input.bodies.size())
      throw Error("body " + std::to_string(k) + " is said to have moved, but there are " +
                  std::to_string(input.bodies.size()));
  if (input.revision == 0) return input;
  const bool host_poses = input.poses && input.pose_memory == Memory::host;
  if (!known) {
    bodies_.assign(input.bodies.begin(), input.bodies.end());
    moving_.clear();
    for (std::size_t k = 0; k < bodies_.size(); k++) {
      if (!bodies_[k].is_static) moving_.push_back(static_cast<std::uint32_t>(k));
      if (host_poses) take_pose(input.poses[k], bodies_[k]);
    }
    if (has_device_poses(input) && moving_.size() < bodies_.size()) {
      const std::vector<Pose> poses = read_poses();
      for (std::size_t k = 0; k < bodies_.size(); k++)
        if (bodies_[k].is_static) take_pose(poses[k], bodies_[k]);
    }
  } else if (host_poses) {
    for (const std::uint32_t k : moving_) take_pose(input.poses[k], bodies_[k]);
  } else {
    for (const std::uint32_t k : input.moved)
      if (!bodies_[k].is_static) {
        std::copy_n(input.bodies[k].rotation, 9, bodies_[k].rotation);
        std::copy_n(input.bodies[k].position, 3, bodies_[k].position);
      }
  }
  Input resolved = input;
  resolved.bodies = bodies_;
  if (host_poses) resolved.poses = nullptr;
  if (host_poses && known) resolved.moved = moving_;
  revision_ = input.revision;
  return resolved;
}

}  // namespace padder::detect
