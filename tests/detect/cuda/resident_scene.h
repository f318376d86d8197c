// SPDX-License-Identifier: MIT
// What the tests of spheres on several GPUs share: parts of a scene on GPUs, and what was found there.
#pragma once
#include <cuda_runtime_api.h>

#include "detect/boxes/resident_detector.h"
#include "tests/detect/boxes/boxed_scene.h"

namespace padder::detect {

inline int gpus() {
  int count = 0;
  return cudaGetDeviceCount(&count) == cudaSuccess ? count : 0;
}

inline std::vector<int> several(std::size_t n) {
  std::vector<int> devices;
  for (std::size_t k = 0; k < n; k++) devices.push_back(static_cast<int>(k) % gpus());
  return devices;
}

// An array on a GPU, freed at the end.
class OnGpu {
 public:
  OnGpu(int device, const void* from, std::size_t bytes) : device_(device) {
    EXPECT_EQ(cudaSetDevice(device), cudaSuccess);
    EXPECT_EQ(cudaMalloc(&data_, bytes + 1), cudaSuccess);
    EXPECT_EQ(cudaMemcpy(data_, from, bytes, cudaMemcpyHostToDevice), cudaSuccess);
    EXPECT_EQ(cudaDeviceSynchronize(), cudaSuccess);
  }
  OnGpu(const OnGpu&) = delete;
  ~OnGpu() { cudaSetDevice(device_), cudaFree(data_); }
  const void* data() const { return data_; }

 private:
  int device_;
  void* data_ = nullptr;
};

template <class T>
std::vector<T> from_gpu(const void* array, std::uint64_t count) {
  std::vector<T> there(count);
  const std::size_t bytes = count * sizeof(T);
  EXPECT_EQ(bytes ? cudaMemcpy(there.data(), array, bytes, cudaMemcpyDeviceToHost) : cudaSuccess,
            cudaSuccess);
  return there;
}

// The input in parts of uneven size, every other one on its GPU and the others in host memory; or all on
// their GPUs, and part k from sphere `cuts[k]` on.
class Parts {
 public:
  Parts(const Input& input, const std::vector<int>& devices, std::uint64_t seed = 1,
        const std::vector<std::uint64_t>& cuts = {}) {
    const std::uint64_t n = input.spheres.count, parts = devices.size();
    for (std::size_t k = 0; k < parts; k++) {
      const auto cut = [&](std::uint64_t p) {
        if (!cuts.empty()) return p == parts ? n : cuts[p];
        return p == parts ? n : n * p * p / (parts * parts);
      };
      Spheres s = input.spheres;
      const std::uint64_t first = cut(k), real = s.scalar == Scalar::f32 ? 4 : 8;
      s.count = cut(k + 1) - first;
      s.centers = static_cast<const char*>(s.centers) + first * s.center_stride * real;
      s.radii = static_cast<const char*>(s.radii) + first * s.radius_stride * real;
      if (s.family) s.family += first;
      if (s.mask) s.mask += first;
      if (s.is_static) s.is_static += first;
      if (((k + seed) % 2 || !cuts.empty()) && s.count) {
        const bool together = s.center_stride == 4;
        const std::uint64_t strides = s.center_stride;
        const char* const all =
            static_cast<const char*>(keep(devices[k], s.centers, s.count * strides * real));
        s.radii = together ? all + 3 * real : keep(devices[k], s.radii, s.count * real);
        s.centers = all, s.memory = Memory::device;
        if (s.family) s.family = static_cast<const std::uint32_t*>(keep(devices[k], s.family, 4 * s.count));
        if (s.mask) s.mask = static_cast<const std::uint32_t*>(keep(devices[k], s.mask, 4 * s.count));
        if (s.is_static)
          s.is_static = static_cast<const std::uint8_t*>(keep(devices[k], s.is_static, s.count));
      }
      spheres.push_back(s);
    }
  }
  std::vector<Spheres> spheres;

 private:
  const void* keep(int device, const void* from, std::size_t bytes) {
    kept_.push_back(std::make_unique<OnGpu>(device, from, bytes));
    return kept_.back()->data();
  }
  std::vector<std::unique_ptr<OnGpu>> kept_;
};

inline ResidentOptions on(const std::vector<int>& devices) {
  ResidentOptions o;
  o.detector.width = Width::points, o.detector.scalar = Scalar::f64;
  o.devices = devices;
  return o;
}

inline Records records_of(const ResidentDetector& detector) {
  Records records;
  for (const ResidentContacts& f : detector.found()) {
    const auto pairs = from_gpu<Pair>(f.contacts.pairs, f.contacts.count);
    const auto normals = from_gpu<Normal<double>>(f.contacts.normals, f.contacts.count);
    const auto points = from_gpu<Points<double>>(f.contacts.points, f.contacts.count);
    const auto others = from_gpu<std::uint64_t>(f.numbers.others, f.others.count);
    ResidentNumbers numbers = f.numbers;
    numbers.others = others.data();
    for (std::size_t k = 0; k < pairs.size(); k++)
      records.add(numbers.of(pairs[k].i), numbers.of(pairs[k].j), normals[k], points[k]);
  }
  return records;
}

// Bodies of shapes from one sphere to a few hundred, one of them across all boxes and static, at poses that
// change from step to step; families; loose spheres beside them.
struct MovingBodies : TestBodies {
  TestScene grains;
  std::vector<Pose> poses;
  std::mt19937_64 random;

  MovingBodies(std::uint32_t seed, std::uint32_t loose_count)
      : grains(random_scene(std::max(loose_count, 1u), 3, 1, seed).rounded()), random(seed) {
    std::printf("seed %u\n", seed);
    grains.spheres.resize(loose_count), assets.resize(4);
    for (int k = 0; k < 40; k++) assets[0].push_back({unit(), unit(), unit(), 0.3 + 0.1 * unit()});
    assets[1] = {assets[0][0]};
    for (int x = -20; x < 20; x++)
      for (int y = -20; y < 20; y++) assets[2].push_back({1. * x, 1. * y, 0.1 * unit(), 0.8});
    bodies.resize(600), poses.resize(bodies.size());
    for (std::size_t k = 0; k < bodies.size(); k++) {
      bodies[k].shape = k < 2 ? 2 : k % 50 == 7 ? 3 : k % 3 == 1, bodies[k].is_static = k % 20 == 0;
      bodies[k].family = static_cast<std::uint32_t>(k % 4), bodies[k].mask = k % 5 == 0 ? 2 : 0;
      for (double& p : poses[k].position) p = k == 0 ? 0 : 9 * unit();
    }
    turn(1);
    for (std::size_t k = 0; k < bodies.size(); k++) set_pose(bodies[k], poses[k]);
  }
  double unit() { return signed_unit(random); }
  void turn(double by) {
    for (std::size_t k = 0; k < bodies.size(); k++) {
      rotation_of(1, unit(), unit(), unit(), poses[k].rotation);
      for (double& p : poses[k].position) p = 0.98 * p + by * 0.3 * unit();
    }
  }
  Input input() const {
    Input i = TestBodies::input();
    i.revision = 7;
    return i;
  }
};

// The poses in parts of uneven size, each on its GPU.
struct PoseParts {
  std::vector<std::unique_ptr<OnGpu>> kept;
  std::vector<ResidentPoses> parts;
  PoseParts(const std::vector<Pose>& poses, const std::vector<int>& devices) {
    const std::size_t n = devices.size();
    for (std::size_t k = 0, first = 0; k < n; k++) {
      const std::size_t end = poses.size() * (k + 1) * (k + 1) / (n * n);
      kept.push_back(std::make_unique<OnGpu>(devices[k], poses.data() + first, (end - first) * sizeof(Pose)));
      parts.push_back({static_cast<const Pose*>(kept[k]->data()), end - first});
      first = end;
    }
  }
};

}  // namespace padder::detect
