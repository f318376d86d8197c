// SPDX-License-Identifier: MIT
// A triangle mesh as flat arrays, its bounding box, and the mass properties of the body that it bounds.
#pragma once
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

namespace padder {

using Point = Eigen::Vector3d;   // a position, in the mesh's own unit and frame
using Vector = Eigen::Vector3d;  // a difference of positions, or a direction

// An axis-aligned box. A default one is empty: low > high.
struct Box {
  Point low = Point::Constant(std::numeric_limits<double>::infinity());
  Point high = Point::Constant(-std::numeric_limits<double>::infinity());

  void add(const Point& p) { low = low.cwiseMin(p), high = high.cwiseMax(p); }
  void add_ball(const Point& center, double radius) {
    add(center - Vector::Constant(radius)), add(center + Vector::Constant(radius));
  }
  bool empty() const { return !(low.x() <= high.x()); }
  double diagonal() const { return empty() ? 0 : (high - low).norm(); }
  Point center() const { return 0.5 * (low + high); }
  double half_area() const {  // of its faces
    if (empty()) return 0;
    const Vector e = high - low;
    return e.x() * e.y() + e.y() * e.z() + e.z() * e.x();
  }
  bool operator==(const Box&) const = default;
};

// Two boxes, as those of the children of a tree node. Vector instructions compute with both at once.
struct BoxPair {
  Eigen::Array2d low[3], high[3];  // for each axis, of both

  void set(int side, const Box& box) {
    for (int k = 0; k < 3; k++) low[k][side] = box.low[k], high[k][side] = box.high[k];
  }
  // The squared distances of p from both boxes; 0 inside.
  Eigen::Array2d distance2(const Point& p) const {
    Eigen::Array2d sum = Eigen::Array2d::Zero();
    for (int k = 0; k < 3; k++) {
      const Eigen::Array2d d = (low[k] - p[k]).max(p[k] - high[k]).max(0.0);
      sum += d * d;
    }
    return sum;
  }
};

// Indexed triangles. After repair they are counter-clockwise seen from outside; before, they may be any soup.
struct Mesh {
  std::vector<Point> points;
  std::vector<std::array<std::uint32_t, 3>> triangles;  // indices into points

  Box bounds() const;   // of the points that triangles use
  double area() const;  // sum over the triangles

  const Point& corner(std::size_t triangle, int k) const {
    return points[triangles[triangle][static_cast<std::size_t>(k)]];
  }
  std::array<Point, 3> corners(std::size_t t) const { return {corner(t, 0), corner(t, 1), corner(t, 2)}; }
  Point middle(std::size_t t) const { return (corner(t, 0) + corner(t, 1) + corner(t, 2)) / 3; }
  Vector area_normal(std::size_t t) const {  // along the outward normal, as long as the triangle's area
    return 0.5 * (corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0));
  }
  // A triangle with points of its own.
  void add(const std::array<Point, 3>& corners) {
    const auto first = static_cast<std::uint32_t>(points.size());
    points.insert(points.end(), corners.begin(), corners.end());
    triangles.push_back({first, first + 1, first + 2});
  }
  void add(const Mesh& more);  // behind the triangles that are there, with points of its own
  void drop_unused_points();   // the others then stand in the order in which triangles name them
};

std::string place_text(const Point& p);  // "(1, 2.5, -3)", for sentences: four digits of each

// The mass properties of the solid with density 1, in the mesh's frame and unit.
struct MassProperties {
  double volume = 0;                                   // length^3
  Point center = Point::Zero();                        // of mass
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();   // about the centre, along the mesh's axes; length^5
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();  // columns: principal directions, right-handed
  Vector moments = Vector::Zero();                     // principal moments, ascending, one for each column
  bool operator==(const MassProperties&) const = default;
};

// Sums over the tetrahedra that the triangles span with the centre of the bounding box (Mirtich, Fast and
// accurate computation of polyhedral mass properties, 1996, gives the same integrals). Exact up to rounding
// for a closed, outward-oriented mesh. For an open mesh the result means little: it depends on how the cone
// to the centre closes the surface.
MassProperties mass_properties(const Mesh& mesh);

// Could a body have these? Not with moments below 0, axes that are no rotation, or an inertia of others. A
// file of spheres may have been changed by hand.
bool possible(const MassProperties& m);

}  // namespace padder
