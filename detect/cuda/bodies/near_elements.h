// SPDX-License-Identifier: MIT
// Places the elements that a box of space needs, for a GPU that is one of several, and finds those that the
// boxes of the others need. Only .cu files include this.
#pragma once
#include <span>

#include "detect/core/input.h"
#include "detect/cuda/bodies/placing.h"
#include "detect/cuda/device/report.h"

namespace padder::detect::cuda {

class NearElements {
 public:
  explicit NearElements(MemoryBook& book);

  struct Task {
    Placing placing;
    PosePart part;                  // of bodies
    ElementRange of_bodies, loose;  // the elements that are looked at: those of these bodies, loose spheres
    std::span<const Region> boxes;  // that of this GPU, then those of others; at most kMostPoseParts
    // No sphere of a body is larger than `largest` nor, where there are several boxes, any loose one. With
    // one box the largest loose sphere is looked for.
    double largest = 0, margin = 0;
    bool ordered = false;  // by their numbers; takes longer
  };
  // Places those that may have a contact in the first box, from place 0 on without gaps, and lists for each
  // other box those of bodies that may have one there. An element with which something may be wrong
  // belongs to every box: whoever searches finds that. Returns how many were placed. Waits for the stream.
  // Cost: a pass over the elements.
  std::uint32_t place(const Task& task, cudaStream_t stream);
  // The list for a box but the first. It stands until the next call of place().
  ListedElements listed(std::size_t box) const {
    return {numbers_.data() + (box - 1) * room_, static_cast<std::uint32_t>(host_counts_.data()[box])};
  }

 private:
  bool try_place(const Task& task, cudaStream_t stream);

  std::uint32_t room_ = 0;   // of a list
  std::uint64_t clear_ = 0;  // words_.capacity(), if all of these words are zero
  Buffer<std::uint32_t> numbers_;
  Buffer<unsigned long long> words_, host_counts_, largest_;  // largest_: radius of a loose sphere
  Report report_;
};

}  // namespace padder::detect::cuda
