// SPDX-License-Identifier: MIT
// Which elements a box of space needs, for a GPU that is one of several: all of them know all bodies, and
// each places those alone that may have a contact in its box. Only .cu files include this.
#pragma once
#include <vector>

#include "detect/core/input.h"
#include "detect/cuda/bodies/body_arrays.h"
#include "detect/cuda/bodies/body_marks.h"
#include "detect/cuda/input/device_spheres.h"

namespace padder::detect::cuda {

class RegionElements {
 public:
  explicit RegionElements(MemoryBook& book);

  void forget() { knows_bodies_ = false; }  // they are others now
  // The moving elements that may have a contact in `own`. Poses in the memory of GPUs are read where they
  // are, others from `view`. Waits for the stream. Cost: a pass over all elements, and over the poses unless
  // they are marked.
  ChosenElements choose(const Input& input, const BodyView& view, const DeviceSpheres& loose,
                        const Region& own, double margin, cudaStream_t stream);

 private:
  bool knows_bodies_ = false;
  std::vector<PosePart> known_parts_;
  BodyMarks marks_;
  Buffer<PosePart> parts_;
  Buffer<std::uint32_t> numbers_;
  Buffer<unsigned char> scratch_;
  Buffer<unsigned long long> found_;  // the largest loose radius, and how many elements stay
};

}  // namespace padder::detect::cuda
