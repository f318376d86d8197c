// SPDX-License-Identifier: MIT
// Loose spheres of many worlds, without bodies: they are searched on the grid as if the worlds lay side by
// side. Contacts are decided, and records written, by the spheres as they are given. Only .cu files include
// this.
#pragma once
#include "detect/cuda/call/sphere_search.h"
#include "detect/cuda/device/report.h"
#include "detect/cuda/input/input_copy.h"

namespace padder::detect::cuda {

class WorldsApart {
 public:
  explicit WorldsApart(MemoryBook& book);

  // All contacts into call.list; their number and that of the spheres to `contacts`. False, and nothing was
  // searched: there are bodies, a region or some spheres of kEveryWorld, or the worlds would take so much
  // space that float could not tell their spheres apart. Waits once more for the device than without worlds.
  // Throws Error.
  bool run(const Call& call, Contacts& contacts);
  void forget() { search_.forget(); }

 private:
  WorldBounds bounds(const DeviceSpheres& source, cudaStream_t stream);
  static bool lay_out(const WorldBounds& bounds, double margin, DeviceSpheres& source);

  InputCopy input_;
  SphereSearch search_;
  bool apart_ = false;  // in the last call; false: all were of one world
  Report report_;
  Buffer<unsigned long long> words_, host_words_;
};

}  // namespace padder::detect::cuda
