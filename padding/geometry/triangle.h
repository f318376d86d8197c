// SPDX-License-Identifier: MIT
// Plane geometry of one triangle, and of its parts.
#pragma once
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "padding/asset/mesh.h"

namespace padder {

// A triangle by its corners.
struct Triangle3 {
  Point a, b, c;

  Vector area_normal() const { return 0.5 * (b - a).cross(c - a); }  // as long as the area

  // The same direction and length, and orthogonal to the longest edge to rounding however thin the triangle
  // is.
  Vector normal_of_sliver() const {
    const Vector edges[] = {b - a, c - b, a - c};
    const auto shorter = [](const Vector& u, const Vector& v) { return u.squaredNorm() < v.squaredNorm(); };
    const auto k = std::max_element(edges, edges + 3, shorter) - edges;
    const Vector normal = 0.5 * edges[(k + 1) % 3].cross(edges[(k + 2) % 3]), &longest = edges[k];
    if (!(longest.squaredNorm() > 0)) return Vector::Zero();
    return normal - normal.dot(longest) / longest.squaredNorm() * longest;
  }

  double angle(int k) const {  // at corner k, radians
    const Point* p[3] = {&a, &b, &c};
    const Vector u = *p[(k + 1) % 3] - *p[k], v = *p[(k + 2) % 3] - *p[k];
    return std::atan2(u.cross(v).norm(), u.dot(v));
  }

  // Infinite for corners on a line.
  double circumradius() const {
    const double twice_area = (b - a).cross(c - a).norm();
    return (a - b).norm() * (b - c).norm() * (c - a).norm() / (2 * twice_area);
  }

  // NaN for corners on a line.
  Point circumcenter() const {
    const double la = (b - c).squaredNorm(), lb = (c - a).squaredNorm(), lc = (a - b).squaredNorm();
    const double wa = la * (lb + lc - la), wb = lb * (lc + la - lb), wc = lc * (la + lb - lc);
    const double sum = wa + wb + wc;  // 16 area^2
    return wa / sum * a + wb / sum * b + wc / sum * c;
  }

  // The smallest circle around the triangle: the circle over the longest edge for an obtuse triangle,
  // otherwise the circumcircle.
  struct Circle {
    Point center;
    double radius;
  };
  Circle enclosing_circle() const {
    const double la = (b - c).squaredNorm(), lb = (c - a).squaredNorm(), lc = (a - b).squaredNorm();
    if (la >= lb + lc) return {0.5 * (b + c), 0.5 * std::sqrt(la)};
    if (lb >= lc + la) return {0.5 * (c + a), 0.5 * std::sqrt(lb)};
    if (lc >= la + lb) return {0.5 * (a + b), 0.5 * std::sqrt(lc)};
    return {circumcenter(), circumradius()};
  }
};

// A part of a triangle: sampling and the certificate both cut triangles until the parts are small enough.
// Types derive from it to carry more along.
struct TrianglePart {
  std::array<Point, 3> corner;
  std::uint32_t triangle = 0;  // of the mesh, that this is a part of

  Point centroid() const { return (corner[0] + corner[1] + corner[2]) / 3; }

  // The squared length of the longest edge, and the corner that this edge starts from.
  std::pair<double, int> longest_edge() const {
    std::pair<double, int> longest{-1, 0};
    for (std::size_t k = 0; k < 3; k++) {
      const double length2 = (corner[(k + 1) % 3] - corner[k]).squaredNorm();
      if (length2 > longest.first) longest = {length2, static_cast<int>(k)};
    }
    return longest;
  }
  double size() const { return std::sqrt(longest_edge().first); }  // length of the longest edge
  double radius() const {                                          // of the ball around the centroid
    const Point middle = centroid();
    double radius2 = 0;
    for (const Point& p : corner) radius2 = std::max(radius2, (p - middle).squaredNorm());
    return std::sqrt(radius2);
  }
};

// The two halves on both sides of the middle of the longest edge. They inherit everything else from the part.
template <class Part>
std::array<Part, 2> bisect(const Part& part) {
  const int from = part.longest_edge().second, to = (from + 1) % 3;
  const Point middle = 0.5 * (part.corner[from] + part.corner[to]);
  std::array<Part, 2> halves = {part, part};
  halves[0].corner[to] = middle;
  halves[1].corner[from] = middle;
  return halves;
}

}  // namespace padder
