// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/search/grow.h"

#include <algorithm>

#include "padding/geometry/medial.h"

namespace padder {
namespace {

// The point of a triangle that is the farthest from its edges.
Point incentre(const std::array<Point, 3>& corner) {
  std::array<double, 3> opposite;
  double around = 0;
  for (std::size_t k = 0; k < 3; k++)
    around += opposite[k] = (corner[(k + 1) % 3] - corner[(k + 2) % 3]).norm();
  return (opposite[0] * corner[0] + opposite[1] * corner[1] + opposite[2] * corner[2]) / around;
}

Vector random_step(Random& random, double most) {  // along each axis
  Vector step;
  for (int axis = 0; axis < 3; axis++) step[axis] = (2 * random.uniform() - 1) * most;
  return step;
}

}  // namespace

Ball BallGrower::medial(const Point& p, std::uint32_t triangle, double guess, const Ball& inner) const {
  const Vector normal = surface_.mesh().area_normal(triangle).normalized();
  const Ball ball = inner_medial_ball(surface_, p, normal, limits_.largest_inner_distance,
                                      kMedialTolerance * limits_.tolerance_sum, guess, inner);
  return allows(ball) ? ball : ball_beside(p, triangle).value_or(ball);
}

// Is the medial ball of q certainly smaller than the smallest that may be chosen? An empty ball at least as
// large would hold this one, which also touches q. One query tells where the search for the ball takes ten.
bool BallGrower::too_narrow(const Point& q, const Vector& normal, double tolerance) const {
  if (surface_.hull() || surface_.half_thickness() > 0) return false;  // there the ball may lie elsewhere
  const double least = limits_.min_radius - limits_.protrusion;
  return surface_.any_within(q - least * normal, (1 - 1e-9) * (least - 2 * tolerance));
}

// The ball that touches another surface point q covers p if q is within the tolerance sum of p:
// |p - c| <= |p - q| + |q - c|, and |q - c| is the radius of the inner ball. Within a face there is such a
// ball, and on the whole it is the larger, the farther q is from p. So far points are tried first. The
// triangle of p may be too thin to have room for q: so others beside it are tried, too.
std::optional<Ball> BallGrower::ball_beside(const Point& p, std::uint32_t triangle) const {
  constexpr int places = 8;          // at each distance
  constexpr double nearer = 0.7;     // from one distance to the next
  constexpr double kept_back = 0.1;  // share of the tolerance sum: what is around p must be covered, too
  // How far the ball may miss q, as a share of the way there. At the tip of a needle the ball is tiny.
  constexpr double medial_tolerance = 1e-7;
  const double sum = limits_.tolerance_sum;
  if (room_.none_within(p, sum)) return std::nullopt;
  const double farthest = 2 * std::max(sum, limits_.min_radius);
  const double nearest = std::max(0.01 * sum, 0.5 * (limits_.min_radius - limits_.protrusion));
  const Vector inward = incentre(surface_.mesh().corners(triangle)) - p;
  Random random(1);
  for (double away = farthest; away > nearest; away *= nearer)
    for (int k = 0; k < places; k++) {
      Nearest q;
      if (k == 0)
        q.point = p + std::min(1.0, away / inward.norm()) * inward, q.triangle = triangle;
      else
        q = surface_.nearest(p + random_step(random, away));
      const double miss = medial_tolerance * (q.point - p).norm();
      if (!(miss > 0)) continue;
      const Vector normal = surface_.mesh().area_normal(q.triangle).normalized();
      if (too_narrow(q.point, normal, miss)) continue;
      const Ball ball = inner_medial_ball(surface_, q.point, normal, limits_.largest_inner_distance, miss);
      if (allows(ball) && (p - ball.center).norm() <= ball.radius + (1 - kept_back) * sum) return ball;
    }
  return std::nullopt;
}

void BallGrower::propose(const Point& p, std::uint32_t triangle, const Ball& medial,
                         std::vector<Candidate>& candidates) const {
  if (allows(medial))
    candidates.push_back({{medial.center, medial.radius + limits_.protrusion}, medial.radius, p, triangle});
}

void BallGrower::try_place(const Candidate& beside, double most, Random& random,
                           std::vector<Candidate>& candidates) const {
  const Nearest at = surface_.nearest(beside.point + random_step(random, most));
  const double guess = 1.1 * beside.inner_distance + 0.5 * limits_.tolerance_sum;
  // A ball that sits on a sheet is not inside; on a thick one, it may have been grown for another point.
  const bool inside = beside.ball.center != beside.point && !(surface_.half_thickness() > 0);
  const Ball inner{beside.ball.center, inside ? beside.inner_distance : 0};
  propose(at.point, at.triangle, medial(at.point, at.triangle, guess, inner), candidates);
}

}  // namespace padder
