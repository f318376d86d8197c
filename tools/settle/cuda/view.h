// SPDX-License-Identifier: MIT
// What the kernels of a step read and write. Only .cu files include this.
#pragma once
#include <cstdint>

#include "detect/body.h"
#include "tools/settle/push.h"

namespace padder::settle::cuda {

// What a step changes in a mover and a contact reads: two sectors of memory.
struct alignas(32) Motion {
  Vec3 velocity;
  double inverse_mass;
  Vec3 spin;
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

// The candidates of all spheres: those of sphere k are partners[starts[k]] and so on, in ascending order. A
// partner is another sphere, or `spheres` + w for wall w. Each pair is in the rows of both its spheres, each
// with the spring as its sphere feels it: both compute the same force from the same numbers, bit by bit and
// with opposite signs, and nothing needs to be exchanged.
struct Rows {
  const std::uint32_t* starts = nullptr;
  const std::uint32_t* partners = nullptr;
  Vec3* springs = nullptr;
};

struct View {
  std::uint32_t spheres = 0, bodies = 0, body_spheres = 0, movers = 0, walls = 0, bushings = 0;
  double large_radius = 0;  // a sphere with a larger radius has a block of threads of its own
  detect::Sphere* centers = nullptr;
  const detect::Sphere* reference = nullptr;  // the centres when candidates were found
  Motion* motions = nullptr;
  Vec3* momentum = nullptr;
  const Vec3* inverse_inertia = nullptr;
  Load* loads = nullptr;  // of each sphere
  // Of bodies, and of their spheres.
  Vec3* body_position = nullptr;
  Quaternion* orientation = nullptr;
  detect::Pose* poses = nullptr;
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

__device__ __forceinline__ std::uint32_t mover_of(const View& v, std::uint32_t sphere) {
  return sphere < v.body_spheres ? v.owner[sphere] : sphere - v.body_spheres + v.bodies;
}
__device__ __forceinline__ MoverState state_of(const View& v, std::uint32_t sphere,
                                               const detect::Sphere& at) {
  const std::uint32_t m = mover_of(v, sphere);
  const Motion& motion = v.motions[m];
  return {sphere < v.body_spheres ? v.body_position[m] : center_of(at), motion.velocity, motion.spin,
          motion.inverse_mass};
}

}  // namespace padder::settle::cuda
