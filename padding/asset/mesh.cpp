// SPDX-License-Identifier: MIT
#include "padding/asset/mesh.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "padding/asset/excerpt.h"

namespace padder {

Box Mesh::bounds() const {
  Box box;
  for (const auto& t : triangles)
    for (auto v : t) box.add(points[v]);
  return box;
}

double Mesh::area() const {
  double sum = 0;
  for (std::size_t t = 0; t < triangles.size(); t++) sum += area_normal(t).norm();
  return sum;
}

void Mesh::add(const Mesh& more) {
  const auto first = static_cast<std::uint32_t>(points.size());
  points.insert(points.end(), more.points.begin(), more.points.end());
  for (const auto& t : more.triangles) triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
}

std::string place_text(const Point& p) {
  return "(" + short_number(p.x(), 4) + ", " + short_number(p.y(), 4) + ", " + short_number(p.z(), 4) + ")";
}

void Mesh::drop_unused_points() {
  constexpr std::uint32_t unused = ~0u;
  std::vector<std::uint32_t> index(points.size(), unused);
  std::vector<Point> used;
  for (auto& t : triangles)
    for (auto& v : t) {
      if (index[v] == unused) index[v] = static_cast<std::uint32_t>(used.size()), used.push_back(points[v]);
      v = index[v];
    }
  points.swap(used);
}

MassProperties mass_properties(const Mesh& mesh) {
  MassProperties m;
  // Relative to the centre of the box: far from the origin the moments would lose their digits to
  // cancellation.
  const Point origin = mesh.bounds().center();
  Vector first = Vector::Zero();
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();  // integral of x x^T
  for (std::size_t t = 0; t < mesh.triangles.size(); t++) {
    const Vector a = mesh.corner(t, 0) - origin, b = mesh.corner(t, 1) - origin,
                 c = mesh.corner(t, 2) - origin;
    const double v = a.dot(b.cross(c)) / 6;  // of the tetrahedron (origin, a, b, c)
    const Vector sum = a + b + c;
    m.volume += v;
    first += v / 4 * sum;
    second += v / 20 * (sum * sum.transpose() + a * a.transpose() + b * b.transpose() + c * c.transpose());
  }
  if (m.volume == 0) {
    m.center = origin;
    return m;
  }
  const Vector offset = first / m.volume;
  second -= m.volume * offset * offset.transpose();
  m.center = origin + offset;
  m.inertia = second.trace() * Eigen::Matrix3d::Identity() - second;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(m.inertia);
  m.moments = solver.eigenvalues();
  m.axes = solver.eigenvectors();
  // The sign of an eigenvector is arbitrary. Here its largest component is positive, and the third vector
  // follows from the first two.
  for (int k = 0; k < 2; k++) {
    Eigen::Index largest;
    m.axes.col(k).cwiseAbs().maxCoeff(&largest);
    if (m.axes(largest, k) < 0) m.axes.col(k) *= -1;
  }
  m.axes.col(2) = m.axes.col(0).cross(m.axes.col(1));
  return m;
}

bool possible(const MassProperties& m) {
  const double most = m.moments.cwiseAbs().maxCoeff(), rounding = 1e-6;
  const Eigen::Matrix3d inertia = m.axes * m.moments.asDiagonal() * m.axes.transpose();
  return most > 0 && m.moments.minCoeff() >= -rounding * most && m.axes.determinant() > 0 &&
         m.axes.isUnitary(rounding) && (inertia - m.inertia).cwiseAbs().maxCoeff() <= rounding * most;
}

}  // namespace padder
