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
// Pushes that a thread reads at once: a grain has about five entries, a small body eight and more.
constexpr std::uint32_t kAheadOfGrain = 3, kAheadOfBody = 4;

__device__ double of_bits(Word bits) { return __longlong_as_double(static_cast<long long>(bits)); }

// The bits of the largest of the warp's values, none of which is below 0.
__device__ Word largest_of_warp(double value) {
  const auto bits = static_cast<Word>(__double_as_longlong(value));
  const std::uint32_t high = __reduce_max_sync(~0u, static_cast<std::uint32_t>(bits >> 32));
  const bool mine = high == bits >> 32;
  return Word(high) << 32 | __reduce_max_sync(~0u, mine ? static_cast<std::uint32_t>(bits) : 0u);
}
// Most callers find a larger one there and write nothing.
__device__ void raise(Word& to, Word bits) {
  if (bits > *static_cast<volatile Word*>(&to)) atomicMax(&to, bits);
}
// Raises `to` to the largest value of the block. All threads call it.
__device__ void raise_of_block(Word& to, double value) {
  __shared__ Word of_warp[kThreads / 32];
  const Word largest = largest_of_warp(value);
  if (threadIdx.x % 32 == 0) of_warp[threadIdx.x / 32] = largest;
  __syncthreads();
  if (threadIdx.x > 0) return;
  Word most = 0;
  for (const Word w : of_warp) most = max(most, w);
  raise(to, most);
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
  __shared__ std::uint32_t contacts[kThreads / 32];
  __shared__ Word deepest[kThreads / 32], ratio[kThreads / 32];
  const std::uint32_t warp = threadIdx.x / 32, count = __reduce_add_sync(~0u, mine.contacts);
  const Word deep = largest_of_warp(mine.deepest), of_radius = largest_of_warp(mine.ratio);
  if (threadIdx.x % 32 == 0) contacts[warp] = count, deepest[warp] = deep, ratio[warp] = of_radius;
  __syncthreads();
  if (threadIdx.x > 0) return;
  for (std::uint32_t w = 1; w < kThreads / 32; w++) {
    contacts[0] += contacts[w];
    deepest[0] = max(deepest[0], deepest[w]), ratio[0] = max(ratio[0], ratio[w]);
  }
  if (contacts[0] == 0) return;
  atomicAdd(&r.contacts[blockIdx.x % 32], Word(contacts[0]));
  raise(r.deepest, deepest[0]), raise(r.ratio, ratio[0]);
}

// A thread for each candidate: its force, if they touch. Of 98 registers a processor would hold a fifth fewer
// threads.
__global__ void __launch_bounds__(kThreads, 5) push_kernel(const __grid_constant__ StepTask t) {
  const View& v = t.view;
  Record& record = t.records[1];
  if (before_failed(t.records[0], t.limit)) {
    if (blockIdx.x == 0 && threadIdx.x == 0) record.stopped = 1;
    return;
  }
  Tally tally;
  const std::uint32_t c = blockIdx.x * kThreads + threadIdx.x;
  if (c < v.rows.count) {
    const detect::Pair pair = v.rows.pairs[c], movers = v.rows.movers ? v.rows.movers[c] : pair;
    const detect::Sphere at = load_wide(v.centers + pair.i);
    const MoverState mine = state_of(v, movers.i, at);
    Vec3 spring = v.rows.springs[c];
    Contact contact;
    bool touches = false;
    if (pair.j >= v.spheres) {
      const Wall& wall = v.wall[pair.j - v.spheres];
      const WallContact w = contact_with(wall, center_of(at), at.r);
      touches = w.depth >= 0;
      if (touches) contact = push_wall(v.law, v.step, at, wall, w, mine, spring), tally.add(w.depth, at.r);
    } else {
      const detect::Sphere other = load_wide(v.centers + pair.j);
      // Read before it is known that they touch: most do.
      const MoverState theirs = state_of(v, movers.j, other);
      touches = detect::touching(at, other);
      if (touches) {
        contact = push_spheres(v.law, v.step, at, other, mine, theirs, spring);
        tally.add(contact.depth, detect::smaller(at.r, other.r));
      }
    }
    tally.contacts = touches;
    v.rows.springs[c] = touches ? spring : Vec3{};
    store_wide(v.rows.pushes + c, contact.push);
  }
  tell(record, tally);
}

// What a sphere bears of the candidate in its row's entry q. False if they do not touch.
__device__ __forceinline__ bool entry_push(const View& v, std::uint32_t q, Push& push) {
  const std::uint32_t entry = v.rows.entries[q];
  push = load_wide(v.rows.pushes + (entry & ~kSecond));
  if (push.force == Vec3{}) return false;
  if (entry & kSecond) push.force = -1.0 * push.force;
  return true;
}
// What a mover bears of the contacts in these entries, about its centre. Several pushes are asked for before
// the first is needed; they are added in their order.
template <std::uint32_t Ahead>
__device__ Load load_of_entries(const View& v, std::uint32_t first, std::uint32_t end, const Vec3& position) {
  Load sum;
  for (std::uint32_t q = first; q < end; q += Ahead) {
    Push pushes[Ahead];
    bool touches[Ahead];
#pragma unroll
    for (std::uint32_t k = 0; k < Ahead; k++)
      touches[k] = entry_push(v, min(q + k, end - 1), pushes[k]) && q + k < end;
#pragma unroll
    for (std::uint32_t k = 0; k < Ahead; k++)
      if (touches[k]) add_push(sum, pushes[k].force, pushes[k].point, position);
  }
  return sum;
}
// What a sphere bears of all its contacts, about the centre of its mover.
__device__ Load load_of(const View& v, std::uint32_t self, double radius, const Vec3& position) {
  if (radius > v.large_radius) return v.loads[self];
  return load_of_entries<kAheadOfGrain>(v, v.rows.starts[self], v.rows.starts[self + 1], position);
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
  const Vec3 position = state_of(v, mover_of(v, self), v.centers[self]).position;
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
    add_bushing(u, {v.body_places[u.a].at, a.velocity, a.spin}, {v.body_places[u.b].at, b.velocity, b.spin},
                pose_of(v, u.a).rotation, pose_of(v, u.b).rotation, body == u.a ? &load : nullptr,
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
    Motion motion = load_wide(v.motions + m);
    if (motion.inverse_mass != 0) {
      detect::Sphere at = load_wide(v.centers + self);
      Vec3 momentum = v.momentum[m];
      MoverState state{center_of(at), motion.velocity, motion.spin, motion.inverse_mass};
      const Load load = load_of(v, self, at.r, state.position);
      advance_grain(state, momentum, load, v.inverse_inertia[m].x, v.gravity, v.step);
      motion.velocity = state.velocity, motion.spin = state.spin;
      at.x = state.position.x, at.y = state.position.y, at.z = state.position.z;
      v.momentum[m] = momentum;
      store_wide(v.motions + m, motion), store_wide(v.centers + self, at);
      const Vec3 apart = state.position - center_of(load_wide(v.reference + self));
      moved = dot(apart, apart);
      if (!(length(state.velocity) <= t.fastest)) atomicMin(&record.wild, m);
    }
  }
  raise_of_block(record.moved, moved);
}

// Puts sphere k of a body where its pose says. Returns the square of how far that is from where it was when
// candidates were found.
__device__ double place_sphere(const View& v, std::uint32_t k, std::uint32_t body, const detect::Pose& pose) {
  detect::Body at_pose;
  for (int c = 0; c < 9; c++) at_pose.rotation[c] = pose.rotation[c];
  for (int c = 0; c < 3; c++) at_pose.position[c] = pose.position[c];
  const detect::Sphere own = load_wide(v.shape_spheres + v.first_of_shape[body] + (k - v.first_sphere[body]));
  const detect::Sphere at = detect::placed(at_pose, own);
  store_wide(v.centers + k, at);
  const Vec3 apart = center_of(at) - center_of(load_wide(v.reference + k));
  return dot(apart, apart);
}

// `Lanes` threads sum over the spheres of a body, each takes the whole step of it, and they place its
// spheres.
template <unsigned Lanes>
__device__ double move_body(const StepTask& t, std::uint32_t body, std::uint32_t lane) {
  const View& v = t.view;
  Motion motion = load_wide(v.motions + body);
  if (motion.inverse_mass == 0 && !v.driven[body]) return 0;
  const Vec3 position = load_wide(v.body_places + body).at;
  Vec3 momentum = v.momentum[body];
  Quaternion orientation = load_wide(v.orientation + body);
  const std::uint32_t first = v.first_sphere[body], end = v.first_sphere[body + 1];
  Load load;
  if (Lanes == 1 && !t.large_in_bodies)  // the entries of all its spheres follow each other
    load = load_of_entries<kAheadOfBody>(v, v.rows.starts[first], v.rows.starts[end], position);
  else
    for (std::uint32_t k = first + lane; k < end; k += Lanes) {
      const Load one = load_of(v, k, v.centers[k].r, position);
      load.force = load.force + one.force, load.torque = load.torque + one.torque;
    }
  double* const parts[] = {&load.force.x,  &load.force.y,  &load.force.z,
                           &load.torque.x, &load.torque.y, &load.torque.z};
#pragma unroll
  for (double* part : parts)
    for (unsigned d = Lanes / 2; d; d >>= 1) *part += __shfl_xor_sync(~0u, *part, d);
  if (v.bushings) {
    const Load& more = v.bushing_loads[body];
    load.force = load.force + more.force, load.torque = load.torque + more.torque;
  }
  MoverState state{position, motion.velocity, motion.spin, motion.inverse_mass};
  advance_body(state, momentum, orientation, load, v.inverse_inertia[body], v.gravity, v.step);
  const detect::Pose pose = pose_of(state.position, orientation);
  if (Lanes > 1) __syncwarp();  // every lane has read what the first one writes
  if (lane == 0) {
    motion.velocity = state.velocity, motion.spin = state.spin;
    v.momentum[body] = momentum;
    store_wide(v.motions + body, motion), store_wide(v.orientation + body, orientation);
    store_wide(v.body_places + body, {state.position, 0});
    if (motion.inverse_mass != 0 && !(length(state.velocity) <= t.fastest))
      atomicMin(&t.records[1].wild, body);
  }
  double moved = 0;
  for (std::uint32_t k = first + lane; k < end; k += Lanes)
    moved = detect::larger(place_sphere(v, k, body, pose), moved);
  return moved;
}
template <unsigned Lanes>
__global__ void __launch_bounds__(kThreads) move_bodies_kernel(const __grid_constant__ StepTask t) {
  if (given_up(t.records[1])) return;
  const std::uint32_t body = (blockIdx.x * kThreads + threadIdx.x) / Lanes;
  raise_of_block(t.records[1].moved,
                 body < t.view.bodies ? move_body<Lanes>(t, body, threadIdx.x % Lanes) : 0);
}

__global__ void __launch_bounds__(kThreads) place_kernel(const __grid_constant__ View v) {
  const std::uint32_t k = blockIdx.x * kThreads + threadIdx.x;
  if (k < v.body_spheres) place_sphere(v, k, v.owner[k], pose_of(v, v.owner[k]));
}

__global__ void __launch_bounds__(kThreads)
    poses_kernel(const __grid_constant__ View v, detect::Pose* poses) {
  const std::uint32_t body = blockIdx.x * kThreads + threadIdx.x;
  if (body < v.bodies) store_wide(poses + body, pose_of(v, body));
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
    if (t.largest_body <= kSmallBody)
      move_bodies_kernel<1><<<blocks_for(v.bodies), kThreads, 0, stream>>>(t);
    else
      move_bodies_kernel<32><<<blocks_for(std::uint64_t(v.bodies) * 32), kThreads, 0, stream>>>(t);
  }
  detect::cuda::cuda_launched("take a step");
}

void launch_poses(const View& v, detect::Pose* poses, cudaStream_t stream) {
  if (v.bodies == 0) return;
  poses_kernel<<<blocks_for(v.bodies), kThreads, 0, stream>>>(v, poses);
  detect::cuda::cuda_launched("write the poses of bodies");
}

void launch_place(const View& v, cudaStream_t stream) {
  if (v.body_spheres == 0) return;
  place_kernel<<<blocks_for(v.body_spheres), kThreads, 0, stream>>>(v);
  detect::cuda::cuda_launched("place the spheres of bodies");
}

}  // namespace padder::settle::cuda
