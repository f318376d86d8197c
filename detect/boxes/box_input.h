// SPDX-License-Identifier: MIT
// The scene as the boxes read it: checked, in host memory, and with every body at its pose. Internal.
#pragma once
#include <vector>

#include "detect/detector.h"

namespace padder::detect {

// Throws Error for a scene that cannot be read: missing pointers, shapes that are not there, device memory.
void check_box_input(const Input& input);

// Keeps what Input::revision promises: with the revision of the call before, a body stands where it stood
// then unless the call says that it moved. The boxes always get complete bodies, since a body may have come
// into another box.
class BodyKeeper {
 public:
  // The input with all poses in its bodies, without a revision. Borrows this object and the input. Copies the
  // bodies where there is a revision or `poses`. Throws Error for a number in `moved` that is out of range.
  Input settle(const Input& input);
  void forget() { revision_ = 0; }

 private:
  std::uint64_t revision_ = 0;
  std::vector<Body> bodies_;
};

}  // namespace padder::detect
