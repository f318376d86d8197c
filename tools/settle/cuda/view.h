// SPDX-License-Identifier: MIT
// What the kernels of a step read and write. Only .cu files include this.
#pragma once
#include <cstdint>

#include "detect/detector.h"
#include "tools/settle/push.h"

namespace padder::settle::cuda {

// What a step changes in a mover and a contact reads: two sectors of memory.
struct alignas(32) Motion {
  Vec3 velocity;
  double inverse_mass;
  Vec3 spin;
  std::uint64_t material;
};

// Where a body is: one sector of memory.
struct alignas(32) Place {
  Vec3 at;
  double unused;
};

// A step's outcome. `stopped`: it was not taken, since the candidates were too old or an earlier step failed.
// Numbers that are not negative are compared by their bits.
struct Record {
  unsigned long long moved;           // bits: the square of how far a sphere is from where it was detected
  unsigned long long deepest, ratio;  // bits
  std::uint32_t stopped, wild;        // wild: the first mover that was too fast; ~0u: none
  unsigned long long contacts[32];    // their sum counts: one counter for all would make blocks wait
};

// The candidates. Candidate c is pairs[c]: a sphere and a partner with a higher number, which is another
// sphere, or `spheres` + w for wall w. Its spring is as its first sphere feels it, and its push what acts on
// that one. They are in the order of their spheres, then of their partners. The row of sphere k,
// entries[starts[k]] and so on, has all its candidates by the partner's number: each is a candidate's number,
// with kSecond if k is not its first sphere. Each candidate's force is so computed once, by whichever thread,
// and each sphere sums its own in one order.
struct Rows {
  std::uint32_t count = 0;  // of candidates
  const detect::Pair* pairs = nullptr;
  const detect::Pair* movers = nullptr;  // of each pair; null if there are no bodies
  Vec3* springs = nullptr;
  Push* pushes = nullptr;  // a force of 0: they do not touch
  const std::uint32_t* starts = nullptr;
  const std::uint32_t* entries = nullptr;
};
inline constexpr std::uint32_t kSecond = 1u << 31;

struct View {
  std::uint32_t spheres = 0, bodies = 0, body_spheres = 0, movers = 0, walls = 0, bushings = 0;
  bool all_move = true;     // nothing is static or driven
  double large_radius = 0;  // a block of threads sums what a sphere with a larger radius bears
  detect::Sphere* centers = nullptr;
  const detect::Sphere* reference = nullptr;  // the centres when candidates were found
  Motion* motions = nullptr;
  Vec3* momentum = nullptr;
  const Vec3* inverse_inertia = nullptr;
  Load* loads = nullptr;  // of each large sphere
  // Of bodies, and of their spheres.
  Place* body_places = nullptr;
  Quaternion* orientation = nullptr;
  const std::uint8_t* driven = nullptr;
  const std::uint32_t* owner = nullptr;
  const std::uint32_t* first_sphere = nullptr;  // of each body, and the number of the spheres of bodies
  const std::uint32_t* first_of_shape = nullptr;
  const detect::Sphere* shape_spheres = nullptr;
  Load* bushing_loads = nullptr;
  const std::uint32_t* bushing_starts = nullptr;  // of each body, in bushing_list
  const std::uint32_t* bushing_list = nullptr;
  const Bushing* bushing = nullptr;

  const Wall* wall = nullptr;
  Rows rows;
  Law law;
  Vec3 gravity;
  double step = 0;
};

// Reads and writes 16 bytes at a time, which the alignment of doubles alone would not allow. All arrays here
// begin at a multiple of 256 bytes.
template <class T>
__device__ __forceinline__ T load_wide(const T* from) {
  static_assert(sizeof(T) % sizeof(double2) == 0);
  alignas(double2) T to;
#pragma unroll
  for (std::size_t k = 0; k < sizeof(T) / sizeof(double2); k++)
    reinterpret_cast<double2*>(&to)[k] = reinterpret_cast<const double2*>(from)[k];
  return to;
}
template <class T>
__device__ __forceinline__ void store_wide(T* to, const T& value) {
  static_assert(sizeof(T) % sizeof(double2) == 0);
  alignas(double2) const T from = value;
#pragma unroll
  for (std::size_t k = 0; k < sizeof(T) / sizeof(double2); k++)
    reinterpret_cast<double2*>(to)[k] = reinterpret_cast<const double2*>(&from)[k];
}

__device__ __forceinline__ detect::Pose pose_of(const Vec3& at, const Quaternion& orientation) {
  detect::Pose pose;
  matrix_of(orientation, pose.rotation);
  pose.position[0] = at.x, pose.position[1] = at.y, pose.position[2] = at.z;
  return pose;
}
__device__ __forceinline__ detect::Pose pose_of(const View& v, std::uint32_t body) {
  return pose_of(load_wide(v.body_places + body).at, load_wide(v.orientation + body));
}

__device__ __forceinline__ std::uint32_t mover_of(const View& v, std::uint32_t sphere) {
  return sphere < v.body_spheres ? v.owner[sphere] : sphere - v.body_spheres + v.bodies;
}
__device__ __forceinline__ MoverState state_of(const View& v, std::uint32_t mover, const detect::Sphere& at) {
  const Motion motion = load_wide(v.motions + mover);
  return {mover < v.bodies ? load_wide(v.body_places + mover).at : center_of(at), motion.velocity,
          motion.spin, motion.inverse_mass, static_cast<std::uint32_t>(motion.material)};
}

}  // namespace padder::settle::cuda
