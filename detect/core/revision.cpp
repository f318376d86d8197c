// SPDX-License-Identifier: MIT
#include "detect/core/revision.h"

#include "detect/core/input.h"
#include "padding/asset/error.h"

namespace padder::detect {

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
      if (host_poses) set_pose(bodies_[k], input.poses[k]);
    }
    if (has_device_poses(input) && moving_.size() < bodies_.size()) {
      const std::vector<Pose> poses = read_poses();
      for (std::size_t k = 0; k < bodies_.size(); k++)
        if (bodies_[k].is_static) set_pose(bodies_[k], poses[k]);
    }
  } else if (host_poses) {
    for (const std::uint32_t k : moving_) set_pose(bodies_[k], input.poses[k]);
  } else {
    for (const std::uint32_t k : input.moved)
      if (!bodies_[k].is_static) set_pose(bodies_[k], pose_of(input.bodies[k]));
  }
  Input resolved = input;
  resolved.bodies = bodies_;
  if (host_poses) resolved.poses = nullptr;
  if (host_poses && known) resolved.moved = moving_;
  revision_ = input.revision;
  return resolved;
}

Input RevisionKeeper::settle(const Input& input) {
  Input settled = resolve(input, {});
  if (settled.poses) {  // there is no revision
    bodies_.assign(input.bodies.begin(), input.bodies.end());
    for (std::size_t k = 0; k < bodies_.size(); k++) set_pose(bodies_[k], input.poses[k]);
    settled.bodies = bodies_;
  }
  settled.revision = 0, settled.moved = {}, settled.poses = nullptr;
  return settled;
}

}  // namespace padder::detect
