// SPDX-License-Identifier: MIT
#include "detect/cuda/boxes/sphere_arrays.h"

#include <utility>

namespace padder::detect::cuda {

void copy_to_peer(const DealTarget& to, int to_device, const DealTarget& from, int from_device,
                  std::uint64_t count, Scalar scalar, cudaStream_t stream) {
  const auto copy = [&](void* there, const void* here, std::uint64_t each) {
    if (there && count)
      cuda_check(cudaMemcpyPeerAsync(there, to_device, here, from_device, count * each, stream),
                 "copy spheres to another GPU");
  };
  copy(to.spheres, from.spheres, scalar == Scalar::f32 ? 16 : 32), copy(to.ids, from.ids, 8);
  copy(to.family, from.family, 4), copy(to.mask, from.mask, 4), copy(to.is_static, from.is_static, 1);
}

Spheres Upload::run(const Spheres& s, cudaStream_t stream) {
  if (s.memory == Memory::device || s.count == 0) return s;
  const std::uint64_t real = s.scalar == Scalar::f32 ? 4 : 8;
  const std::uint64_t centers = ((s.count - 1) * s.center_stride + 3) * real,
                      radii = ((s.count - 1) * s.radius_stride + 1) * real;
  const char *const c = static_cast<const char*>(s.centers), *const r = static_cast<const char*>(s.radii);
  const bool together = s.center_stride == 4 && s.radius_stride == 4 && r == c + 3 * real;
  std::uint64_t size = 0;
  const auto place = [&](std::uint64_t bytes) {
    return std::exchange(size, size + (bytes + 255) / 256 * 256);
  };
  const std::uint64_t at_centers = place(together ? centers + real : centers),
                      at_radii = together ? at_centers + 3 * real : place(radii),
                      at_family = place(s.family ? 4 * s.count : 0),
                      at_mask = place(s.mask ? 4 * s.count : 0), at_static = place(s.is_static ? s.count : 0);
  char* const to = bytes_.reserve(size);
  const auto copy = [&](std::uint64_t at, const void* from, std::uint64_t bytes) {
    if (from) host_.run(to + at, from, bytes, "copy spheres to the GPU", stream);
  };
  copy(at_centers, c, together ? centers + real : centers);
  if (!together) copy(at_radii, r, radii);
  copy(at_family, s.family, 4 * s.count), copy(at_mask, s.mask, 4 * s.count),
      copy(at_static, s.is_static, s.count);
  Spheres there = s;
  there.memory = Memory::device, there.centers = to + at_centers, there.radii = to + at_radii;
  if (s.family) there.family = reinterpret_cast<const std::uint32_t*>(to + at_family);
  if (s.mask) there.mask = reinterpret_cast<const std::uint32_t*>(to + at_mask);
  if (s.is_static) there.is_static = reinterpret_cast<const std::uint8_t*>(to + at_static);
  return there;
}

void let_access(int device, int other) {
  int can = 0;
  if (device == other || cudaDeviceCanAccessPeer(&can, device, other) != cudaSuccess || !can) return;
  cudaDeviceEnablePeerAccess(other, 0);
  cudaGetLastError();  // already enabled, perhaps by the caller
}

}  // namespace padder::detect::cuda
