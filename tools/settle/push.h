// SPDX-License-Identifier: MIT
// What a contact and a bushing do to their movers, for host and device: the same functions, and without fused
// operations the same bits.
#pragma once
#include "detect/contact.h"
#include "tools/settle/system.h"

namespace padder::settle {

// A force and the point on which it acts. Aligned so that a GPU reads it in three pieces.
struct alignas(16) Push {
  Vec3 force, point;
};
// Force and torque on a mover.
struct Load {
  Vec3 force, torque;
};
PADDER_HD void add_push(Load& load, const Vec3& force, const Vec3& point, const Vec3& position) {
  load.force = load.force + force, load.torque = load.torque + cross(point - position, force);
}

// What a contact reads of a mover.
struct MoverState {
  Vec3 position, velocity, spin;
  double inverse_mass = 0;
  std::uint32_t material = 0;
};
PADDER_HD Vec3 velocity_at(const MoverState& m, const Vec3& point) {
  return m.velocity + cross(m.spin, point - m.position);
}
PADDER_HD Vec3 center_of(const detect::Sphere& s) { return {s.x, s.y, s.z}; }

// What happened in a contact: the push on its first sphere, and how deep the two overlap.
struct Contact {
  Push push;
  double depth = 0;
};
// Of two spheres that touch, moved by i and j. The force acts in the middle of the overlap. Everything is
// symmetric: with a and b exchanged, and the spring turned over, the force has the same bits and the other
// sign.
PADDER_HD Contact push_spheres(const Law& law, double step, const detect::Sphere& a, const detect::Sphere& b,
                               const MoverState& i, const MoverState& j, Vec3& spring) {
  const detect::Geometry g = detect::geometry(a, b);
  const Vec3 normal{g.normal[0], g.normal[1], g.normal[2]};
  const double depth = detect::larger(g.depth, 0);
  const Vec3 point = 0.5 * (Vec3{g.on_i[0], g.on_i[1], g.on_i[2]} + Vec3{g.on_j[0], g.on_j[1], g.on_j[2]});
  const Vec3 velocity = velocity_at(i, point) - velocity_at(j, point);
  const double reduced = 1 / (i.inverse_mass + j.inverse_mass);
  const Surface& surface = law.surfaces[i.material][j.material];
  return {{contact_force(law, surface, normal, depth, velocity, reduced, step, spring), point}, depth};
}
PADDER_HD double friction_with(const Law& law, const Wall& wall, std::uint32_t material) {
  return wall.friction >= 0 ? wall.friction : law.surfaces[material][wall.material].friction;
}
// Of a sphere and a wall that touch.
PADDER_HD Contact push_wall(const Law& law, double step, const detect::Sphere& a, const Wall& wall,
                            const WallContact& w, const MoverState& i, Vec3& spring) {
  const Vec3 point = center_of(a) + (a.r - w.depth) * w.normal;  // on the wall, which does not yield
  const Surface surface{law.surfaces[i.material][wall.material].damping_ratio,
                        friction_with(law, wall, i.material)};
  const Vec3 force =
      contact_force(law, surface, w.normal, w.depth, velocity_at(i, point), 1 / i.inverse_mass, step, spring);
  return {{force, point}, w.depth};
}

// How far a bushing's points are apart, from that on b to that on a; the arms are those of the points.
PADDER_HD Vec3 stretch_of(const Bushing& u, const Vec3& position_a, const Vec3& position_b,
                          const double (&rotation_a)[9], const double (&rotation_b)[9], Vec3& arm_a,
                          Vec3& arm_b) {
  arm_a = times(rotation_a, u.on_a), arm_b = times(rotation_b, u.on_b);
  return position_a + arm_a - position_b - arm_b;
}
PADDER_HD void add_bushing(const Bushing& u, const MoverState& a, const MoverState& b,
                           const double (&rotation_a)[9], const double (&rotation_b)[9], Load* on_a,
                           Load* on_b) {
  Vec3 arm_a, arm_b;
  const Vec3 apart = stretch_of(u, a.position, b.position, rotation_a, rotation_b, arm_a, arm_b);
  // Both forces act midway between the two points. At the points themselves those of the dashpot, which are
  // not along `apart`, would be a couple that turns two free bodies.
  arm_a = arm_a - 0.5 * apart, arm_b = arm_b + 0.5 * apart;
  const Vec3 speed = a.velocity + cross(a.spin, arm_a) - b.velocity - cross(b.spin, arm_b);
  const Vec3 force = -u.stiffness * apart - u.damping * speed;
  if (on_a) on_a->force = on_a->force + force, on_a->torque = on_a->torque + cross(arm_a, force);
  if (on_b) on_b->force = on_b->force - force, on_b->torque = on_b->torque - cross(arm_b, force);
}

// One step of a mover that bears this load. A body is turned; a grain has no orientation that anything reads.
// A body without inverse mass is driven.
PADDER_HD void advance_body(MoverState& m, Vec3& momentum, Quaternion& orientation, const Load& load,
                            const Vec3& inverse_inertia, const Vec3& gravity, double step) {
  if (m.inverse_mass == 0) {
    m.position = m.position + step * m.velocity;
    orientation = turned(orientation, step * m.spin);
    return;
  }
  advance(m.position, m.velocity, load.force, gravity, m.inverse_mass, step);
  momentum = momentum + step * load.torque;
  rotate(orientation, inverse_inertia, momentum, step);
  m.spin = spin_of(orientation, inverse_inertia, momentum);
}
PADDER_HD void advance_grain(MoverState& m, Vec3& momentum, const Load& load, double inverse_inertia,
                             const Vec3& gravity, double step) {
  advance(m.position, m.velocity, load.force, gravity, m.inverse_mass, step);
  momentum = momentum + step * load.torque;
  m.spin = inverse_inertia * momentum;
}

}  // namespace padder::settle
