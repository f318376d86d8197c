// SPDX-License-Identifier: MIT
// What Input::revision promises, kept in one place for every backend and path. Internal; host code.
#pragma once
#include <functional>
#include <vector>

#include "detect/detector.h"

namespace padder::detect {

// The bodies of the call before, where they were.
class RevisionKeeper {
 public:
  // The input with every body where it is to be, by the contract of Input::revision. With a revision
  // `bodies` is a copy in this object, poses in host memory are in it already, and `moved` names whatever may
  // stand elsewhere than in the call before. Poses in device memory stay what and where they are, for bodies
  // that move; those of static bodies are asked for with a new revision, by read_poses(), and are in `bodies`
  // then. Copies what may have moved, all bodies with a new revision. Throws Error for an index in `moved`
  // that is out of range.
  using ReadPoses = std::function<std::vector<Pose>()>;
  Input settle(const Input& input, const ReadPoses& read_poses);
  void forget() noexcept { revision_ = 0; }

 private:
  std::uint64_t revision_ = 0;
  std::vector<Body> bodies_;
  std::vector<std::uint32_t> moving_;  // bodies that are not static
};

}  // namespace padder::detect
