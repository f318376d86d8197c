// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/search/grow.h"

#include "padding/geometry/medial.h"

namespace padder {

Ball BallGrower::medial(const Point& p, std::uint32_t triangle, double guess, const Ball& inner) const {
  const Vector normal = surface_.mesh().area_normal(triangle).normalized();
  const Ball ball = inner_medial_ball(surface_, p, normal, limits_.largest_inner_distance,
                                      kMedialTolerance * limits_.tolerance_sum, guess, inner);
  if (ball.radius + limits_.protrusion > 0) return ball;
  // In a sharp corner no ball inside the body touches p. But one covers it whose centre is pushed off the
  // walls there, of which there may be three, by a part of the gap each.
  for (double push = 0.25 * limits_.gap; push > 1e-4 * limits_.gap; push *= 0.5) {
    Point c = p - push * normal;
    for (int wall = 0; wall < 3; wall++) {
      const Nearest at = surface_.signed_nearest(c);
      if (-at.distance >= 0.1 * push) return {c, -at.distance};
      c -= push * at.normal;
    }
  }
  return ball;
}

void BallGrower::propose(const Point& p, std::uint32_t triangle, const Ball& medial,
                         std::vector<Candidate>& candidates) const {
  const double radius = medial.radius + limits_.protrusion;
  if (radius > 0 && radius >= limits_.min_radius)
    candidates.push_back({{medial.center, radius}, medial.radius, p, triangle});
}

void BallGrower::try_place(const Candidate& beside, double most, Random& random,
                           std::vector<Candidate>& candidates) const {
  Vector step;
  for (int axis = 0; axis < 3; axis++) step[axis] = (2 * random.uniform() - 1) * most;
  const Nearest at = surface_.nearest(beside.point + step);
  const double guess = 1.1 * beside.inner_distance + 0.5 * limits_.tolerance_sum;
  // A ball that sits on a sheet is not inside.
  const bool inside = beside.ball.center != beside.point;
  const Ball inner{beside.ball.center, inside ? beside.inner_distance : 0};
  propose(at.point, at.triangle, medial(at.point, at.triangle, guess, inner), candidates);
}

}  // namespace padder
