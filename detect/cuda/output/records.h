// SPDX-License-Identifier: MIT
// Small passes over input and contacts. Internal; only .cu files include this.
#pragma once
#include "detect/core/backend.h"
#include "detect/cuda/input/device_spheres.h"
#include "detect/cuda/memory.h"
#include "detect/cuda/output/output.h"

namespace padder::detect::cuda {

// The caller's input on the device: copied there if it lies in host memory; bodies go as poses, their spheres
// are placed where they are read.
class InputCopy {
 public:
  explicit InputCopy(MemoryBook& book);
  DeviceSpheres source(const Input& input, cudaStream_t stream);

 private:
  void copy_loose(const Spheres& spheres, DeviceSpheres& source, cudaStream_t stream);
  void copy_bodies(const Input& input, DeviceSpheres& source, cudaStream_t stream);

  Buffer<unsigned char> centers_, radii_, static_;
  Buffer<std::uint32_t> family_, mask_, body_of_, body_first_, shape_first_;
  Buffer<Body> bodies_;
  Buffer<Pose> poses_;
  Buffer<Sphere> shapes_;
};

Sphere sphere_at(const DeviceSpheres& source, std::uint32_t k, cudaStream_t stream);  // waits

// Normals, depths and points of pairs that are written already, in double, rounded once.
void write_geometry(const DeviceSpheres& source, const Output& output, std::uint64_t count,
                    cudaStream_t stream);

bool has_kernels();  // does this build have code for the current device?

std::uint64_t hash_of_pairs(const Pair* pairs, std::uint64_t count, Buffer<unsigned long long>& sum,
                            cudaStream_t stream);

}  // namespace padder::detect::cuda
