// SPDX-License-Identifier: MIT
#include "padding/geometry/medial.h"

#include <algorithm>
#include <cmath>

namespace padder {

namespace {

struct Touching {
  Ball ball;
  Point at;  // the surface point nearest to the centre; p where there is no ball
};

// Gives up as soon as the ball is smaller than `least`.
Touching ball_below(const Surface& surface, const Point& p, const Vector& normal, double largest,
                    double tolerance, double guess, double least, const Ball& inner) {
  // In practice a step at least halves the surplus, but on noisy surfaces the steps may be tiny. After so
  // many steps the radius also falls by a fixed share, so the loop ends at r <= tolerance at the latest.
  constexpr int patience = 24;
  // Starts with a ball of a few tolerances and doubles it while it is empty. The largest ball would start far
  // outside a thin body, where queries cost most.
  double r = std::min(largest, guess > 0 ? guess : std::max(32 * tolerance, largest / 64));
  // Beside a sheet there is no room inside; the ball sits on it.
  const auto on_sheet = [&] {
    return Touching{{p, std::min(largest, surface.half_thickness(surface.nearest(p).triangle))}, p};
  };
  // A point in a thick sheet is outside, too: a ball grown there would be smaller than the one on the sheet.
  const auto outside = [&](const Nearest& at) {
    return !at.inside && at.distance > -surface.half_thickness(at.triangle);
  };
  // Without a hull, one query finds what the ball holds, and what it touches if it holds nothing: p is not
  // farther than its radius.
  const bool both = !surface.hull();
  const auto signed_nearest = [&](const Point& c, const Nearest& at) {
    const bool known = both && (c - inner.center).squaredNorm() < inner.radius * inner.radius;
    return surface.with_side(c, std::isfinite(at.distance) ? at : surface.nearest(c), known);
  };
  Nearest touched;
  bool growing = r < largest, inside = false;
  for (int step = 0; r > std::max(tolerance, least);) {
    const Point c = p - r * normal;
    const Nearest hit = both ? surface.nearest(c, r * (1 + 1e-9)) : surface.clearance(c, r - tolerance);
    if (!(hit.distance < r - tolerance)) {
      touched = hit;
      if (!growing) break;
      // A wall that is thinner than the tolerance is not seen: the ball would grow through all of a hollow
      // behind it. No larger ball has its centre on another side, because it holds this one.
      if (!inside && outside(signed_nearest(c, touched))) return on_sheet();
      inside = true;
      r = std::min(largest, 2 * r), growing = r < largest;
      continue;
    }
    growing = false, touched = {};
    // The next ball passes through p and the point that was hit, with its centre on the ray. The height is
    // positive because the point lies inside the ball of radius r; only rounding can spoil that.
    const Vector d = p - hit.point;
    const double height = d.dot(normal);
    const double next = height > 0 ? d.squaredNorm() / (2 * height) : 0;
    r = std::min(next, step++ < patience ? r : 0.8 * r);
  }
  if (r < least) return {{p, 0}, p};
  const Point c = p - r * normal;
  const Nearest at = signed_nearest(c, touched);
  if (outside(at)) return on_sheet();
  // In a hull p may lie far inside, and the ball around c with it.
  const double radius = at.inside ? std::min(-at.distance, largest) : 0;
  if (!(r <= radius + tolerance)) return {{p, 0}, p};
  return {{c, radius}, at.point};
}

// On a rough surface, as that of a scan, p lies on a slope of the noise, and what stops the ball below p is
// beside p. The ball below the point that stopped it holds the first one, and is larger.
Ball ball_below_roughness(const Surface& surface, const Point& p, const Vector& normal, double largest,
                          double tolerance, double guess, const Ball& inner) {
  constexpr double same_side = 0.5;  // cosine: farther apart, the two points lie on two walls of the body
  constexpr double worth_it = 1.05;  // times the radius: less is not worth the queries of a step
  constexpr int most_steps = 8;
  Touching best = ball_below(surface, p, normal, largest, tolerance, guess, 0, inner);
  for (int step = 0; step < most_steps; step++) {
    const auto& [ball, at] = best;
    const Vector out = (at - ball.center) / ball.radius;
    const bool beside = out.dot(normal) > same_side && (at - p).squaredNorm() > tolerance * tolerance;
    if (!beside) break;
    const double least = worth_it * ball.radius;
    const Touching next =
        ball_below(surface, at, out, largest, tolerance, 1.5 * ball.radius + tolerance, least, ball);
    const double miss = (p - next.ball.center).norm() - next.ball.radius;
    const bool on_sheet = next.ball.center == at;
    if (on_sheet || !(next.ball.radius > least) || miss > 2 * tolerance) break;
    best = next;
  }
  return best.ball;
}

}  // namespace

Ball inner_medial_ball(const Surface& surface, const Point& p, const Vector& normal, double largest,
                       double tolerance, double guess, const Ball& inner) {
  if (!surface.has_inside()) return {p, std::min(largest, surface.half_thickness(0))};
  const Ball ball = ball_below_roughness(surface, p, normal, largest, tolerance, guess, inner);
  if (!surface.hull()) return ball;
  // Triangles in a hull may be turned at random.
  const Ball other = ball_below_roughness(surface, p, -normal, largest, tolerance, guess, inner);
  return other.radius > ball.radius ? other : ball;
}

}  // namespace padder
