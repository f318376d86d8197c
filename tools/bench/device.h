// SPDX-License-Identifier: GPL-3.0-or-later
// Spheres in the memory of a GPU, so that benches measure what a simulation on the GPU would see. A build
// without CUDA offers host memory only.
#pragma once
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "tools/bench/bench.h"

#ifdef PADDER_CUDA
#include <cuda_runtime_api.h>
#endif
#include "padding/asset/error.h"

namespace padder::bench {

#ifdef PADDER_CUDA
inline constexpr bool kWithCuda = true;
#else
inline constexpr bool kWithCuda = false;
#endif

// Contacts stay where the backend has them.
inline detect::CallOptions options_of(const Settings& s, detect::BackendKind backend) {
  detect::CallOptions o;
  o.threads = s.threads;
  if (backend == detect::BackendKind::cuda) o.output = detect::Memory::device;
  return o;
}

// An array in the memory of a GPU.
class DeviceArray {
 public:
  DeviceArray() = default;
  ~DeviceArray() {
#ifdef PADDER_CUDA
    cudaFree(memory_);
#endif
  }
  DeviceArray(const DeviceArray&) = delete;
  DeviceArray& operator=(const DeviceArray&) = delete;

  // A copy of an array in host memory. Throws Error if `what` do not fit.
  const void* copy([[maybe_unused]] const void* from, [[maybe_unused]] std::size_t bytes, const char* what) {
#ifdef PADDER_CUDA
    if (cudaMalloc(&memory_, bytes + 1) == cudaSuccess &&
        cudaMemcpy(memory_, from, bytes, cudaMemcpyHostToDevice) == cudaSuccess)
      return memory_;
#endif
    throw Error(std::string(what) + " do not fit the GPU's memory: choose fewer");
  }
  // The poses of bodies.
  const detect::Pose* copy(std::span<const detect::Body> bodies, const char* what) {
    std::vector<detect::Pose> poses;
    for (const detect::Body& b : bodies) poses.push_back(pose_of(b));
    return static_cast<const detect::Pose*>(copy(poses.data(), poses.size() * sizeof(detect::Pose), what));
  }

 private:
  [[maybe_unused]] void* memory_ = nullptr;
};

class DeviceSpheres {
 public:
  DeviceSpheres(const std::vector<detect::FloatSphere>& spheres, bool on_device) : input_(input_of(spheres)) {
    if (!kWithCuda || !on_device || spheres.empty()) return;
    detect::Spheres& s = input_.spheres;
    s.centers = memory_.copy(spheres.data(), spheres.size() * sizeof(detect::FloatSphere), "the spheres");
    s.radii = static_cast<const float*>(s.centers) + 3, s.memory = detect::Memory::device;
  }
  const detect::Input& input() const { return input_; }

 private:
  detect::Input input_;
  DeviceArray memory_;
};

// Bodies whose poses are in the memory of a GPU. Without a GPU, or when some bodies are static, the poses are
// in the bodies themselves, and each call says that the first `moving` bodies have moved. Borrows all.
class DeviceBodies {
 public:
  DeviceBodies(std::span<const std::vector<detect::Sphere>> shapes, std::span<const detect::Body> bodies,
               std::uint32_t moving, bool on_device) {
    for (const std::vector<detect::Sphere>& s : shapes) shapes_.push_back({s.data(), s.size()});
    input_.shapes = shapes_, input_.bodies = bodies, input_.revision = 1;
    if (moving < bodies.size()) {
      for (std::uint32_t b = 0; b < moving; b++) moved_.push_back(b);
      input_.moved = moved_;
      return;
    }
    if (!kWithCuda || !on_device || bodies.empty()) return;
    input_.poses = memory_.copy(bodies, "the bodies"), input_.pose_memory = detect::Memory::device;
  }
  DeviceBodies(const detect::BodyScene& scene, std::uint32_t moving, bool on_device)
      : DeviceBodies({&scene.shape, 1}, scene.bodies, moving, on_device) {}
  const detect::Input& input() const { return input_; }

 private:
  std::vector<detect::Shape> shapes_;
  std::vector<std::uint32_t> moved_;
  detect::Input input_;
  DeviceArray memory_;
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
    for (const Copy& c : copies_) cudaSetDevice(c.device), cudaFree(c.memory);
    cudaSetDevice(0);
  }
  OnGpus(const OnGpus&) = delete;
  OnGpus& operator=(const OnGpus&) = delete;

  void add(int device, const detect::Spheres& part) {
    copies_.push_back({device});
    parts_.emplace_back();
    put(copies_.size() - 1, part);
  }
  // The part in the place of the k-th before. Memory is kept, as in a simulation.
  void put(std::size_t k, const detect::Spheres& part) {
    Copy& c = copies_[k];
    const std::size_t bytes = part.count * sizeof(detect::FloatSphere);
    must(cudaSetDevice(c.device), "choose a GPU");
    if (bytes > c.bytes || !c.memory) {
      const std::size_t room = c.memory ? bytes + bytes / 4 : bytes + 16;
      cudaFree(std::exchange(c.memory, nullptr));
      must(cudaMalloc(&c.memory, room), "allocate the spheres");
      c.bytes = room;
    }
    must(cudaMemcpy(c.memory, part.centers, bytes, cudaMemcpyHostToDevice), "copy the spheres");
    must(cudaDeviceSynchronize(), "copy the spheres");
    detect::Spheres& there = parts_[k] = part;
    there.memory = detect::Memory::device;
    there.centers = c.memory, there.radii = static_cast<const float*>(c.memory) + 3;
    cudaSetDevice(0);
  }
  const std::vector<detect::Spheres>& parts() const { return parts_; }

 private:
  struct Copy {
    int device;
    void* memory = nullptr;
    std::size_t bytes = 0;
  };
  std::vector<Copy> copies_;
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
