// SPDX-License-Identifier: MIT
// Which elements a box of space needs, for a GPU that is one of several: all of them know all bodies, and
// each leaves out what cannot have a contact in its box. Only .cu files include this.
#pragma once
#include "detect/cuda/bodies/body_arrays.h"

namespace padder::detect::cuda {

class RegionElements {
 public:
  explicit RegionElements(MemoryBook& book);

  // The view without the moving elements whose balls lie where `own` has no contacts: those that stay have
  // new numbers from 0 on, in their order. Static elements keep their numbers. `balls`: placed, and grown by
  // half of the margin. `largest_static`: the largest radius of the balls of static elements. Waits for the
  // stream. Cost: a pass over all moving elements, and a copy of those that stay.
  BodyView select(const BodyView& all, const Region& own, double largest_static, cudaStream_t stream);
  void forget_static() { knows_static_ = false; }  // they are others now

 private:
  bool knows_static_ = false;
  Buffer<Element> elements_;
  Buffer<Sphere> balls_;
  Buffer<Stance> stances_;
  Buffer<std::uint32_t> tags_, numbers_;
  Buffer<unsigned char> scratch_;
  Buffer<unsigned long long> found_;  // the largest radius, and how many elements stay
};

}  // namespace padder::detect::cuda
