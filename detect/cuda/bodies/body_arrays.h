// SPDX-License-Identifier: MIT
// Bodies and their shapes on the device, for every search over pieces of bodies. Only .cu files include this.
#pragma once
#include <vector>

#include "detect/core/bodies/pieces.h"
#include "detect/core/input.h"
#include "detect/cuda/device/memory.h"
#include "detect/detector.h"

namespace padder::detect::cuda {

// A body at the pose that is twelve doubles; pose alone.
__device__ __forceinline__ Body body_at_pose(const double* pose) {
  static_assert(sizeof(Body) % sizeof(double) == 0 && offsetof(Body, rotation) == 0 &&
                offsetof(Body, position) == 9 * sizeof(double));
  Body b;
#pragma unroll
  for (int c = 0; c < 9; c++) b.rotation[c] = pose[c];
#pragma unroll
  for (int c = 0; c < 3; c++) b.position[c] = pose[9 + c];
  return b;
}

// The scene as the kernels of bodies read it.
struct BodyView {
  const Body* bodies = nullptr;
  PosePart in_place;                  // bodies whose poses are read where the caller has them, in this call
  const Element* elements = nullptr;  // in BodyInput: those that move first, then static ones
  const Piece* pieces = nullptr;
  const Sphere* spheres = nullptr;
  const std::uint32_t* numbers = nullptr;               // of each of these within its shape
  const NearSphere *near = nullptr, *groups = nullptr;  // of Pieces, as the boxes
  const NearBox* boxes = nullptr;
  const std::uint32_t* body_first = nullptr;
  Sphere* balls = nullptr;    // about each element
  Stance* stances = nullptr;  // of each element
  std::uint32_t *family = nullptr, *mask = nullptr, *owner = nullptr;
  std::uint32_t moving = 0, count = 0, loose_first = 0;
  std::uint32_t unit_piece = 0, unit_near = 0;  // what stands for a loose sphere in `boxes` and `near`
  bool grouped = false;                         // the narrow phase goes by groups (tuning.h)
  friend bool operator==(const BodyView&, const BodyView&) = default;

  // The twelve doubles of a body's pose in this call.
  PADDER_HD const double* pose_of(std::uint32_t k) const {
    const std::uint32_t at = k - in_place.first;
    return at < in_place.count ? in_place.poses + std::uint64_t(at) * in_place.step : bodies[k].rotation;
  }
  // The body there; pose alone.
  __device__ __forceinline__ Body placed_body(std::uint32_t k) const { return body_at_pose(pose_of(k)); }
};

// Holds the shapes of bodies. What belongs to elements is the owner's.
class BodyArrays {
 public:
  explicit BodyArrays(MemoryBook& book);

  // Copies all of them; of the view the bodies are the caller's. `body_first`: the number of the first sphere
  // of each body, and of the first loose sphere. The vectors must outlive the copies.
  BodyView read(const Input& input, const Body* bodies, const Pieces& pieces,
                const std::vector<std::uint32_t>& body_first, cudaStream_t stream);

 private:
  Buffer<Piece> pieces_;
  Buffer<Sphere> spheres_;
  Buffer<std::uint32_t> numbers_, body_first_;
  Buffer<NearSphere> near_, groups_;
  Buffer<NearBox> boxes_;
};

}  // namespace padder::detect::cuda
