// SPDX-License-Identifier: MIT
#include "padding/robots/solid_inertia.h"

#include <numbers>

namespace padder::reading {
namespace {

using Type = RobotShape::Type;

// Moments from the sums of mass times the squares of x, y and z.
Vector moments_from(const Vector& s) { return {s.y() + s.z(), s.x() + s.z(), s.x() + s.y()}; }

// About the shape's centre, along its axes.
Vector moments_of(const RobotShape& shape, double mass) {
  const Vector squares = mass * shape.size.cwiseAbs2();
  const double r = shape.size.x(), length = shape.size.z();
  switch (shape.type) {
    case Type::box:
      return moments_from(squares / 12);
    case Type::ellipsoid:
    case Type::sphere:
      return moments_from(squares / 5);
    case Type::cylinder:
      return moments_from({squares.x() / 4, squares.y() / 4, squares.z() / 12});
    default: {  // a capsule: a cylinder between two halves of a ball, each 3/8 of the radius out
      const double ends = mass / (1 + 0.75 * length / r), middle = mass - ends;
      const double across = middle * (r * r / 4 + length * length / 12) +
                            ends * (0.4 * r * r + length * length / 4 + 0.375 * length * r);
      return {across, across, middle * r * r / 2 + ends * 0.4 * r * r};
    }
  }
}

}  // namespace

double volume_of(const RobotShape& shape) {
  const Vector& s = shape.size;
  const double r = s.x(), ball = 4 / 3. * std::numbers::pi, rod = std::numbers::pi * r * r * s.z();
  switch (shape.type) {
    case Type::box:
      return s.prod();
    case Type::ellipsoid:
    case Type::sphere:
      return ball * s.prod();
    case Type::cylinder:
      return rod;
    default:
      return rod + ball * r * r * r;
  }
}

Inertial solid_inertia(const RobotShape& shape, double mass) {
  const Eigen::Matrix3d turn = shape.pose.rotation();
  return {mass, shape.pose.translation(), turn * moments_of(shape, mass).asDiagonal() * turn.transpose()};
}

Inertial sum_of(const std::vector<Inertial>& parts) {
  Inertial sum;
  for (const Inertial& part : parts) sum.mass += part.mass, sum.center += part.mass * part.center;
  if (sum.mass > 0) sum.center /= sum.mass;
  for (const Inertial& part : parts) {
    const Vector d = part.center - sum.center;
    sum.inertia +=
        part.inertia + part.mass * (d.squaredNorm() * Eigen::Matrix3d::Identity() - d * d.transpose());
  }
  return sum;
}

}  // namespace padder::reading
