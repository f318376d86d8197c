// SPDX-License-Identifier: MIT
// The kernels of one step, in the order of their launch. Only .cu files include this.
#pragma once
#include "tools/settle/cuda/view.h"

namespace padder::settle::cuda {

// Where no body has more spheres than this, one thread takes the step of each, and the detector is given
// their spheres and not the bodies.
inline constexpr std::uint32_t kSmallBody = 8;

// One step from records[0] to records[1]; nothing happens if the step of records[0] failed or was not taken,
// or left a sphere `limit` or farther from where it was when candidates were found. `fastest`: a mover with a
// larger speed is wild. `large`: spheres with a block of their own, in device memory.
struct StepTask {
  View view;
  Record* records = nullptr;
  double limit = 0, fastest = 0;
  const std::uint32_t* large = nullptr;
  std::uint32_t large_count = 0;
  bool large_in_bodies = false;    // is one of them a body's?
  std::uint32_t largest_body = 0;  // spheres of the largest body
};
void launch_step(const StepTask& task, cudaStream_t stream);
// Writes the poses of all bodies, for the detector.
void launch_poses(const View& view, detect::Pose* poses, cudaStream_t stream);
// Places the spheres of bodies where their bodies are.
void launch_place(const View& view, cudaStream_t stream);

}  // namespace padder::settle::cuda
