// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/shape_mesh.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace padder {
namespace {

Mesh box(const Vector& size) {
  Mesh mesh;
  for (int k = 0; k < 8; k++)
    mesh.points.push_back(size.cwiseProduct(Vector(k & 1, k >> 1 & 1, k >> 2 & 1) - Vector::Constant(0.5)));
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

// Corners around, for chords that turn by at most 2 `half_turn`. A multiple of 4 puts corners on the axes, so
// that the mesh has the bounding box of its shape.
std::uint32_t corners_around(double half_turn) {
  const double n = std::ceil(std::numbers::pi / std::max(half_turn, 1e-3));
  // In this order NaN, as of a tolerance that pad() refuses later, gives 64.
  return (static_cast<std::uint32_t>(std::min(std::max(64.0, n), 512.0)) + 3) / 4 * 4;
}

// Radius and z of the points of a line from the lower pole to the upper one. The radii of both poles count as
// 0.
using Profile = std::vector<std::array<double, 2>>;

// What the profile becomes when it is turned around z.
Mesh turned(const Profile& profile, std::uint32_t around) {
  Mesh mesh;
  const auto rings = static_cast<std::uint32_t>(profile.size()) - 2;
  for (std::uint32_t i = 1; i <= rings; i++)
    for (std::uint32_t j = 0; j < around; j++) {
      const double angle = 2 * std::numbers::pi * j / around;
      mesh.points.emplace_back(profile[i][0] * std::cos(angle), profile[i][0] * std::sin(angle),
                               profile[i][1]);
    }
  const std::uint32_t low = rings * around, high = low + 1;
  mesh.points.emplace_back(0, 0, profile.front()[1]), mesh.points.emplace_back(0, 0, profile.back()[1]);
  const auto at = [&](std::uint32_t i, std::uint32_t j) { return i * around + j % around; };
  for (std::uint32_t j = 0; j < around; j++) {
    mesh.triangles.push_back({low, at(0, j + 1), at(0, j)});
    mesh.triangles.push_back({high, at(rings - 1, j), at(rings - 1, j + 1)});
    for (std::uint32_t i = 0; i + 1 < rings; i++)
      mesh.triangles.insert(mesh.triangles.end(), {{at(i, j), at(i, j + 1), at(i + 1, j + 1)},
                                                   {at(i, j), at(i + 1, j + 1), at(i + 1, j)}});
  }
  return mesh;
}

ShapeMesh cylinder(double radius, double length, double wanted) {
  const std::uint32_t n = corners_around(std::acos(std::clamp(1 - wanted / radius, 0.0, 1.0)));
  const double z = length / 2;
  return {turned({{0, -z}, {radius, -z}, {radius, z}, {0, z}}, n),
          radius * (1 - std::cos(std::numbers::pi / n))};
}

// Two half spheres `length` apart, and what is between them. A chord along a ring and one across the rings
// turn by the same angle. The nearest to the centre that a face of them comes is cos^2 of half of it: across
// the rings the cosine is that of a circle's chords, and along them all radii shrink by it once more.
ShapeMesh capsule(double radius, double length, double wanted) {
  const std::uint32_t n = corners_around(std::asin(std::sqrt(std::clamp(wanted / radius, 0.0, 1.0))));
  const std::uint32_t quarter = n / 4;
  Profile profile;
  for (std::uint32_t k = 0; k <= 2 * quarter; k++) {
    const double up = std::numbers::pi / 2 * (double(k) / quarter - 1);
    const double r = radius * std::cos(up), z = radius * std::sin(up);
    if (k <= quarter) profile.push_back({r, z - length / 2});
    if (k > quarter || (k == quarter && length > 0)) profile.push_back({r, z + length / 2});
  }
  const double sine = std::sin(std::numbers::pi / n);
  return {turned(profile, n), radius * sine * sine};
}

// A ball that is stretched. So is each way from its surface to its chords, at most by the largest half axis.
ShapeMesh ellipsoid(const Vector& half_axes, double wanted) {
  ShapeMesh ball = capsule(1, 0, wanted / half_axes.maxCoeff());
  for (Point& p : ball.mesh.points) p = p.cwiseProduct(half_axes);
  ball.chord_error *= half_axes.maxCoeff();
  return ball;
}

}  // namespace

ShapeMesh shape_mesh(const RobotShape& shape, double wanted) {
  const Vector& size = shape.size;
  switch (shape.type) {
    case RobotShape::Type::cylinder:
      return cylinder(size.x(), size.z(), wanted);
    case RobotShape::Type::capsule:
      return capsule(size.x(), size.z(), wanted);
    case RobotShape::Type::sphere:
    case RobotShape::Type::ellipsoid:
      return ellipsoid(size, wanted);
    default:
      return {box(size), 0};
  }
}

}  // namespace padder
