// SPDX-License-Identifier: MIT
// Placing elements: the ball, the stance and the tags of each where its body is. Only .cu files include this.
#pragma once
#include <cuda_pipeline.h>

#include "detect/cuda/bodies/body_arrays.h"
#include "detect/cuda/device/ptx.h"
#include "detect/cuda/input/device_spheres.h"

namespace padder::detect::cuda {

// Elements that follow one another.
struct ElementRange {
  std::uint32_t first = 0, count = 0;
};

struct Placing {
  BodyView view;  // what is placed, and where
  Body* bodies;   // gets the poses that are neither read in place nor here
  DeviceSpheres loose;
  double grown_by;  // added to the radius of each ball
};

// The poses of a warp's elements.
using PosesOfWarp = double[32][13];  // odd, against conflicts of banks

template <class T>
__device__ T* of_lane(T* pointer, unsigned lane) {
  return reinterpret_cast<T*>(
      __shfl_sync(kFullWarp, reinterpret_cast<unsigned long long>(pointer), static_cast<int>(lane)));
}

// By the whole warp: reads the poses of the lanes' elements, number by number, since they may lie on another
// GPU. All loads are under way at once. Of lanes whose element is a loose sphere nothing is read.
__device__ __forceinline__ void read_poses(const Placing& p, const PosePart& part, const Element& e,
                                           PosesOfWarp& poses) {
  const unsigned lane = threadIdx.x % 32;
  const double* from = nullptr;
  double* to = nullptr;
  if (e.body != kLoose) {
    from = part.poses + std::uint64_t(e.body - part.first) * part.step;
    if (part.poses != p.view.in_place.poses && part.poses != p.bodies->rotation)
      to = p.bodies[e.body].rotation;
  }
#pragma unroll
  for (unsigned k = 0; k < 12; k++) {
    const unsigned n = 32 * k + lane;
    if (const double* const pose = of_lane(from, n / 12))
      __pipeline_memcpy_async(&poses[n / 12][n % 12], pose + n % 12, sizeof(double));
  }
  __pipeline_commit();
  __pipeline_wait_prior(0);
  __syncwarp();
  if (!__any_sync(kFullWarp, to != nullptr)) return;
#pragma unroll
  for (unsigned k = 0; k < 12; k++) {
    const unsigned n = 32 * k + lane;
    if (double* const pose = of_lane(to, n / 12)) pose[n % 12] = poses[n / 12][n % 12];
  }
}

// The ball of an element whose body, if it has one, is at this pose.
__device__ __forceinline__ Sphere placed_ball(const Placing& p, const Element& e, const double* pose) {
  return e.body == kLoose ? ball_of(p.loose.sphere(e.piece))
                          : ball_of(body_at_pose(pose), p.view.pieces[e.piece]);
}
// Writes it to place `at`.
__device__ __forceinline__ void put(const Placing& p, std::uint32_t at, const Element& e, const double* pose,
                                    Sphere ball) {
  const BodyView& v = p.view;
  Filter f;
  if (e.body == kLoose) {
    v.stances[at] = stance_of(e, p.loose.sphere(e.piece), ball), f = p.loose.filter(e.piece);
  } else {
    const Body& tags = v.bodies[e.body];
    v.stances[at] = stance_of(body_at_pose(pose), e, v.pieces[e.piece], ball);
    f = {tags.family, tags.mask, owner_of(e.body, tags.is_static)};
  }
  if (p.grown_by > 0) ball.r += p.grown_by;  // stances are those of the balls themselves
  v.balls[at] = ball, v.family[at] = f.family, v.mask[at] = f.mask, v.owner[at] = f.owner;
}

}  // namespace padder::detect::cuda
