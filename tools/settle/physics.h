// SPDX-License-Identifier: MIT
// The physics of the soft-sphere stepper as small functions for host and device: vectors, rotations, the
// contact law and the integration of one mover. Any consistent units; the default material is in SI.
// docs/detector/settle.md states the equations and their sources.
#pragma once
#include <cmath>
#include <cstdint>

#include "detect/host_device.h"

namespace padder::settle {

struct Vec3 {
  double x = 0, y = 0, z = 0;
  friend bool operator==(const Vec3&, const Vec3&) = default;
};
PADDER_HD Vec3 operator+(const Vec3& a, const Vec3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
PADDER_HD Vec3 operator-(const Vec3& a, const Vec3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
PADDER_HD Vec3 operator*(double s, const Vec3& a) { return {s * a.x, s * a.y, s * a.z}; }
PADDER_HD double dot(const Vec3& a, const Vec3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
PADDER_HD double length(const Vec3& a) { return ::sqrt(dot(a, a)); }
inline bool finite(const Vec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }
PADDER_HD Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

// A rotation as a unit quaternion w + xi + yj + zk.
struct Quaternion {
  double w = 1, x = 0, y = 0, z = 0;
  friend bool operator==(const Quaternion&, const Quaternion&) = default;
};
// The rotation matrix, row by row.
PADDER_HD void matrix_of(const Quaternion& q, double (&m)[9]) {
  m[0] = 1 - 2 * (q.y * q.y + q.z * q.z), m[1] = 2 * (q.x * q.y - q.w * q.z);
  m[2] = 2 * (q.x * q.z + q.w * q.y), m[3] = 2 * (q.x * q.y + q.w * q.z);
  m[4] = 1 - 2 * (q.x * q.x + q.z * q.z), m[5] = 2 * (q.y * q.z - q.w * q.x);
  m[6] = 2 * (q.x * q.z - q.w * q.y), m[7] = 2 * (q.y * q.z + q.w * q.x);
  m[8] = 1 - 2 * (q.x * q.x + q.y * q.y);
}
PADDER_HD Vec3 times(const double (&m)[9], const Vec3& a) {
  return {m[0] * a.x + m[1] * a.y + m[2] * a.z, m[3] * a.x + m[4] * a.y + m[5] * a.z,
          m[6] * a.x + m[7] * a.y + m[8] * a.z};
}
PADDER_HD Vec3 transposed_times(const double (&m)[9], const Vec3& a) {
  return {m[0] * a.x + m[3] * a.y + m[6] * a.z, m[1] * a.x + m[4] * a.y + m[7] * a.z,
          m[2] * a.x + m[5] * a.y + m[8] * a.z};
}
// The rotation by the vector `turn` (its direction the axis, its length the angle), after q.
PADDER_HD Quaternion turned(const Quaternion& q, const Vec3& turn) {
  const double angle = length(turn);
  // sin(angle / 2) / angle; its series where the quotient would lose digits
  const double s = angle > 1e-4 ? ::sin(0.5 * angle) / angle : 0.5 - angle * angle / 48;
  const double w = ::cos(0.5 * angle), x = s * turn.x, y = s * turn.y, z = s * turn.z;
  Quaternion p{w * q.w - x * q.x - y * q.y - z * q.z, w * q.x + x * q.w + y * q.z - z * q.y,
               w * q.y - x * q.z + y * q.w + z * q.x, w * q.z + x * q.y - y * q.x + z * q.w};
  const double norm = 1 / ::sqrt(p.w * p.w + p.x * p.x + p.y * p.y + p.z * p.z);
  p.w *= norm, p.x *= norm, p.y *= norm, p.z *= norm;
  return p;
}
// The angular velocity of a body with angular momentum `momentum` and principal inverse moments `inverse`.
PADDER_HD Vec3 spin_of(const Quaternion& q, const Vec3& inverse, const Vec3& momentum) {
  double m[9];
  matrix_of(q, m);
  const Vec3 l = transposed_times(m, momentum);
  return times(m, {inverse.x * l.x, inverse.y * l.y, inverse.z * l.z});
}

// What a contact does. The normal spring and dashpot, and Coulomb friction whose spring remembers the
// tangential displacement since the contact began (Cundall and Strack, A discrete numerical model for
// granular assemblies, 1979; the form with a spring that is turned with the contact is that of Luding,
// Cohesive, frictional powders, 2008).
struct Surface {
  double damping_ratio = 0;  // of the normal dashpot, from the restitution: 0 none, 1 critical
  double friction = 0;       // Coulomb's coefficient
};
inline constexpr std::uint32_t kMostMaterials = 8;
struct Law {
  double stiffness = 0;                              // of the normal spring: force a length
  double tangential_stiffness = 0;                   // of friction's spring
  Surface surfaces[kMostMaterials][kMostMaterials];  // of each two materials; symmetric
};

// The restitution of two spheres whose dashpot never pulls: their contact ends when its force does (Schwager
// and Poeschel, Coefficient of restitution and linear dashpot model revisited, 2007).
PADDER_HD double restitution_of(double damping_ratio) {
  const double b = damping_ratio, square = 1 - b * b;
  if (square > 1e-12) {
    const double d = ::sqrt(square);
    return ::exp(-b / d * ::atan2(2 * b * d, b * b - square));
  }
  const double o = ::sqrt(detect::larger(-square, 1e-12));
  return ::exp(-2 * b / o * ::log(b + o));
}
// The damping ratio that gives this restitution, which is from kLeastRestitution to 1. By bisection.
inline constexpr double kLeastRestitution = 0.01;
PADDER_HD double damping_ratio_of(double restitution) {
  double low = 0, high = 6;  // restitution_of(6) is below kLeastRestitution
  for (int k = 0; k < 60; k++) {
    const double middle = 0.5 * (low + high);
    (restitution_of(middle) > restitution ? low : high) = middle;
  }
  return low;
}

// The force on sphere i of a contact. `normal`: unit, from i to j. `depth`: the penetration, 0 or more.
// `velocity`: of i relative to j, at the point of contact. `reduced_mass`: 1 / (1 / m_i + 1 / m_j).
// `spring`: the memory of friction, updated; all 0 when the contact begins.
//
// The dashpot never pulls: a normal force below 0 counts as 0. While the contact slides, friction's spring is
// as long as the friction force needs, so that it gives no energy back beyond that.
PADDER_HD Vec3 contact_force(const Law& law, const Surface& surface, const Vec3& normal, double depth,
                             const Vec3& velocity, double reduced_mass, double step, Vec3& spring) {
  const double along = dot(velocity, normal);
  const double damping = 2 * surface.damping_ratio * ::sqrt(reduced_mass * law.stiffness);
  double push = law.stiffness * depth + damping * along;
  if (push < 0) push = 0;
  const Vec3 slip = velocity - along * normal;
  spring = spring - dot(spring, normal) * normal;
  spring = spring + step * slip;
  const double tangential_damping = 0.5 * damping;
  Vec3 hold = -law.tangential_stiffness * spring - tangential_damping * slip;
  const double most = surface.friction * push, size = length(hold);
  if (size > most) {
    hold = (most / size) * hold;
    spring = (-1 / law.tangential_stiffness) * (hold + tangential_damping * slip);
  }
  return hold - push * normal;
}

// One step of a mover. The velocity is advanced first and the position then with the new velocity (symplectic
// Euler, which is the leapfrog scheme with velocities half a step behind): the momentum of a pair is kept to
// rounding, and the energy of a spring does not drift.
PADDER_HD void advance(Vec3& position, Vec3& velocity, const Vec3& force, const Vec3& gravity,
                       double inverse_mass, double step) {
  velocity = velocity + step * (inverse_mass * force + gravity);
  position = position + step * velocity;
}
// The rotation of a body by the spin in the middle of the step, which is of second order: with a constant
// angular momentum this follows Euler's equations.
PADDER_HD void rotate(Quaternion& orientation, const Vec3& inverse_inertia, const Vec3& momentum,
                      double step) {
  const Vec3 now = spin_of(orientation, inverse_inertia, momentum);
  const Quaternion middle = turned(orientation, 0.5 * step * now);
  orientation = turned(orientation, step * spin_of(middle, inverse_inertia, momentum));
}

}  // namespace padder::settle
