// SPDX-License-Identifier: MIT
// What the stepper moves: rigid bodies and grains, the walls around them and the springs between them. Arrays
// of numbers, one entry for each mover or sphere, so that a step on a GPU can read them as they are. Lengths,
// masses and times in one consistent set of units.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "detect/body.h"
#include "tools/settle/physics.h"

namespace padder::settle {

// A plane, whose solid side is where `normal` points away from; or the inside of a cylinder without ends.
struct Wall {
  enum class Kind : std::uint8_t { plane, cylinder };
  Kind kind = Kind::plane;
  Vec3 point;            // on the plane, or on the axis
  Vec3 direction;        // unit: the plane's normal, into the free side; or the axis
  double radius = 0;     // of the cylinder
  double friction = -1;  // between it and a sphere; below 0: that of the two materials
  std::uint32_t material = 0;
};

// How far the surface of a sphere is inside the wall (the penetration; negative: away from it) and the unit
// normal from the sphere to the wall.
struct WallContact {
  double depth;
  Vec3 normal;
};
PADDER_HD WallContact contact_with(const Wall& wall, const Vec3& center, double radius) {
  const Vec3 from = center - wall.point;
  const double along = dot(from, wall.direction);
  if (wall.kind == Wall::Kind::plane) return {radius - along, -1.0 * wall.direction};
  const Vec3 out = from - along * wall.direction;
  const double distance = length(out);
  // On the axis every direction is as good; the wall is a radius away there.
  const Vec3 normal = distance > 0 ? (1 / distance) * out : Vec3{1, 0, 0};
  return {distance + radius - wall.radius, normal};
}

// A spring and dashpot between points of two bodies: a bushing. Two of them on a line make a hinge.
struct Bushing {
  std::uint32_t a = 0, b = 0;  // bodies
  Vec3 on_a, on_b;             // the points, in the bodies' principal frames
  double stiffness = 0, damping = 0;
};

// The movers are numbered in one sequence: the bodies, then the grains. So are the spheres: those of body 0,
// of body 1, …, then one for each grain. That is the numbering of detect::Input.
struct System {
  // A shape: its spheres in the frame of the centre of mass and the principal axes.
  std::vector<std::vector<detect::Sphere>> shapes;
  std::vector<detect::Body> bodies;  // shape, family and mask; the pose is that of the last placing

  // One for each mover. A mover with an inverse mass of 0 is moved by nobody: it stands still, or, if it is
  // driven, goes on with its velocity and spin.
  std::vector<Vec3> position, velocity;  // of the centre of mass
  std::vector<Vec3> momentum;            // angular, about the centre of mass, in the world's frame
  std::vector<Vec3> spin;                // angular velocity; follows from momentum and orientation
  std::vector<double> inverse_mass;
  std::vector<Vec3> inverse_inertia;    // principal
  std::vector<Quaternion> orientation;  // of the principal axes, one for each body; grains need none
  std::vector<std::uint8_t> driven;     // one for each body
  std::vector<std::uint8_t> material;   // below kMostMaterials; empty: all are of material 0

  // One for each grain.
  std::vector<double> grain_radius;
  std::vector<std::uint32_t> grain_family, grain_mask;  // empty: 0
  std::vector<std::uint8_t> grain_static;               // empty: none

  std::vector<std::uint64_t> first_sphere;  // of each body, and the number of the spheres of bodies
  std::vector<Wall> walls;
  std::vector<Bushing> bushings;

  Vec3 gravity;
  Law law;
  double step = 0;  // of time
  std::string unit;

  std::size_t movers() const { return position.size(); }
  std::uint64_t body_spheres() const { return first_sphere.empty() ? 0 : first_sphere.back(); }
  std::uint64_t spheres() const { return body_spheres() + grain_radius.size(); }
  double radius_of(std::uint64_t sphere) const;
  std::uint32_t mover_of(std::uint64_t sphere) const;  // by search: for sentences and setting up
};

// Adds a grain of this density; returns the number of its mover. All bodies must have been added before.
std::uint32_t add_grain(System& system, const Vec3& center, double radius, double density,
                        const Vec3& velocity = {});

// The mass properties of a shape. Moments are principal and about the centre of mass.
struct Mass {
  double mass = 0;
  Vec3 moments;
};
// Adds a body whose shape is in the frame of its centre of mass and principal axes. A mass of 0: static.
std::uint32_t add_body(System& system, std::uint32_t shape, const Mass& mass, const Vec3& center,
                       const Quaternion& orientation);

// The longest step of time that is allowed, and the one that is taken where the scene gives none: parts of
// the duration of a contact of the two movers that answer a push the fastest. Throws Error if nothing can
// move.
struct StepLimits {
  double longest = 0, chosen = 0;
};
StepLimits step_limits(const System& system);

// Puts the body's place and orientation into its pose.
void place_body(System& system, std::size_t body);

}  // namespace padder::settle
