// SPDX-License-Identifier: MIT
// Which bodies each of several boxes of space needs. Only .cu files include this.
#pragma once
#include <span>

#include "detect/boxes/cut.h"
#include "detect/boxes/halo.h"
#include "detect/cuda/device/memory.h"

namespace padder::detect::cuda {

inline constexpr std::size_t kMostMarked = 64;  // boxes

class BodyMarks {
 public:
  explicit BodyMarks(MemoryBook& book);

  // The bodies whose poses mark() will be given. Waits for the stream.
  void learn(std::span<const Shape> shapes, std::span<const Body> bodies, cudaStream_t stream);
  double largest_radius() const { return largest_radius_; }  // of all shapes
  // A bitmap for each box, words() long: bit k of word w says that the box may own a contact of body 32 w +
  // k. A body with which something may be wrong is in all. The pose of body k are the twelve
  // doubles from `poses` + k * `step` on, in the GPU's memory. No loose sphere is larger than `largest_loose`
  // and, if it is given, *larger. Does not wait. Cost: a pass over the poses.
  const std::uint32_t* mark(const double* poses, std::uint32_t step, std::span<const Region> boxes,
                            double largest_loose, const double* larger, double margin, cudaStream_t stream);
  std::uint64_t words() const { return (std::uint64_t(count_) + 31) / 32; }

 private:
  std::uint32_t count_ = 0;
  double largest_radius_ = 0;
  Buffer<std::uint32_t> shape_of_, marks_;
  Buffer<ShapeExtent> extents_;
};

}  // namespace padder::detect::cuda
