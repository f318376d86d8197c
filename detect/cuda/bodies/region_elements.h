// SPDX-License-Identifier: MIT
// Which elements a box of space needs, for a GPU that is one of several: all of them know all bodies, and
// each places those alone that may have a contact in its box. Only .cu files include this.
#pragma once
#include "detect/core/input.h"
#include "detect/cuda/bodies/body_arrays.h"
#include "detect/cuda/bodies/body_marks.h"
#include "detect/cuda/input/device_spheres.h"

namespace padder::detect::cuda {

class RegionElements {
 public:
  explicit RegionElements(MemoryBook& book);

  void forget() { knows_bodies_ = false; }  // they are others now
  // Begins a call: `own` limits its contacts.
  void begin(const Input& input, const DeviceSpheres& loose, const Region& own, double margin,
             cudaStream_t stream);
  // The marks of a part that has those of all bodies.
  const std::uint32_t* mark(const PosePart& all, cudaStream_t stream);
  // The numbers of the moving elements that may have a contact in `own`, in their order; `count` of them.
  // `parts`: of what moves, with marks, on the device. Waits for the stream. Cost: a pass over all elements.
  const std::uint32_t* choose(const BodyView& view, const PosePart* parts, std::uint32_t& count,
                              cudaStream_t stream);

 private:
  bool knows_bodies_ = false;
  DeviceSpheres loose_;
  Region own_;
  double margin_ = 0;
  BodyMarks marks_;
  Buffer<std::uint32_t> numbers_;
  Buffer<unsigned char> scratch_;
  Buffer<unsigned long long> found_;  // the largest loose radius, and how many elements stay
};

}  // namespace padder::detect::cuda
