// SPDX-License-Identifier: GPL-3.0-or-later
// Spheres in the memory of a GPU, so that benches measure what a simulation on the GPU would see. A build
// without CUDA offers host memory only.
#pragma once
#include <algorithm>
#include <string>
#include <vector>

#include "tools/bench/bench.h"

#ifdef PADDER_CUDA
#include <cuda_runtime_api.h>
#endif
#include "padding/asset/error.h"

namespace padder::bench {

class DeviceSpheres {
 public:
  DeviceSpheres(const std::vector<detect::FloatSphere>& spheres, [[maybe_unused]] bool on_device)
      : input_(input_of(spheres)) {
#ifdef PADDER_CUDA
    if (!on_device || spheres.empty()) return;
    const std::size_t bytes = spheres.size() * sizeof(detect::FloatSphere);
    if (cudaMalloc(&memory_, bytes) != cudaSuccess ||
        cudaMemcpy(memory_, spheres.data(), bytes, cudaMemcpyHostToDevice) != cudaSuccess)
      throw Error("the spheres do not fit the GPU's memory: choose fewer");
    input_.spheres.centers = memory_, input_.spheres.radii = static_cast<const float*>(memory_) + 3;
    input_.spheres.memory = detect::Memory::device;
#endif
  }
  ~DeviceSpheres() {
#ifdef PADDER_CUDA
    cudaFree(memory_);
#endif
  }
  DeviceSpheres(const DeviceSpheres&) = delete;
  DeviceSpheres& operator=(const DeviceSpheres&) = delete;
  const detect::Input& input() const { return input_; }

 private:
  detect::Input input_;
  [[maybe_unused]] void* memory_ = nullptr;
};

// Bodies whose poses are in the memory of a GPU. Without a GPU, or when some bodies are static, the poses are
// in the bodies themselves, and each call says that the first `moving` bodies have moved. Borrows the scene.
class DeviceBodies {
 public:
  DeviceBodies(const detect::BodyScene& scene, std::uint32_t moving, [[maybe_unused]] bool on_device)
      : shape_{{scene.shape.data(), scene.shape.size()}} {
    input_.shapes = shape_, input_.bodies = scene.bodies, input_.revision = 1;
    if (moving < scene.bodies.size()) {
      for (std::uint32_t b = 0; b < moving; b++) moved_.push_back(b);
      input_.moved = moved_;
      return;
    }
#ifdef PADDER_CUDA
    if (!on_device || scene.bodies.empty()) return;
    std::vector<detect::Pose> poses(scene.bodies.size());
    for (std::size_t b = 0; b < poses.size(); b++) {
      std::copy_n(scene.bodies[b].rotation, 9, poses[b].rotation);
      std::copy_n(scene.bodies[b].position, 3, poses[b].position);
    }
    const std::size_t bytes = poses.size() * sizeof(detect::Pose);
    if (cudaMalloc(&memory_, bytes) != cudaSuccess ||
        cudaMemcpy(memory_, poses.data(), bytes, cudaMemcpyHostToDevice) != cudaSuccess)
      throw Error("the bodies do not fit the GPU's memory: choose fewer");
    input_.poses = static_cast<const detect::Pose*>(memory_), input_.pose_memory = detect::Memory::device;
#endif
  }
  ~DeviceBodies() {
#ifdef PADDER_CUDA
    cudaFree(memory_);
#endif
  }
  DeviceBodies(const DeviceBodies&) = delete;
  DeviceBodies& operator=(const DeviceBodies&) = delete;
  const detect::Input& input() const { return input_; }

 private:
  detect::Shape shape_[1];
  std::vector<std::uint32_t> moved_;
  detect::Input input_;
  [[maybe_unused]] void* memory_ = nullptr;
};

// 0 without CUDA.
inline int gpus() {
#ifdef PADDER_CUDA
  int count = 0;
  if (cudaGetDeviceCount(&count) == cudaSuccess) return count;
#endif
  return 0;
}

#ifdef PADDER_CUDA

inline void must(cudaError_t e, const char* what) {
  if (e != cudaSuccess) throw Error(std::string("CUDA failed to ") + what + ": " + cudaGetErrorString(e));
}

// Copies of the parts of a scene, each on a GPU. A part has x, y, z, r of its spheres together.
class OnGpus {
 public:
  OnGpus() = default;
  ~OnGpus() {
    for (std::size_t k = 0; k < copies_.size(); k++) cudaSetDevice(devices_[k]), cudaFree(copies_[k]);
    cudaSetDevice(0);
  }
  OnGpus(const OnGpus&) = delete;
  OnGpus& operator=(const OnGpus&) = delete;

  void add(int device, detect::Spheres part) {
    const std::size_t bytes = part.count * sizeof(detect::FloatSphere);
    must(cudaSetDevice(device), "choose a GPU");
    devices_.push_back(device);
    must(cudaMalloc(&copies_.emplace_back(nullptr), bytes + 16), "allocate the spheres");
    must(cudaMemcpy(copies_.back(), part.centers, bytes, cudaMemcpyHostToDevice), "copy the spheres");
    must(cudaDeviceSynchronize(), "copy the spheres");
    part.memory = detect::Memory::device;
    part.centers = copies_.back(), part.radii = static_cast<const float*>(copies_.back()) + 3;
    parts_.push_back(part);
    cudaSetDevice(0);
  }
  const std::vector<detect::Spheres>& parts() const { return parts_; }

 private:
  std::vector<int> devices_;
  std::vector<void*> copies_;
  std::vector<detect::Spheres> parts_;
};

#endif

inline std::string device_name() {
#ifdef PADDER_CUDA
  cudaDeviceProp p;
  if (cudaGetDeviceProperties(&p, 0) == cudaSuccess) return p.name;
#endif
  return "none";
}

}  // namespace padder::bench
