// SPDX-License-Identifier: MIT
// Which bodies each of several boxes of space needs. Only .cu files include this.
#pragma once
#include <span>

#include "detect/boxes/cut.h"
#include "detect/boxes/halo.h"
#include "detect/cuda/device/memory.h"
#include "detect/cuda/device/report.h"

namespace padder::detect::cuda {

inline constexpr std::size_t kMostMarked = 64;  // boxes

// A box, and its bitmap: bit k of word w says that it may own a contact of body 32 w + k. The bitmap may lie
// on another GPU.
struct MarkedBox {
  Region box;
  std::uint32_t* marks = nullptr;
};

class BodyMarks {
 public:
  explicit BodyMarks(MemoryBook& book);

  // The bodies whose poses mark() will be given. Waits for the stream.
  void learn(std::span<const Shape> shapes, std::span<const Body> bodies, cudaStream_t stream);
  double largest_radius() const { return largest_radius_; }  // of all shapes
  // Writes the bitmap of each box, words() long. A body with which something may be wrong is in all. The pose
  // of body k are the twelve doubles from `poses` + k * `step` on, in the GPU's memory. No loose sphere is
  // larger than `largest_loose` and, if it is given, *larger. Does not wait. Cost: a pass over the poses.
  void mark(const double* poses, std::uint32_t step, std::span<const MarkedBox> boxes, double largest_loose,
            const double* larger, double margin, cudaStream_t stream);
  std::uint64_t words() const { return words_of(count_); }
  static std::uint64_t words_of(std::uint64_t bodies) { return (bodies + 31) / 32; }
  // Waits until the bitmaps are complete, wherever they lie.
  void wait(cudaStream_t stream) const;

 private:
  std::uint32_t count_ = 0;
  double largest_radius_ = 0;
  Buffer<std::uint32_t> shape_of_;
  Buffer<ShapeExtent> extents_;
  Buffer<unsigned long long> host_word_;
  Report report_;
};

}  // namespace padder::detect::cuda
