// SPDX-License-Identifier: MIT
// The caller's input on the device. Internal; only .cu files include this.
#pragma once
#include "detect/core/backend.h"
#include "detect/cuda/device/memory.h"
#include "detect/cuda/input/device_spheres.h"
#include "detect/cuda/input/host_copy.h"

namespace padder::detect::cuda {

// Copies what lies in host memory. Of bodies it copies the poses: their spheres are placed where they are
// read.
class InputCopy {
 public:
  explicit InputCopy(MemoryBook& book);
  DeviceSpheres source(const Input& input, cudaStream_t stream);

 private:
  void copy_loose(const Spheres& spheres, DeviceSpheres& source, cudaStream_t stream);
  static void take_around(const Input& input, DeviceSpheres& source);
  void copy_bodies(const Input& input, DeviceSpheres& source, cudaStream_t stream);

  HostCopy host_;
  Buffer<unsigned char> centers_, radii_, static_;
  Buffer<std::uint32_t> family_, mask_, world_, body_of_, body_first_, shape_first_;
  Buffer<Body> bodies_;
  Buffer<Pose> poses_;
  Buffer<Sphere> shapes_;
};

// All poses, which lie in the memory of GPUs. Does not wait for the stream.
void copy_poses(const Input& input, Pose* to, cudaStream_t stream);
// The same in one array on this GPU: the caller's, or a copy in `room`.
const Pose* device_poses(const Input& input, Buffer<Pose>& room, cudaStream_t stream);
Sphere sphere_at(const DeviceSpheres& source, std::uint32_t k, cudaStream_t stream);  // waits

}  // namespace padder::detect::cuda
