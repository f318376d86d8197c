// SPDX-License-Identifier: MIT
#include "detect/cuda/input/input_copy.h"

#include <algorithm>
#include <vector>

#include "detect/cuda/device/blocks.h"

namespace padder::detect::cuda {
namespace {

__global__ void body_of_kernel(std::uint32_t bodies, const std::uint32_t* first, std::uint32_t* body_of) {
  for (std::uint32_t b = blockIdx.x; b < bodies; b += gridDim.x)
    for (std::uint32_t k = first[b] + threadIdx.x; k < first[b + 1]; k += blockDim.x) body_of[k] = b;
}

__global__ void sphere_kernel(DeviceSpheres source, std::uint32_t k, Sphere* out) { *out = source.sphere(k); }

// The first sphere of each body, and behind them the number of all.
std::vector<std::uint32_t> first_spheres(const Input& input) {
  std::vector<std::uint32_t> first{0};
  first.reserve(input.bodies.size() + 1);
  for (const Body& b : input.bodies)
    first.push_back(first.back() + static_cast<std::uint32_t>(input.shapes[b.shape].count));
  return first;
}

}  // namespace

InputCopy::InputCopy(MemoryBook& book, PosedBodies& posed)
    : centers_(book, "the spheres"),
      radii_(book, "the spheres"),
      static_(book, "what is static"),
      family_(book, "families"),
      mask_(book, "masks"),
      world_(book, "worlds"),
      body_of_(book, "the bodies"),
      body_first_(book, "the bodies"),
      shape_first_(book, "the shapes"),
      posed_(posed),
      shapes_(book, "the shapes") {}

DeviceSpheres InputCopy::source(const Input& input, cudaStream_t stream) {
  DeviceSpheres s;
  const auto loose = static_cast<std::uint32_t>(loose_count(input));
  const bool known = knows(input);
  std::vector<std::uint32_t> first;
  if (!known) first = first_spheres(input);
  s.placed = known ? known_placed_ : first.back();
  s.count = s.placed + loose;
  if (input.spheres.count) copy_loose(input.spheres, s, stream);
  if (input.around) take_around(input, s);
  if (s.placed)
    copy_bodies(input, first, s, stream);
  else
    forget();
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
  s.around = {others.centers, others.family, others.mask, others.world, others.is_static};
  s.before = static_cast<std::uint32_t>(input.around->before);
  s.own = static_cast<std::uint32_t>(input.spheres.count);
}

void InputCopy::copy_bodies(const Input& input, const std::vector<std::uint32_t>& first, DeviceSpheres& s,
                            cudaStream_t stream) {
  const bool known = knows(input);
  revision_ = 0;  // set when everything is enqueued
  if (known) {
    posed_.move(input, stream);
  } else {
    posed_.read(input, stream);
    copy_shapes(input, first, stream);
  }
  s.bodies = posed_.bodies(), s.body_of = body_of_.data(), s.body_first = body_first_.data(),
  s.shape_spheres = shapes_.data(), s.shape_first = shape_first_.data();
  revision_ = input.revision, known_bodies_ = input.bodies.size(), known_placed_ = s.placed;
}

// The spheres of the shapes, and to which body each placed sphere belongs. Waits for the device.
void InputCopy::copy_shapes(const Input& input, const std::vector<std::uint32_t>& first,
                            cudaStream_t stream) {
  std::vector<std::uint32_t> shape_first;
  std::uint64_t shape_spheres = 0;
  for (const Shape& shape : input.shapes) {
    shape_first.push_back(static_cast<std::uint32_t>(shape_spheres));
    shape_spheres += shape.count;
  }
  Sphere* shapes = shapes_.reserve(shape_spheres);
  std::uint32_t *body_of = body_of_.reserve(first.back()), *body_first = body_first_.reserve(first.size()),
                *shapes_first = shape_first_.reserve(shape_first.size());
  const auto copy = [&](void* to, const void* from, std::uint64_t bytes) {
    host_.run(to, from, bytes, "copy the shapes", stream);
  };
  for (std::size_t k = 0; k < input.shapes.size(); k++)
    copy(shapes + shape_first[k], input.shapes[k].spheres, input.shapes[k].count * sizeof(Sphere));
  copy(body_first, first.data(), first.size() * 4),
      copy(shapes_first, shape_first.data(), shape_first.size() * 4);
  const auto n = static_cast<std::uint32_t>(input.bodies.size());
  body_of_kernel<<<std::min(n, 8192u), 64, 0, stream>>>(n, body_first, body_of);
  cuda_launched("number the bodies' spheres");
  // The vectors must outlive their copies.
  cuda_check(cudaStreamSynchronize(stream), "copy the shapes");
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
