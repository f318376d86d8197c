// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/meshing/cells/meeting_place.h"

#include <CGAL/Exact_rational.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "padding/geometry/indices.h"

namespace padder {
namespace {

template <class Number>
using Triple = std::array<Number, 3>;

template <class Number>
Triple<Number> difference(const Point& a, const Point& b) {
  return {Number(a[0]) - Number(b[0]), Number(a[1]) - Number(b[1]), Number(a[2]) - Number(b[2])};
}
template <class Number>
Triple<Number> cross(const Triple<Number>& a, const Triple<Number>& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
template <class Number>
Number dot(const Triple<Number>& a, const Triple<Number>& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// What the edge from p to q meets: a triangle, or an edge from `a` to `b`.
struct Met {
  bool triangle;
  Point a, b, c;
};

// How far p is from `met`, and how far q is, on the other side; both times the same factor.
template <class Number>
std::pair<Number, Number> distances(const Point& p, const Point& q, const Met& met) {
  const auto along = difference<Number>(met.b, met.a), to_p = difference<Number>(p, met.a),
             to_q = difference<Number>(q, met.a);
  if (met.triangle) {
    const auto normal = cross(along, difference<Number>(met.c, met.a));
    return {CGAL::abs(dot(normal, to_p)), CGAL::abs(dot(normal, to_q))};
  }
  // All four points lie in one plane. Across it the two areas are as the distances.
  const auto of_p = cross(along, to_p), of_q = cross(along, to_q);
  std::pair<Number, Number> most{0, 0};
  for (int k = 0; k < 3; k++)
    if (const Number x = CGAL::abs(of_p[k]), y = CGAL::abs(of_q[k]); x + y > most.first + most.second)
      most = {x, y};
  return most;
}

}  // namespace

Point place_of(const MeetingPoint& meeting, const Mesh& soup, double near) {
  const auto end = [&](std::uint64_t edge, std::size_t k) { return soup.points[ends_of(edge)[k]]; };
  const Point p = end(meeting.what, 0), q = end(meeting.what, 1);
  Met met{(meeting.with & MeetingPoint::kTriangle) != 0, {}, {}, {}};
  if (met.triangle) {
    const std::size_t t = meeting.with & ~MeetingPoint::kTriangle;
    met.a = soup.corner(t, 0), met.b = soup.corner(t, 1), met.c = soup.corner(t, 2);
  } else {
    met.a = end(meeting.with, 0), met.b = end(meeting.with, 1);
  }
  auto [x, y] = distances<double>(p, q, met);
  // How far rounding may move the place, times x + y.
  const double size = p.cwiseAbs().maxCoeff() + q.cwiseAbs().maxCoeff() + met.a.cwiseAbs().maxCoeff(),
               area = (met.b - met.a).norm() * (met.triangle ? (met.c - met.a).norm() : 1),
               doubt = 16 * std::numeric_limits<double>::epsilon() * area * size * (q - p).norm();
  if (!((x + y) * near > doubt)) {
    const auto [exact_x, exact_y] = distances<CGAL::Exact_rational>(p, q, met);
    const CGAL::Exact_rational sum = exact_x + exact_y;
    if (sum == 0) return 0.5 * (p + q);
    x = CGAL::to_double(exact_x / sum), y = 1 - x;
  }
  return p + (q - p) * (x / (x + y));
}

}  // namespace padder
