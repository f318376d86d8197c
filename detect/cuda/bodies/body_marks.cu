// SPDX-License-Identifier: MIT
#include "detect/cuda/bodies/body_marks.h"

#include <algorithm>
#include <vector>

#include "detect/cuda/bodies/body_arrays.h"
#include "detect/cuda/device/blocks.h"

namespace padder::detect::cuda {
namespace {

constexpr unsigned kThreads = 256, kWarps = kThreads / 32;

struct Boxes {
  MarkedBox box[kMostMarked];
  int count = 0;
};

__global__ void __launch_bounds__(kThreads)
    mark_kernel(const double* poses, std::uint32_t step, const std::uint32_t* shape_of,
                const ShapeExtent* extents, std::uint32_t count, const __grid_constant__ Boxes boxes,
                double largest, const double* larger, double margin) {
  if (larger) largest = detect::larger(largest, *larger);
  const std::uint64_t words = (std::uint64_t(count) + 31) / 32;
  const unsigned lane = threadIdx.x % 32;
  for (std::uint64_t w = (blockIdx.x * kThreads + threadIdx.x) / 32; w < words; w += gridDim.x * kWarps) {
    const std::uint64_t k = 32 * w + lane;
    Bounds halo{};
    bool odd = false;  // something may be wrong with it: whoever searches finds that
    if (k < count) {
      const ShapeExtent& shape = extents[shape_of[k]];
      halo = halo_of(body_at_pose(poses + k * step), shape, largest, margin);
      odd = shape.faulty;
      for (int a = 0; a < 3 && shape.count; a++)
        odd = odd || !(-kBallInFloat < halo.low[a] && halo.high[a] < kBallInFloat);
    }
    for (int b = 0; b < boxes.count; b++) {
      const unsigned needed = __ballot_sync(~0u, k < count && (odd || meets(halo, boxes.box[b].box)));
      if (lane == 0) boxes.box[b].marks[w] = needed;
    }
  }
}

}  // namespace

BodyMarks::BodyMarks(MemoryBook& book)
    : shape_of_(book, "the bodies near a box"),
      extents_(book, "the bodies near a box"),
      host_word_(book, "the bodies near a box", true) {}

void BodyMarks::learn(std::span<const Shape> shapes, std::span<const Body> bodies, cudaStream_t stream) {
  std::vector<ShapeExtent> extents;
  for (const Shape& s : shapes) extents.push_back(extent_of(s));
  largest_radius_ = 0;
  for (const ShapeExtent& e : extents) largest_radius_ = std::max(largest_radius_, e.largest_radius);
  std::vector<std::uint32_t> shape_of;
  for (const Body& b : bodies) shape_of.push_back(b.shape);
  count_ = static_cast<std::uint32_t>(bodies.size());
  copied(extents_, extents.data(), extents.size(), stream);
  copied(shape_of_, shape_of.data(), shape_of.size(), stream);
  cuda_check(cudaStreamSynchronize(stream), "copy the bodies");  // the vectors must outlive their copies
}

void BodyMarks::mark(const double* poses, std::uint32_t step, std::span<const MarkedBox> boxes,
                     double largest_loose, const double* larger, double margin, cudaStream_t stream) {
  if (count_ == 0) return;
  Boxes all;
  all.count = static_cast<int>(boxes.size());
  std::copy(boxes.begin(), boxes.end(), all.box);
  // Some word: that it comes is all that it says.
  report_.clear(), report_.add(extents_.data(), host_word_.reserve(1), sizeof(unsigned long long));
  report_.expect();
  mark_kernel<<<blocks_of_loop(count_, kThreads), kThreads, 0, stream>>>(
      poses, step, shape_of_.data(), extents_.data(), count_, all, std::max(largest_radius_, largest_loose),
      larger, margin);
  cuda_launched("choose the bodies");
  report_.send(stream);
}

void BodyMarks::wait(cudaStream_t stream) const {
  if (count_ > 0) report_.arrived(stream, "choose the bodies");
}

}  // namespace padder::detect::cuda
