// SPDX-License-Identifier: MIT
#include "tools/settle/cuda/watch_sums.h"

#include <algorithm>

namespace padder::settle::cuda {
namespace {

constexpr int kThreads = 256;
constexpr unsigned kBlocks = 264;

__device__ void join(Watch& to, const Watch& more) {
  to.kinetic += more.kinetic, to.potential += more.potential, to.elastic += more.elastic;
  to.momentum = to.momentum + more.momentum, to.fastest = detect::larger(to.fastest, more.fastest);
  to.liveliest = detect::larger(to.liveliest, more.liveliest);
}

__device__ double energy_of(const View& v, std::uint32_t c) {
  const detect::Pair pair = v.rows.pairs[c], movers = v.rows.movers ? v.rows.movers[c] : pair;
  const detect::Sphere at = v.centers[pair.i];
  const Vec3& spring = v.rows.springs[c];
  const auto material = static_cast<std::uint32_t>(v.motions[movers.i].material);
  if (pair.j >= v.spheres) {
    const Wall& wall = v.wall[pair.j - v.spheres];
    return stored_energy(v.law, friction_with(v.law, wall, material),
                         contact_with(wall, center_of(at), at.r).depth, spring);
  }
  const detect::Sphere other = v.centers[pair.j];
  if (!detect::touching(at, other)) return 0;
  const double friction = v.law.surfaces[material][v.motions[movers.j].material].friction;
  return stored_energy(v.law, friction, detect::geometry(at, other).depth, spring);
}

__global__ void __launch_bounds__(kThreads) watch_kernel(const __grid_constant__ View v, Watch* parts) {
  alignas(Watch) __shared__ unsigned char room[kThreads * sizeof(Watch)];
  Watch* const sums = reinterpret_cast<Watch*>(room);
  const std::uint32_t first = blockIdx.x * kThreads + threadIdx.x;
  Watch w;
  for (std::uint64_t m = first; m < v.movers; m += kBlocks * kThreads) {
    const Motion& n = v.motions[m];
    const Vec3 position =
        m < v.bodies ? v.body_places[m].at : center_of(v.centers[v.body_spheres + (m - v.bodies)]);
    watch_mover(w, v.gravity, n.inverse_mass, position, n.velocity, n.spin, v.momentum[m]);
  }
  for (std::uint64_t c = first; c < v.rows.count; c += kBlocks * kThreads)
    w.elastic += energy_of(v, static_cast<std::uint32_t>(c));
  for (std::uint64_t q = first; q < v.bushings; q += kBlocks * kThreads) {
    const Bushing& u = v.bushing[q];
    Vec3 arm_a, arm_b;
    const Vec3 apart = stretch_of(u, v.body_places[u.a].at, v.body_places[u.b].at, pose_of(v, u.a).rotation,
                                  pose_of(v, u.b).rotation, arm_a, arm_b);
    w.elastic += 0.5 * u.stiffness * dot(apart, apart);
  }
  sums[threadIdx.x] = w;
  __syncthreads();
  for (int half = kThreads / 2; half; half /= 2) {
    if (threadIdx.x < half) join(sums[threadIdx.x], sums[threadIdx.x + half]);
    __syncthreads();
  }
  if (threadIdx.x == 0) parts[blockIdx.x] = sums[0];
}

}  // namespace

Watch WatchSums::watch(const View& view, cudaStream_t stream) {
  using detect::cuda::cuda_check;
  Watch* const parts = parts_.reserve(kBlocks);
  Watch* const host = host_parts_.reserve(kBlocks);
  watch_kernel<<<kBlocks, kThreads, 0, stream>>>(view, parts);
  detect::cuda::cuda_launched("sum the energies");
  cuda_check(cudaMemcpyAsync(host, parts, kBlocks * sizeof(Watch), cudaMemcpyDeviceToHost, stream), "read");
  cuda_check(cudaStreamSynchronize(stream), "sum the energies");
  Watch sum;
  for (unsigned b = 0; b < kBlocks; b++) {
    const Watch& w = host[b];
    sum.kinetic += w.kinetic, sum.potential += w.potential, sum.elastic += w.elastic;
    sum.momentum = sum.momentum + w.momentum, sum.fastest = std::max(sum.fastest, w.fastest);
    sum.liveliest = std::max(sum.liveliest, w.liveliest);
  }
  return sum;
}

}  // namespace padder::settle::cuda
