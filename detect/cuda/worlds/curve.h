// SPDX-License-Identifier: MIT
// Spheres along a space-filling curve (detect/core/world_tree.h), on the device. Only .cu files include this.
#pragma once
#include "detect/core/world_tree.h"
#include "detect/cuda/device/each.h"

namespace padder::detect::cuda {

// The part of space that the curve resolves, from two quantiles of some of the centres.
inline constexpr std::uint32_t kCurveSample = 256;
template <class SphereOf>
__global__ void __launch_bounds__(3 * kCurveSample)
    curve_box_kernel(std::uint32_t count, SphereOf sphere_of, CurveBox* out) {
  __shared__ double at[3][kCurveSample], low[3], high[3];
  const std::uint32_t n = min(count, kCurveSample), t = threadIdx.x, axis = threadIdx.y;
  if (t == 0) low[axis] = high[axis] = 0;
  double mine = 0;
  if (t < n) {
    const Sphere s = sphere_of(static_cast<std::uint32_t>(std::uint64_t(t) * count / n));
    mine = at[axis][t] = axis == 0 ? s.x : axis == 1 ? s.y : s.z;
  }
  __syncthreads();
  std::uint32_t less = 0;  // how many come before it
  for (std::uint32_t k = 0; k < n; k++) less += at[axis][k] < mine || (at[axis][k] == mine && k < t);
  if (t < n && less == n / 64) low[axis] = mine;
  if (t < n && less == n - 1 - n / 64) high[axis] = mine;
  __syncthreads();
  if (t > 0 || axis > 0) return;
  CurveBox box;
  for (int c = 0; c < 3; c++) set_axis(box, c, low[c], high[c]);
  *out = box;
}

// The place on the curve of each of `count` spheres, sphere_of(k). `box`: room on the device.
template <class SphereOf>
void put_on_curve(std::uint32_t count, SphereOf sphere_of, CurveBox* box, std::uint64_t* curve,
                  cudaStream_t stream) {
  curve_box_kernel<<<1, dim3(kCurveSample, 3), 0, stream>>>(count, sphere_of, box);
  cuda_launched("look where the spheres are");
  each(count, stream, "place the spheres on the curve", [=] __device__(std::uint64_t k) {
    curve[k] = place_on_curve(*box, sphere_of(static_cast<std::uint32_t>(k)));
  });
}

}  // namespace padder::detect::cuda
