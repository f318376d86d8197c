// SPDX-License-Identifier: MIT
// Plane geometry of one triangle.
#pragma once
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

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

  // Barycentric coordinates of the circumcentre. One is negative when the circumcentre lies beyond the edge
  // that faces an obtuse angle. NaN for corners on a line.
  std::array<double, 3> circumcenter_weights() const {
    const double la = (b - c).squaredNorm(), lb = (c - a).squaredNorm(), lc = (a - b).squaredNorm();
    const double wa = la * (lb + lc - la), wb = lb * (lc + la - lb), wc = lc * (la + lb - lc);
    const double sum = wa + wb + wc;  // 16 area^2
    return {wa / sum, wb / sum, wc / sum};
  }
  Point circumcenter() const {
    const auto w = circumcenter_weights();
    return w[0] * a + w[1] * b + w[2] * c;
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

}  // namespace padder
