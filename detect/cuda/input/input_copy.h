// SPDX-License-Identifier: MIT
// The caller's input on the device. Internal; only .cu files include this.
#pragma once
#include "detect/core/backend.h"
#include "detect/cuda/device/memory.h"
#include "detect/cuda/input/device_spheres.h"
#include "detect/cuda/input/host_copy.h"
#include "detect/cuda/input/posed_bodies.h"

namespace padder::detect::cuda {

// Copies what lies in host memory. The spheres of bodies are placed where they are read. Bodies are kept from
// call to call: of a known revision only poses are copied.
class InputCopy {
 public:
  InputCopy(MemoryBook& book, PosedBodies& posed);
  DeviceSpheres source(const Input& input, cudaStream_t stream);
  bool knows(const Input& input) const {  // by its revision
    return input.revision != 0 && input.revision == revision_ && input.bodies.size() == known_bodies_;
  }
  // A call went another way: what moved in it was not seen.
  void forget() { revision_ = 0; }

 private:
  void copy_loose(const Spheres& spheres, DeviceSpheres& source, cudaStream_t stream);
  static void take_around(const Input& input, DeviceSpheres& source);
  // `first`: the first sphere of each body and the number of all, if the bodies are not known.
  void copy_bodies(const Input& input, const std::vector<std::uint32_t>& first, DeviceSpheres& source,
                   cudaStream_t stream);
  void copy_shapes(const Input& input, const std::vector<std::uint32_t>& first, cudaStream_t stream);

  HostCopy host_;
  Buffer<unsigned char> centers_, radii_, static_;
  Buffer<std::uint32_t> family_, mask_, world_, body_of_, body_first_, shape_first_;
  PosedBodies& posed_;
  Buffer<Sphere> shapes_;
  std::uint64_t revision_ = 0, known_bodies_ = 0;
  std::uint32_t known_placed_ = 0;
};

Sphere sphere_at(const DeviceSpheres& source, std::uint32_t k, cudaStream_t stream);  // waits

}  // namespace padder::detect::cuda
