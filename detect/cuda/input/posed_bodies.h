// SPDX-License-Identifier: MIT
// Bodies on the device, each at its pose of the call. They are kept from call to call: of a known revision
// only poses are brought. All searches of a detector share them, so that a call that two searches try brings
// them once. Only .cu files include this.
#pragma once
#include "detect/core/input.h"
#include "detect/cuda/device/memory.h"
#include "detect/cuda/input/host_copy.h"

namespace padder::detect::cuda {

struct MovedBody {
  Pose pose;
  std::uint64_t body = 0;
};

class PosedBodies {
 public:
  explicit PosedBodies(MemoryBook& book);

  // Before anything of a call is read.
  void begin_call(std::uint64_t moving) { read_ = false, moving_ = moving; }
  // Copies all of them, unless that was done in this call.
  const Body* read(const Input& input, cudaStream_t stream);
  // Brings the bodies of a known revision to their new poses. Poses that the caller keeps in host memory
  // stand in input.bodies by now (revision.h), and only those that moved go to the device. Throws Error for a
  // call without poses after one that left some where they were, since nobody knows them any more.
  void move(const Input& input, cudaStream_t stream);
  // The bodies whose poses are read where they lie in this call. Where some are static there are none, since
  // static bodies stay where they were put.
  PosePart in_place(const Input& input) const;
  // The same as move() for what is not in place, which is returned.
  PosePart move_in_place(const Input& input, cudaStream_t stream);
  // The poses of this call lie on GPUs, and its caller brings those that it needs to bodies(): all, or some.
  void expect_poses(bool all) { in_place_ = !all; }
  Body* bodies() { return bodies_.data(); }

 private:
  bool read_ = false;         // in this call
  bool in_place_ = false;     // the poses of some bodies that move stayed where they were
  std::uint64_t moving_ = 0;  // bodies
  bool some_static_ = false;
  HostCopy host_;
  Buffer<Body> bodies_;
  Buffer<Pose> poses_;
  Buffer<MovedBody> moved_, host_moved_;
};

// All poses, which lie in the memory of GPUs. Does not wait for the stream.
void copy_poses(const Input& input, Pose* to, cudaStream_t stream);

}  // namespace padder::detect::cuda
