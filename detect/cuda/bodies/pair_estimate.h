// SPDX-License-Identifier: MIT
// How many balls of elements touch each other, from a sample of them. For hollow bodies, where they may be so
// many that even to count them takes longer than to search all spheres. Only .cu files include this.
#pragma once
#include "detect/cuda/bodies/body_arrays.h"

namespace padder::detect::cuda {

class PairEstimate {
 public:
  explicit PairEstimate(MemoryBook& book) : count_(book, "counters"), host_count_(book, "counters", true) {}
  // Of the elements that move, where their balls stand. Follows from them alone. Waits for the device.
  double pairs(const BodyView& view, cudaStream_t stream);

 private:
  Buffer<std::uint32_t> count_, host_count_;
};

}  // namespace padder::detect::cuda
