// SPDX-License-Identifier: MIT
// Carries out what Input::revision promises, in one place for every backend and path. Internal; host code.
#pragma once
#include <functional>
#include <vector>

#include "detect/detector.h"

namespace padder::detect {

// Remembers where the bodies of the previous call were.
class RevisionKeeper {
 public:
  // The input with every body at the pose that Input::revision says. Without a revision it is the input as
  // given. With one, `bodies` refers to a copy in this object, which already contains poses that lie in host
  // memory, and `moved` lists every body that may have moved since the previous call. Poses in device memory
  // stay there, and count for the bodies that are not static. Those of static bodies are asked of
  // read_poses() when the revision is new, and put into `bodies`. Throws Error for an index in `moved` that
  // is out of range.
  using ReadPoses = std::function<std::vector<Pose>()>;
  Input resolve(const Input& input, const ReadPoses& read_poses);
  // The same for a reader who remembers nothing between calls: the bodies have their poses, and no revision,
  // `moved` or `poses` is left. For poses in host memory.
  Input settle(const Input& input);
  void forget() noexcept { revision_ = 0; }

 private:
  std::uint64_t revision_ = 0;
  std::vector<Body> bodies_;
  std::vector<std::uint32_t> moving_;  // bodies that are not static
};

}  // namespace padder::detect
