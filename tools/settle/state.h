// SPDX-License-Identifier: MIT
// What can be told of a stepper between two steps, and the sums that both backends make for it.
#pragma once
#include <cstdint>
#include <vector>

#include "tools/settle/system.h"

namespace padder::settle {

// Energies and what else tells whether a run is sound. Energy is only lost to dashpots and friction, so the
// total of a scene without driven bodies must not grow.
struct Watch {
  double kinetic = 0, potential = 0, elastic = 0;
  double total() const { return kinetic + potential + elastic; }
  Vec3 momentum;             // linear, of all that moves
  double fastest = 0;        // the largest speed of a mover
  double liveliest = 0;      // the largest root mean square speed of a mover's points, its spin included
  double deepest = 0;        // the largest penetration of the last step
  double deepest_ratio = 0;  // the same as a ratio to the smaller radius of its two spheres
};

// What a mover adds to a watch.
PADDER_HD void watch_mover(Watch& w, const Vec3& gravity, double inverse_mass, const Vec3& position,
                           const Vec3& velocity, const Vec3& spin, const Vec3& momentum) {
  w.fastest = detect::larger(w.fastest, length(velocity));
  if (inverse_mass == 0) {  // it stands still, or is driven, and nobody knows how its mass is spread
    w.liveliest = detect::larger(w.liveliest, dot(spin, spin) > 0 ? INFINITY : length(velocity));
    return;
  }
  const double mass = 1 / inverse_mass,
               kinetic = 0.5 * mass * dot(velocity, velocity) + 0.5 * dot(spin, momentum);
  w.kinetic += kinetic;
  w.liveliest = detect::larger(w.liveliest, ::sqrt(2 * kinetic * inverse_mass));
  w.potential -= mass * dot(gravity, position);
  w.momentum = w.momentum + mass * velocity;
}
// The energy in the springs of a contact: of friction's spring what Coulomb's law lets out. While a contact
// slides, its dashpot holds against the rest.
PADDER_HD double stored_energy(const Law& law, double friction, double depth, const Vec3& spring) {
  if (depth < 0) return 0;
  const double hold =
      detect::smaller(law.tangential_stiffness * length(spring), friction * law.stiffness * depth);
  return 0.5 * law.stiffness * depth * depth + 0.5 * hold * hold / law.tangential_stiffness;
}

// A contact's memory: the spring of friction between two spheres, or between a sphere and a wall.
struct SpringMemory {
  std::uint32_t i, j;  // spheres, or a sphere and a wall
  Vec3 spring;
};

inline constexpr std::uint64_t kNever = ~std::uint64_t(0);

// All that the next step depends on besides the System as it was given. A stepper that takes a snapshot goes
// on with the same bits as the one that gave it, if it is of the same backend.
struct Snapshot {
  std::uint64_t steps = 0;
  std::vector<Vec3> position, velocity, momentum, spin;
  std::vector<Quaternion> orientation;
  std::vector<SpringMemory> contacts, walls;  // those that touch, by i, then j
  // At which step watch() saw that everything is slow, and since then; and the liveliest speed that it saw.
  std::uint64_t slow_since = kNever;
  double slow_speed = 0;
};

}  // namespace padder::settle
