// SPDX-License-Identifier: MIT
#include "detect/cuda/boxes/sphere_arrays.h"

#include <algorithm>
#include <utility>

#include "detect/cuda/device/blocks.h"

namespace padder::detect::cuda {

namespace {

constexpr int kThreads = 256;

// Calls copy(to, from, bytes) for each array that there is.
template <class Copy>
void each_array(const DealTarget& to, const DealTarget& from, std::uint64_t count, Scalar scalar,
                const Copy& copy) {
  const auto there = arrays_of(to, scalar), here = arrays_of(from, scalar);
  for (std::size_t k = 0; count && k < there.size(); k++)
    if (there[k].at)
      cuda_check(copy(there[k].at, here[k].at, count * there[k].bytes_of_one),
                 "bring spheres to another GPU");
}

struct Coming {
  ComingSpheres run[kMostComing];
};

// `all`: spheres of all runs together. Words: of 16 bytes, that x, y, z and r take.
template <int Words>
__global__ void __launch_bounds__(kThreads)
    read_kernel(DealTarget to, const __grid_constant__ Coming coming, std::uint64_t all) {
  std::uint64_t k = std::uint64_t(blockIdx.x) * kThreads + threadIdx.x;
  if (k >= all) return;
  int r = 0;
  while (k >= coming.run[r].count) k -= coming.run[r++].count;
  const DealTarget& from = coming.run[r].from;
  const std::uint64_t at = coming.run[r].place + k;
#pragma unroll
  for (int w = 0; w < Words; w++)
    static_cast<uint4*>(to.spheres)[Words * at + w] = static_cast<const uint4*>(from.spheres)[Words * k + w];
  if (to.ids) to.ids[at] = from.ids[k];
  if (to.family) to.family[at] = from.family[k];
  if (to.mask) to.mask[at] = from.mask[k];
  if (to.world) to.world[at] = from.world[k];
  if (to.is_static) to.is_static[at] = from.is_static[k];
}

}  // namespace

void read_spheres(const DealTarget& to, std::span<const ComingSpheres> coming, Scalar scalar,
                  cudaStream_t stream) {
  Coming runs;
  std::copy(coming.begin(), coming.end(), runs.run);
  std::uint64_t all = 0;
  for (const ComingSpheres& c : coming) all += c.count;
  if (all == 0) return;
  (scalar == Scalar::f32 ? read_kernel<1>
                         : read_kernel<2>)<<<blocks_for(all, kThreads), kThreads, 0, stream>>>(to, runs, all);
  cuda_launched("bring spheres to another GPU");
}

void copy_spheres(const DealTarget& to, const DealTarget& from, std::uint64_t count, Scalar scalar,
                  cudaStream_t stream) {
  each_array(to, from, count, scalar, [&](char* there, const char* here, std::uint64_t bytes) {
    return cudaMemcpyAsync(there, here, bytes, cudaMemcpyDefault, stream);
  });
}

void copy_to_peer(const DealTarget& to, int to_device, const DealTarget& from, int from_device,
                  std::uint64_t count, Scalar scalar, cudaStream_t stream) {
  each_array(to, from, count, scalar, [&](char* there, const char* here, std::uint64_t bytes) {
    return cudaMemcpyPeerAsync(there, to_device, here, from_device, bytes, stream);
  });
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
                      at_mask = place(s.mask ? 4 * s.count : 0), at_world = place(s.world ? 4 * s.count : 0),
                      at_static = place(s.is_static ? s.count : 0);
  char* const to = bytes_.reserve(size);
  const auto copy = [&](std::uint64_t at, const void* from, std::uint64_t bytes) {
    if (from) host_.run(to + at, from, bytes, "copy spheres to the GPU", stream);
  };
  copy(at_centers, c, together ? centers + real : centers);
  if (!together) copy(at_radii, r, radii);
  copy(at_family, s.family, 4 * s.count), copy(at_mask, s.mask, 4 * s.count),
      copy(at_world, s.world, 4 * s.count), copy(at_static, s.is_static, s.count);
  Spheres there = s;
  there.memory = Memory::device, there.centers = to + at_centers, there.radii = to + at_radii;
  if (s.family) there.family = reinterpret_cast<const std::uint32_t*>(to + at_family);
  if (s.mask) there.mask = reinterpret_cast<const std::uint32_t*>(to + at_mask);
  if (s.world) there.world = reinterpret_cast<const std::uint32_t*>(to + at_world);
  if (s.is_static) there.is_static = reinterpret_cast<const std::uint8_t*>(to + at_static);
  return there;
}

bool let_access(int device, int other) {
  int can = 0;
  if (device == other) return true;
  if (cudaDeviceCanAccessPeer(&can, device, other) != cudaSuccess || !can) return false;
  const cudaError_t e = cudaDeviceEnablePeerAccess(other, 0);
  cudaGetLastError();
  return e == cudaSuccess || e == cudaErrorPeerAccessAlreadyEnabled;  // perhaps by the caller
}

}  // namespace padder::detect::cuda
