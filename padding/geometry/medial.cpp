// SPDX-License-Identifier: MIT
#include "padding/geometry/medial.h"

#include <cmath>

namespace padder {

namespace {

Ball ball_below(const Surface& surface, const Point& p, const Vector& normal, double largest,
                double tolerance, double guess) {
  // In practice a step at least halves the surplus, but on noisy surfaces the steps may be tiny. After so
  // many steps the radius also falls by a fixed share, so the loop ends at r <= tolerance at the latest.
  constexpr int patience = 24;
  // Starts with a ball of a few tolerances and doubles it while it is empty. The largest ball would start far
  // outside a thin body, where queries cost most.
  double r = std::min(largest, guess > 0 ? guess : std::max(32 * tolerance, largest / 64));
  // Beside a sheet there is no room inside; the ball sits on it.
  const auto on_sheet = [&] { return Ball{p, surface.half_thickness(surface.nearest(p).triangle)}; };
  bool growing = r < largest, inside = false;
  for (int step = 0; r > tolerance;) {
    const Point c = p - r * normal;
    const Nearest hit = surface.clearance(c, r - tolerance);
    if (!(hit.distance < r - tolerance)) {
      if (!growing) break;
      // A wall that is thinner than the tolerance is not seen: the ball would grow through all of a hollow
      // behind it. No larger ball has its centre on another side, because it holds this one.
      if (!inside && surface.signed_nearest(c).distance > 0) return on_sheet();
      inside = true;
      r = std::min(largest, 2 * r), growing = r < largest;
      continue;
    }
    growing = false;
    // The next ball passes through p and the point that was hit, with its centre on the ray. The height is
    // positive because the point lies inside the ball of radius r; only rounding can spoil that.
    const Vector d = p - hit.point;
    const double height = d.dot(normal);
    const double next = height > 0 ? d.squaredNorm() / (2 * height) : 0;
    r = std::min(next, step++ < patience ? r : 0.8 * r);
  }
  const Point c = p - r * normal;
  const Nearest at = surface.signed_nearest(c);
  if (at.distance > 0) return on_sheet();
  const double radius = -at.distance;
  if (!(r <= radius + tolerance)) return {p, 0};
  return {c, radius};
}

}  // namespace

Ball inner_medial_ball(const Surface& surface, const Point& p, const Vector& normal, double largest,
                       double tolerance, double guess) {
  if (!surface.has_inside()) return {p, surface.half_thickness(0)};
  const Ball ball = ball_below(surface, p, normal, largest, tolerance, guess);
  if (!surface.hull()) return ball;
  // Triangles in a hull may be turned at random.
  const Ball other = ball_below(surface, p, -normal, largest, tolerance, guess);
  return other.radius > ball.radius ? other : ball;
}

}  // namespace padder
