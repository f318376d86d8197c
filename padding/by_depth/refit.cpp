// SPDX-License-Identifier: MIT
#include "padding/by_depth/refit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "padding/geometry/indices.h"
#include "padding/geometry/medial.h"
#include "padding/geometry/point_tree.h"
#include "padding/geometry/triangle.h"
#include "padding/verify/certify.h"

namespace padder {
namespace {

constexpr std::size_t kManyOpen = 100'000;  // parts
constexpr std::size_t kAnyNumber = std::numeric_limits<std::size_t>::max();

Ball ball_under(const Surface& body, const Point& p, const Vector& normal, double largest, double cap) {
  // The medial ball may miss p by a quarter of the cap, because the dilated ball still covers p.
  Ball ball = inner_medial_ball(body, p, normal, largest, 0.25 * cap);
  if (ball.radius > 0) ball.radius += cap;
  return ball;
}

void refit_one(const Surface& body, const Mesh& remeshed, FittedBall& fitted) {
  const double cap = fitted.cap, below = fitted.ball.radius - cap;
  const double side = body.signed_nearest(fitted.ball.center).distance;
  if (side <= 0 && -side >= below - 1e-9 * fitted.ball.radius) return;  // the paper's sphere will do
  const auto& t = remeshed.triangles[fitted.triangle];
  const Triangle3 tri{remeshed.points[t[0]], remeshed.points[t[1]], remeshed.points[t[2]]};
  const Nearest touch = body.nearest(tri.enclosing_circle().center);
  Ball ball = ball_under(body, touch.point, tri.area_normal().normalized(), below, cap);
  if (ball.radius == 0)
    ball = ball_under(body, touch.point, body.signed_nearest(touch.point).normal, below, cap);
  fitted.ball = ball;
}

// The radius of the disc that the middle one of the balls covers, the smaller of two counting as the middle.
double middle_reach(const std::vector<FittedBall>& balls, double gap) {
  std::vector<double> reach;
  for (const auto& [ball, cap, triangle] : balls) {
    const double below = ball.radius - gap;
    reach.push_back(std::sqrt((ball.radius + gap) * (ball.radius + gap) - below * below));
  }
  const auto middle = reach.begin() + static_cast<std::ptrdiff_t>((reach.size() - 1) / 2);
  std::nth_element(reach.begin(), middle, reach.end());
  return *middle;
}

}  // namespace

std::vector<FittedBall> refit(const Surface& body, const Mesh& remeshed, std::vector<FittedBall> balls,
                              const RefitOptions& options) {
  double gap = options.gap;
  if (gap == 0)
    for (const auto& b : balls) gap = std::max(gap, b.cap);
  double largest = 0;
  for (const auto& b : balls) largest = std::max(largest, b.ball.radius);

#pragma omp parallel for schedule(dynamic, 64)
  for (std::int64_t k = 0; k < static_cast<std::int64_t>(balls.size()); k++) {
    refit_one(body, remeshed, balls[k]);
    // Rounding may leave a side open. What such a ball would cover, another one will.
    if (!has_centre_inside(body, balls[k].ball)) balls[k].ball.radius = 0;
  }
  std::erase_if(balls, [](const FittedBall& b) { return b.ball.radius == 0; });

  const Surface triangles(remeshed);
  constexpr int most_rounds = 30;
  // A ball covers a disc that is much wider than the gap. Where nearly all is open, as under flat caps on a
  // coarse mesh, points that stand apart by the gap alone would be millions: the first rounds look at larger
  // parts and take few points, until the distance is that which the balls of the round before cover.
  double wide = 32 * gap;
  std::vector<GapPart> open = whole_triangles(body.mesh());
  for (int round = 0; round < most_rounds; round++) {
    std::vector<Ball> plain;
    for (const auto& b : balls) plain.push_back(b.ball);
    const BallSet set(plain);
    auto failures = wide > gap ? gap_failures(open, set, gap, 2 * gap, kManyOpen) : std::nullopt;
    const double spacing = failures ? gap : wide;
    if (!failures) failures = gap_failures(open, set, gap, std::max(2 * gap, wide), kAnyNumber);
    open = *std::move(failures);
    if (open.empty()) break;
    if (options.tell) options.tell(open.size());
    std::vector<std::uint32_t> order = numbered(open.size());
    std::stable_sort(order.begin(), order.end(),
                     [&](auto a, auto b) { return open[a].value > open[b].value; });
    std::vector<Point> places;
    for (const GapPart& part : open) places.push_back(part.centroid());
    // Of neighbouring parts only the worst gets a ball in this round: it may cover the others, too.
    const std::vector<std::uint32_t> chosen = sparse(places, order, spacing);
    std::vector<FittedBall> found(chosen.size());
#pragma omp parallel for schedule(dynamic, 16)
    for (std::int64_t k = 0; k < static_cast<std::int64_t>(chosen.size()); k++) {
      const Point& p = places[chosen[k]];
      const Vector normal = body.mesh().area_normal(open[chosen[k]].triangle).normalized();
      found[k] = {ball_under(body, p, normal, largest, gap), gap, triangles.nearest(p).triangle};
      if (found[k].ball.radius == 0 || !has_centre_inside(body, found[k].ball))
        found[k].ball = {p, gap};  // on a knife's edge
    }
    balls.insert(balls.end(), found.begin(), found.end());
    wide = std::max(gap, std::min(wide / 2, middle_reach(found, gap)));
  }
  return balls;
}

}  // namespace padder
