// SPDX-License-Identifier: MIT
// Bytes to triangles, and the sphere of each against the definition: through its three corners with a cap of
// the depth ratio times the circumradius, or over a sliver.
#include "padding/by_depth/fit.h"

#include <Eigen/Geometry>
#include <cmath>

#include "tests/fuzz/targets.h"

namespace padder::fuzz {

void fit_balls(std::string_view raw) {
  Bytes bytes(raw);
  const double depth = (1 + bytes.take<std::uint8_t>()) / 256.0,
               limit = std::ldexp(1.0, int(bytes.below(24)) - 4);
  Mesh mesh;
  const std::uint32_t n = 3 + bytes.below(30);
  const double unit = bytes.below(2) ? 1 : 1.0 / 3;
  for (std::uint32_t k = 0; k < n; k++)
    mesh.points.emplace_back(unit * bytes.take<std::int8_t>(), unit * bytes.take<std::int8_t>(),
                             unit * bytes.take<std::int8_t>());
  for (std::uint32_t k = 0; k < n && !bytes.empty(); k++)
    mesh.triangles.push_back({bytes.below(n), bytes.below(n), bytes.below(n)});
  const std::vector<FittedBall> balls = fit(mesh, depth, limit);
  if (balls.size() != mesh.triangles.size()) wrong("not one ball for each triangle");
  for (std::size_t t = 0; t < balls.size(); t++) {
    const Ball& ball = balls[t].ball;
    const std::string which = "triangle " + std::to_string(t) + ": ";
    if (balls[t].triangle != t || !ball.center.allFinite() || !std::isfinite(ball.radius))
      wrong(which + "no ball");
    Point p[3];
    for (int k = 0; k < 3; k++) p[k] = mesh.points[mesh.triangles[t][static_cast<std::size_t>(k)]];
    const Vector a = p[1] - p[0], b = p[2] - p[0];
    const double area2 = a.cross(b).norm(), longest = std::max({a.norm(), b.norm(), (b - a).norm()});
    const double circumradius = area2 > 0 ? a.norm() * b.norm() * (b - a).norm() / (2 * area2) : INFINITY;
    const double slack = 1e-7 * (ball.radius + longest);
    const bool sliver = circumradius > limit;
    for (const Point& corner : p) {
      const double off = (corner - ball.center).norm() - ball.radius;
      if (off > slack || (!sliver && std::abs(circumradius - limit) > 1e-6 * limit && off < -slack))
        wrong(which + "a corner is off by " + std::to_string(off));
    }
    if (sliver || area2 < 1e-9) continue;
    const double cap = (ball.center - p[0]).dot(a.cross(b) / area2) + ball.radius;
    if (std::abs(circumradius - limit) > 1e-6 * limit && std::abs(cap - depth * circumradius) > 10 * slack)
      wrong(which + "the cap is " + std::to_string(cap) + " and not " + std::to_string(depth * circumradius));
  }
}

}  // namespace padder::fuzz
