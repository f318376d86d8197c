// SPDX-License-Identifier: MIT
// The sums over contacts have a fixed order: that of the partners' numbers, among contacts that touch. So the
// bits depend on the state alone, and not on the candidates.
#include <algorithm>

#include "detect/body.h"
#include "detect/cuda/device/memory.h"
#include "tools/settle/cuda/step_kernels.h"

namespace padder::settle::cuda {
namespace {

using Word = unsigned long long;

constexpr int kThreads = 128;
constexpr std::uint32_t kAhead = 3;  // pushes that a thread reads at once

__device__ double of_bits(Word bits) { return __longlong_as_double(static_cast<long long>(bits)); }

// The larger of two numbers from 0 on. Most callers find a larger one there and write nothing.
__device__ void raise(Word& to, double value) {
  const auto bits = static_cast<Word>(__double_as_longlong(value));
  if (bits > *static_cast<volatile Word*>(&to)) atomicMax(&to, bits);
}
// The largest value of the block, in thread 0. All threads call it.
__device__ double largest_of_block(double value) {
  __shared__ double of_warp[32];
  for (int d = 16; d; d >>= 1) value = detect::larger(value, __shfl_xor_sync(~0u, value, d));
  __syncthreads();
  if (threadIdx.x % 32 == 0) of_warp[threadIdx.x / 32] = value;
  __syncthreads();
  for (unsigned w = 0; threadIdx.x == 0 && w < blockDim.x / 32; w++)
    value = detect::larger(value, of_warp[w]);
  return value;
}

__device__ bool before_failed(const Record& before, double limit) {
  if (before.stopped || before.wild != ~0u || of_bits(before.ratio) > 1) return true;
  return limit > 0 && !(::sqrt(of_bits(before.moved)) < limit);
}

// Was this step given up, before or by its pushes?
__device__ bool given_up(const Record& r) { return r.stopped || of_bits(r.ratio) > 1; }

struct Tally {
  std::uint32_t contacts = 0;
  double deepest = 0, ratio = 0;
  __device__ void add(double depth, double radius) {
    deepest = detect::larger(deepest, depth), ratio = detect::larger(ratio, depth / radius);
  }
};
__device__ void tell(Record& r, const Tally& mine) {
  const int contacts = __syncthreads_or(mine.contacts) ? 1 : 0;
  if (!contacts) return;
  std::uint32_t count = __reduce_add_sync(~0u, mine.contacts);
  __shared__ std::uint32_t sum;
  if (threadIdx.x == 0) sum = 0;
  __syncthreads();
  if (threadIdx.x % 32 == 0) atomicAdd(&sum, count);
  const double deepest = largest_of_block(mine.deepest), ratio = largest_of_block(mine.ratio);
  if (threadIdx.x > 0) return;
  atomicAdd(&r.contacts[blockIdx.x % 32], Word(sum));
  raise(r.deepest, deepest), raise(r.ratio, ratio);
}

// A thread for each candidate: its force, if they touch.
__global__ void __launch_bounds__(kThreads) push_kernel(const __grid_constant__ StepTask t) {
  const View& v = t.view;
  Record& record = t.records[1];
  if (before_failed(t.records[0], t.limit)) {
    if (blockIdx.x == 0 && threadIdx.x == 0) record.stopped = 1;
    return;
  }
  Tally tally;
  const std::uint32_t c = blockIdx.x * kThreads + threadIdx.x;
  if (c < v.rows.count) {
    const detect::Pair pair = v.rows.pairs[c];
    const detect::Sphere at = v.centers[pair.i];
    const MoverState mine = state_of(v, pair.i, at);
    Vec3 spring = v.rows.springs[c];
    Contact contact;
    bool touches = false;
    if (pair.j >= v.spheres) {
      const Wall& wall = v.wall[pair.j - v.spheres];
      const WallContact w = contact_with(wall, center_of(at), at.r);
      touches = w.depth >= 0;
      if (touches) contact = push_wall(v.law, v.step, at, wall, w, mine, spring), tally.add(w.depth, at.r);
    } else {
      const detect::Sphere other = v.centers[pair.j];
      const MoverState theirs =
          state_of(v, pair.j, other);  // read before it is known that they touch: most do
      touches = detect::touching(at, other);
      if (touches) {
        contact = push_spheres(v.law, v.step, at, other, mine, theirs, spring);
        tally.add(contact.depth, detect::smaller(at.r, other.r));
      }
    }
    tally.contacts = touches;
    v.rows.springs[c] = touches ? spring : Vec3{};
    v.rows.pushes[c] = contact.push;
  }
  tell(record, tally);
}

// What a sphere bears of the candidate in its row's entry q. False if they do not touch.
__device__ __forceinline__ bool entry_push(const View& v, std::uint32_t q, Push& push) {
  const std::uint32_t entry = v.rows.entries[q];
  push = v.rows.pushes[entry & ~kSecond];
  if (push.force == Vec3{}) return false;
  if (entry & kSecond) push.force = -1.0 * push.force;
  return true;
}
// What a sphere bears of all its contacts, about the centre of its mover.
__device__ Load load_of(const View& v, std::uint32_t self, double radius, const Vec3& position) {
  if (radius > v.large_radius) return v.loads[self];
  Load sum;
  const std::uint32_t end = v.rows.starts[self + 1];
  // Several pushes are asked for before the first is needed; they are added in their order.
  for (std::uint32_t q = v.rows.starts[self]; q < end; q += kAhead) {
    Push pushes[kAhead];
    bool touches[kAhead];
#pragma unroll
    for (std::uint32_t k = 0; k < kAhead; k++)
      touches[k] = entry_push(v, min(q + k, end - 1), pushes[k]) && q + k < end;
#pragma unroll
    for (std::uint32_t k = 0; k < kAhead; k++)
      if (touches[k]) add_push(sum, pushes[k].force, pushes[k].point, position);
  }
  return sum;
}

// A block for each large sphere, which may have thousands of contacts. Contacts that touch are dealt to the
// threads by their number among those that do, so that the sums do not depend on candidates that do not.
__global__ void __launch_bounds__(kThreads) load_large_kernel(const __grid_constant__ StepTask t) {
  const View& v = t.view;
  if (given_up(t.records[1])) return;
  alignas(Load) __shared__ unsigned char room[kThreads * sizeof(Load)];
  Load* const loads = reinterpret_cast<Load*>(room);
  __shared__ std::uint32_t of_warp[kThreads / 32];
  const std::uint32_t self = t.large[blockIdx.x], warp = threadIdx.x / 32;
  const Vec3 position = state_of(v, self, v.centers[self]).position;
  const std::uint32_t first = v.rows.starts[self], last = v.rows.starts[self + 1];
  loads[threadIdx.x] = {};
  std::uint32_t before = 0;
  for (std::uint32_t from = first; from < last; from += kThreads) {
    const std::uint32_t q = from + threadIdx.x;
    Push push;
    const bool touches = q < last && entry_push(v, q, push);
    const std::uint32_t lanes = __ballot_sync(~0u, touches);
    if (threadIdx.x % 32 == 0) of_warp[warp] = __popc(lanes);
    __syncthreads();
    std::uint32_t number = before + __popc(lanes & ((1u << threadIdx.x % 32) - 1));
    for (std::uint32_t w = 0; w < kThreads / 32; w++) {
      if (w < warp) number += of_warp[w];
      before += of_warp[w];
    }
    if (touches) add_push(loads[number % kThreads], push.force, push.point, position);
    __syncthreads();
  }
  for (int half = kThreads / 2; half; half /= 2) {
    if (threadIdx.x < half) {
      Load& to = loads[threadIdx.x];
      const Load& more = loads[threadIdx.x + half];
      to.force = to.force + more.force, to.torque = to.torque + more.torque;
    }
    __syncthreads();
  }
  if (threadIdx.x == 0) v.loads[self] = loads[0];
}

// A thread for each body: the load of its bushings, from the state before the step.
__global__ void __launch_bounds__(kThreads) bushing_kernel(const __grid_constant__ StepTask t) {
  const View& v = t.view;
  const std::uint32_t body = blockIdx.x * kThreads + threadIdx.x;
  if (body >= v.bodies || t.records[1].stopped) return;
  Load load;
  for (std::uint32_t q = v.bushing_starts[body]; q < v.bushing_starts[body + 1]; q++) {
    const Bushing& u = v.bushing[v.bushing_list[q]];
    const Motion &a = v.motions[u.a], &b = v.motions[u.b];
    add_bushing(u, {v.body_position[u.a], a.velocity, a.spin}, {v.body_position[u.b], b.velocity, b.spin},
                v.poses[u.a].rotation, v.poses[u.b].rotation, body == u.a ? &load : nullptr,
                body == u.b ? &load : nullptr);
  }
  v.bushing_loads[body] = load;
}

__global__ void __launch_bounds__(kThreads) move_grains_kernel(const __grid_constant__ StepTask t) {
  const View& v = t.view;
  Record& record = t.records[1];
  if (given_up(record)) return;
  const std::uint32_t self = v.body_spheres + blockIdx.x * kThreads + threadIdx.x;
  double moved = 0;
  if (self < v.spheres) {
    const std::uint32_t m = self - v.body_spheres + v.bodies;
    Motion motion = v.motions[m];
    if (motion.inverse_mass != 0) {
      detect::Sphere at = v.centers[self];
      Vec3 momentum = v.momentum[m];
      MoverState state{center_of(at), motion.velocity, motion.spin, motion.inverse_mass};
      const Load load = load_of(v, self, at.r, state.position);
      advance_grain(state, momentum, load, v.inverse_inertia[m].x, v.gravity, v.step);
      motion.velocity = state.velocity, motion.spin = state.spin;
      at.x = state.position.x, at.y = state.position.y, at.z = state.position.z;
      v.motions[m] = motion, v.momentum[m] = momentum, v.centers[self] = at;
      const Vec3 apart = state.position - center_of(v.reference[self]);
      moved = dot(apart, apart);
      if (!(length(state.velocity) <= t.fastest)) atomicMin(&record.wild, m);
    }
  }
  moved = largest_of_block(moved);
  if (threadIdx.x == 0) raise(record.moved, moved);
}

// `Lanes` threads for each body, which sum over its spheres.
template <unsigned Lanes>
__global__ void __launch_bounds__(kThreads) move_bodies_kernel(const __grid_constant__ StepTask t) {
  const View& v = t.view;
  Record& record = t.records[1];
  if (given_up(record)) return;
  const std::uint32_t body = (blockIdx.x * kThreads + threadIdx.x) / Lanes, lane = threadIdx.x % Lanes;
  if (body >= v.bodies) return;
  Motion motion = v.motions[body];
  if (motion.inverse_mass == 0 && !v.driven[body]) return;
  const Vec3 position = v.body_position[body];
  Load load;
  for (std::uint32_t k = v.first_sphere[body] + lane; k < v.first_sphere[body + 1]; k += Lanes) {
    const Load one = load_of(v, k, v.centers[k].r, position);
    load.force = load.force + one.force, load.torque = load.torque + one.torque;
  }
  double* const parts[] = {&load.force.x,  &load.force.y,  &load.force.z,
                           &load.torque.x, &load.torque.y, &load.torque.z};
#pragma unroll
  for (double* part : parts)
    for (unsigned d = Lanes / 2; d; d >>= 1) *part += __shfl_xor_sync(~0u, *part, d);
  if (lane > 0) return;
  if (v.bushings) {
    const Load& more = v.bushing_loads[body];
    load.force = load.force + more.force, load.torque = load.torque + more.torque;
  }
  MoverState state{position, motion.velocity, motion.spin, motion.inverse_mass};
  Vec3 momentum = v.momentum[body];
  Quaternion orientation = v.orientation[body];
  advance_body(state, momentum, orientation, load, v.inverse_inertia[body], v.gravity, v.step);
  motion.velocity = state.velocity, motion.spin = state.spin;
  v.motions[body] = motion, v.momentum[body] = momentum, v.orientation[body] = orientation;
  v.body_position[body] = state.position;
  detect::Pose pose;
  matrix_of(orientation, pose.rotation);
  pose.position[0] = state.position.x, pose.position[1] = state.position.y;
  pose.position[2] = state.position.z;
  v.poses[body] = pose;
  if (motion.inverse_mass != 0 && !(length(state.velocity) <= t.fastest)) atomicMin(&record.wild, body);
}

__device__ double place_sphere(const View& v, std::uint32_t k) {
  const std::uint32_t b = v.owner[k];
  const detect::Pose& pose = v.poses[b];
  detect::Body body;
  for (int c = 0; c < 9; c++) body.rotation[c] = pose.rotation[c];
  for (int c = 0; c < 3; c++) body.position[c] = pose.position[c];
  const detect::Sphere at =
      detect::placed(body, v.shape_spheres[v.first_of_shape[b] + (k - v.first_sphere[b])]);
  v.centers[k] = at;
  const Vec3 apart = center_of(at) - center_of(v.reference[k]);
  return dot(apart, apart);
}
__global__ void __launch_bounds__(kThreads) place_moved_kernel(const __grid_constant__ StepTask t) {
  Record& record = t.records[1];
  if (given_up(record)) return;
  const std::uint32_t k = blockIdx.x * kThreads + threadIdx.x;
  const double moved = largest_of_block(k < t.view.body_spheres ? place_sphere(t.view, k) : 0);
  if (threadIdx.x == 0) raise(record.moved, moved);
}
__global__ void __launch_bounds__(kThreads) place_kernel(const __grid_constant__ View v) {
  const std::uint32_t k = blockIdx.x * kThreads + threadIdx.x;
  if (k < v.body_spheres) place_sphere(v, k);
}

unsigned blocks_for(std::uint64_t items) { return static_cast<unsigned>((items + kThreads - 1) / kThreads); }

}  // namespace

void launch_step(const StepTask& t, cudaStream_t stream) {
  const View& v = t.view;
  push_kernel<<<std::max(blocks_for(v.rows.count), 1u), kThreads, 0, stream>>>(t);
  if (t.large_count) load_large_kernel<<<t.large_count, kThreads, 0, stream>>>(t);
  if (v.bushings) bushing_kernel<<<blocks_for(v.bodies), kThreads, 0, stream>>>(t);
  if (v.spheres > v.body_spheres)
    move_grains_kernel<<<blocks_for(v.spheres - v.body_spheres), kThreads, 0, stream>>>(t);
  if (v.bodies) {
    if (t.largest_body <= 8)
      move_bodies_kernel<1><<<blocks_for(v.bodies), kThreads, 0, stream>>>(t);
    else
      move_bodies_kernel<32><<<blocks_for(std::uint64_t(v.bodies) * 32), kThreads, 0, stream>>>(t);
    place_moved_kernel<<<blocks_for(v.body_spheres), kThreads, 0, stream>>>(t);
  }
  detect::cuda::cuda_launched("take a step");
}

void launch_place(const View& v, cudaStream_t stream) {
  if (v.body_spheres == 0) return;
  place_kernel<<<blocks_for(v.body_spheres), kThreads, 0, stream>>>(v);
  detect::cuda::cuda_launched("place the spheres of bodies");
}

}  // namespace padder::settle::cuda
