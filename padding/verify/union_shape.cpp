// SPDX-License-Identifier: MIT
#include "padding/verify/union_shape.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "padding/verify/sphere_points.h"

namespace padder {
namespace {

struct Sums {
  double volume = 0, outside = 0, protrusion = 0, facing = 0, angle = 0;
};

// Over the points of one ball that no other ball contains.
Sums sums_of(const Surface& surface, const BallSet& set, std::uint32_t index, std::int64_t n) {
  const Ball& ball = set.balls()[index];
  const double weight = 4 * std::numbers::pi * ball.radius * ball.radius / static_cast<double>(n);
  const double skin = 1e-9 * ball.radius;
  Sums sums;
  for (std::int64_t k = 0; k < n; k++) {
    const Vector normal = sphere_point(k, n);
    const Point x = ball.center + ball.radius * normal;
    if (set.any_contains(x, skin)) continue;
    sums.volume += weight * x.dot(normal) / 3;
    const Nearest at = surface.signed_nearest(x);
    if (at.distance > 0) sums.outside += weight, sums.protrusion += weight * at.distance;
    // Balls deep inside the body may leave a hollow between them. Its walls face no surface, so they have no
    // normal error.
    if (at.distance < -0.5 * ball.radius) continue;
    sums.facing += weight;
    sums.angle += weight * std::acos(std::clamp(normal.dot(at.normal), -1.0, 1.0));
  }
  return sums;
}

// Mean gap over the surface. Each triangle is sampled on a lattice, and its samples share its area.
double mean_gap(const Mesh& mesh, const BallSet& set, std::int64_t samples) {
  const double area = mesh.area();
  const std::int64_t n = static_cast<std::int64_t>(mesh.triangles.size());
  std::vector<double> sums(mesh.triangles.size());
#pragma omp parallel for schedule(dynamic, 256)
  for (std::int64_t t = 0; t < n; t++) {
    const auto triangle = static_cast<std::size_t>(t);
    const double own = mesh.area_normal(triangle).norm();
    const int m = 1 + static_cast<int>(std::sqrt(own / area * static_cast<double>(samples)));
    const Point& a = mesh.corner(triangle, 0);
    const Vector u = (mesh.corner(triangle, 1) - a) / m, v = (mesh.corner(triangle, 2) - a) / m;
    double sum = 0;  // over the centroids of m^2 equal parts
    for (int i = 0; i < m; i++)
      for (int j = 0; i + j < m; j++) {
        sum += std::max(0.0, set.gap(a + (i + 1 / 3.0) * u + (j + 1 / 3.0) * v).value);
        if (i + j + 1 < m) sum += std::max(0.0, set.gap(a + (i + 2 / 3.0) * u + (j + 2 / 3.0) * v).value);
      }
    sums[triangle] = own * sum / (m * m);
  }
  double sum = 0;
  for (double s : sums) sum += s;
  return area > 0 ? sum / area : 0;
}

}  // namespace

UnionShape union_shape(const Surface& surface, const std::vector<Ball>& balls, std::int64_t samples) {
  const BallSet set(balls);
  double area = 0;
  for (const Ball& ball : balls) area += ball.radius * ball.radius;
  std::vector<Sums> each(balls.size());
#pragma omp parallel for schedule(dynamic, 4)
  for (std::size_t k = 0; k < balls.size(); k++) {
    if (!(balls[k].radius > 0)) continue;
    const double share = balls[k].radius * balls[k].radius / area;
    each[k] = sums_of(surface, set, static_cast<std::uint32_t>(k),
                      24 + static_cast<std::int64_t>(share * static_cast<double>(samples)));
  }
  Sums all;
  for (const Sums& s : each) {
    all.volume += s.volume, all.outside += s.outside, all.protrusion += s.protrusion;
    all.facing += s.facing, all.angle += s.angle;
  }
  UnionShape shape;
  shape.volume = all.volume;
  if (all.outside > 0) shape.protrusion = all.protrusion / all.outside;
  if (all.facing > 0) shape.normal_error = all.angle / all.facing * 180 / std::numbers::pi;
  shape.gap = mean_gap(surface.mesh(), set, samples);
  return shape;
}

}  // namespace padder
