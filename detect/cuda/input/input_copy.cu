// SPDX-License-Identifier: MIT
#include "detect/cuda/input/input_copy.h"

#include <algorithm>
#include <vector>

#include "detect/cuda/device/blocks.h"

namespace padder::detect::cuda {
namespace {

constexpr int kThreads = 256;

__global__ void body_of_kernel(std::uint32_t bodies, const std::uint32_t* first, std::uint32_t* body_of) {
  for (std::uint32_t b = blockIdx.x; b < bodies; b += gridDim.x)
    for (std::uint32_t k = first[b] + threadIdx.x; k < first[b + 1]; k += blockDim.x) body_of[k] = b;
}

// `moving`: only of bodies that may move; the others are where they were put.
__global__ void pose_kernel(std::uint32_t bodies, const Pose* poses, Body* out, bool moving) {
  for (std::uint32_t b = blockIdx.x * blockDim.x + threadIdx.x; b < bodies; b += gridDim.x * blockDim.x) {
    if (moving && out[b].is_static) continue;
    for (int k = 0; k < 9; k++) out[b].rotation[k] = poses[b].rotation[k];
    for (int k = 0; k < 3; k++) out[b].position[k] = poses[b].position[k];
  }
}

__global__ void sphere_kernel(DeviceSpheres source, std::uint32_t k, Sphere* out) { *out = source.sphere(k); }

}  // namespace

InputCopy::InputCopy(MemoryBook& book)
    : centers_(book, "the spheres"),
      radii_(book, "the spheres"),
      static_(book, "what is static"),
      family_(book, "families"),
      mask_(book, "masks"),
      world_(book, "worlds"),
      body_of_(book, "the bodies"),
      body_first_(book, "the bodies"),
      shape_first_(book, "the shapes"),
      bodies_(book, "the bodies"),
      poses_(book, "the poses"),
      shapes_(book, "the shapes") {}

DeviceSpheres InputCopy::source(const Input& input, cudaStream_t stream) {
  DeviceSpheres s;
  s.count = static_cast<std::uint32_t>(sphere_count(input));
  s.placed = s.count - static_cast<std::uint32_t>(loose_count(input));
  if (input.spheres.count) copy_loose(input.spheres, s, stream);
  if (input.around) take_around(input, s);
  if (s.placed) copy_bodies(input, s, stream);
  s.filtered =
      s.family || s.mask || s.is_static || s.placed || s.around.family || s.around.mask || s.around.is_static;
  return s;
}

void InputCopy::copy_loose(const Spheres& spheres, DeviceSpheres& s, cudaStream_t stream) {
  const std::uint64_t n = spheres.count, scalar = spheres.scalar == Scalar::f32 ? 4 : 8;
  const std::uint64_t center_bytes = ((n - 1) * spheres.center_stride + 3) * scalar,
                      radius_bytes = ((n - 1) * spheres.radius_stride + 1) * scalar;
  s.center_stride = spheres.center_stride, s.radius_stride = spheres.radius_stride;
  s.wide = spheres.scalar == Scalar::f64;
  s.centers = spheres.centers, s.radii = spheres.radii, s.family = spheres.family, s.mask = spheres.mask;
  s.is_static = spheres.is_static, s.world = spheres.world, s.world_of_all = spheres.world_of_all;
  // x, y, z, r in one array, strides 4: often, and best read and copied as one.
  const auto* c = static_cast<const unsigned char*>(spheres.centers);
  const bool woven =
      spheres.center_stride == 4 && spheres.radius_stride == 4 && spheres.radii == c + 3 * scalar;
  if (spheres.memory == Memory::host) {
    const auto copy = [&](auto& buffer, const void* from, std::uint64_t bytes) {
      auto* to = buffer.reserve(bytes / sizeof(*buffer.data()) + 1);
      host_.run(to, from, bytes, "copy the spheres", stream);
      return to;
    };
    unsigned char* to = copy(centers_, spheres.centers, woven ? n * 4 * scalar : center_bytes);
    s.centers = to;
    s.radii = woven ? to + 3 * scalar : copy(radii_, spheres.radii, radius_bytes);
    if (spheres.family) s.family = copy(family_, spheres.family, n * 4);
    if (spheres.mask) s.mask = copy(mask_, spheres.mask, n * 4);
    if (spheres.world) s.world = copy(world_, spheres.world, n * 4);
    if (spheres.is_static) s.is_static = copy(static_, spheres.is_static, n);
  }
  s.packed = woven && reinterpret_cast<std::uintptr_t>(s.centers) % 16 == 0;
}

void InputCopy::take_around(const Input& input, DeviceSpheres& s) {
  const Spheres& others = input.around->spheres;
  s.around = {others.centers, others.family, others.mask, others.is_static};
  s.before = static_cast<std::uint32_t>(input.around->before);
  s.own = static_cast<std::uint32_t>(input.spheres.count);
  if (s.own == 0) s.wide = others.scalar == Scalar::f64, s.packed = true;
}

void InputCopy::copy_bodies(const Input& input, DeviceSpheres& s, cudaStream_t stream) {
  std::vector<std::uint32_t> first, shape_first;
  std::uint64_t spheres = 0, shape_spheres = 0;
  for (const Body& b : input.bodies) {
    first.push_back(static_cast<std::uint32_t>(spheres));
    spheres += input.shapes[b.shape].count;
  }
  first.push_back(static_cast<std::uint32_t>(spheres));
  for (const Shape& shape : input.shapes) {
    shape_first.push_back(static_cast<std::uint32_t>(shape_spheres));
    shape_spheres += shape.count;
  }
  Sphere* shapes = shapes_.reserve(shape_spheres);
  Body* bodies = bodies_.reserve(input.bodies.size());
  std::uint32_t *body_of = body_of_.reserve(spheres), *body_first = body_first_.reserve(first.size()),
                *shapes_first = shape_first_.reserve(shape_first.size());
  const auto copy = [&](void* to, const void* from, std::uint64_t bytes) {
    host_.run(to, from, bytes, "copy the bodies", stream);
  };
  for (std::size_t k = 0; k < input.shapes.size(); k++)
    copy(shapes + shape_first[k], input.shapes[k].spheres, input.shapes[k].count * sizeof(Sphere));
  copy(bodies, input.bodies.data(), input.bodies.size() * sizeof(Body));
  copy(body_first, first.data(), first.size() * 4),
      copy(shapes_first, shape_first.data(), shape_first.size() * 4);
  const auto n = static_cast<std::uint32_t>(input.bodies.size());
  if (input.poses || input.poses_around) {
    if (!has_device_poses(input)) copy(poses_.reserve(n), input.poses, n * sizeof(Pose));
    const Pose* poses = has_device_poses(input) ? device_poses(input, poses_, stream) : poses_.data();
    pose_kernel<<<blocks_of_loop(n, kThreads), kThreads, 0, stream>>>(n, poses, bodies, input.revision != 0);
  }
  body_of_kernel<<<std::min(n, 8192u), 64, 0, stream>>>(n, body_first, body_of);
  cuda_launched("number the bodies' spheres");
  // The vectors above must outlive their copies.
  cuda_check(cudaStreamSynchronize(stream), "copy the bodies");
  s.bodies = bodies, s.body_of = body_of, s.body_first = body_first, s.shape_spheres = shapes,
  s.shape_first = shapes_first;
}

void copy_poses(const Input& input, Pose* to, cudaStream_t stream) {
  const auto copy = [&](const Pose* from, std::uint64_t first, std::uint64_t count) {
    if (count)
      cuda_check(cudaMemcpyAsync(to + first, from, count * sizeof(Pose), cudaMemcpyDefault, stream),
                 "read the poses");
  };
  if (!input.poses_around) return copy(input.poses, 0, input.bodies.size());
  for (const PosePart& p : input.poses_around->parts)
    copy(reinterpret_cast<const Pose*>(p.poses), p.first, p.count);
}

const Pose* device_poses(const Input& input, Buffer<Pose>& room, cudaStream_t stream) {
  if (!input.poses_around) return input.poses;
  copy_poses(input, room.reserve(input.bodies.size()), stream);
  return room.data();
}

Sphere sphere_at(const DeviceSpheres& source, std::uint32_t k, cudaStream_t stream) {
  Sphere* device = nullptr;
  Sphere s;
  cuda_check(cudaMalloc(&device, sizeof s), "allocate memory");
  sphere_kernel<<<1, 1, 0, stream>>>(source, k, device);
  const cudaError_t e = cudaMemcpyAsync(&s, device, sizeof s, cudaMemcpyDeviceToHost, stream);
  cudaStreamSynchronize(stream);
  cudaFree(device);
  cuda_check(e, "read a sphere");
  return s;
}

}  // namespace padder::detect::cuda
