// SPDX-License-Identifier: MIT
#include "padding/verify/accuracy.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "padding/verify/certify.h"
#include "padding/verify/sphere_points.h"

namespace padder {
namespace {

struct Weighted {
  double value, weight;
};

struct Summary {
  double max = 0, mean = 0, p95 = 0;
};

Summary summarize(std::vector<Weighted>& samples) {
  Summary s;
  if (samples.empty()) return s;
  std::sort(samples.begin(), samples.end(),
            [](const Weighted& a, const Weighted& b) { return a.value < b.value; });
  double weight = 0, sum = 0;
  for (const auto& w : samples) weight += w.weight, sum += w.weight * w.value;
  s.max = samples.back().value, s.mean = weight > 0 ? sum / weight : 0;
  double seen = 0;
  for (const auto& w : samples)
    if ((seen += w.weight) >= 0.95 * weight) {
      s.p95 = w.value;
      break;
    }
  return s;
}

// Points spread evenly over the surface; each stands for the same area. Their places within the triangles
// come from a sequence of low discrepancy (Roberts, The unreasonable effectiveness of quasirandom sequences,
// 2018), because spheres often follow the triangles: centroids are covered best of all, and corners worst.
std::vector<Point> surface_points(const Mesh& mesh, std::int64_t count) {
  std::vector<double> area(mesh.triangles.size());  // of the triangles up to this one
  double sum = 0;
  for (std::size_t t = 0; t < area.size(); t++) area[t] = sum += mesh.area_normal(t).norm();
  std::vector<Point> points;
  if (!(sum > 0)) return points;
  const auto fraction = [](double x) { return x - std::floor(x); };
  std::size_t t = 0;
  for (std::int64_t k = 0; k < count; k++) {
    while (t + 1 < area.size() && area[t] <= sum * (double(k) + 0.5) / double(count)) t++;
    double u = fraction(0.7548776662466927 * double(k)), v = fraction(0.5698402909980532 * double(k));
    if (u + v > 1) u = 1 - u, v = 1 - v;
    const Point& a = mesh.corner(t, 0);
    points.push_back(a + u * (mesh.corner(t, 1) - a) + v * (mesh.corner(t, 2) - a));
  }
  return points;
}

SurfaceKind proved_against(const Repaired& body) {
  if (body.kind == BodyKind::wrap) return SurfaceKind::wrap;
  return body.filled > 0 ? SurfaceKind::filled : SurfaceKind::input;
}

struct BallSample {
  double protrusion;  // to the input; negative: not outside the body
  double angle;       // between the normals, degrees; negative: not on the outer surface
  double weight;      // area
  double volume;      // what the patch adds to the volume (divergence theorem)
};

class BallSampler {
 public:
  BallSampler(const Surface& surface, const BallSet& balls, double deepest)
      : surface_(surface), balls_(balls), deepest_(deepest), origin_(surface.bounds().center()) {}

  // The sample on this ball in the direction of `normal`, unless another ball covers it. `covering` keeps the
  // balls that covered samples of this ball: most often one of them covers the next, too.
  std::optional<BallSample> at(const Ball& ball, const Vector& normal, double weight,
                               std::vector<std::uint32_t>& covering) const {
    const Point x = ball.center + ball.radius * normal;
    // Covered means by more than rounding: a ball's own points do not count, nor points where equal balls
    // touch.
    const double margin = 1e-9 * ball.radius;
    for (const std::uint32_t k : covering)
      if (gap_to(balls_.balls()[k], x) <= -margin) return std::nullopt;
    if (const auto k = balls_.containing(x, margin)) {
      covering.push_back(*k);
      return std::nullopt;
    }
    BallSample s{-1, -1, weight, weight * (x - origin_).dot(normal) / 3};
    const Nearest body = surface_.signed_nearest(x);
    const bool outside = body.distance > 0;
    if (outside) s.protrusion = body.distance;
    if (outside || body.distance > -deepest_) {
      const double c = std::clamp(body.normal.dot(normal), -1.0, 1.0);
      if (outside || c > 0) s.angle = std::acos(c) * 180 / std::numbers::pi;
    }
    return s;
  }

 private:
  const Surface& surface_;
  const BallSet& balls_;
  // Dents of the outer surface are at most this deep. Deeper inside is the inner side of a shell.
  double deepest_;
  Point origin_;
};

}  // namespace

Measured measure(const Mesh& input, const Repaired& body, const Surface& body_surface,
                 const std::vector<Ball>& balls, const AccuracyOptions& options) {
  Measured m;
  if (balls.empty()) return m;
  Accuracy& a = m.accuracy;
  const BallSet set(balls);
  const bool wrap = body.kind == BodyKind::wrap;

  const auto points =
      surface_points(wrap || body.solid ? body_surface.mesh() : input, options.surface_samples);
  std::vector<Weighted> gaps(points.size());
  std::int64_t covered = 0;
#pragma omp parallel for schedule(dynamic, 256) reduction(+ : covered)
  for (std::size_t k = 0; k < points.size(); k++) {
    const double distance = set.gap(points[k]).value;
    gaps[k] = {std::max(distance, 0.0), 1};
    covered += distance <= 0;
  }
  const Summary gap = summarize(gaps);
  a.gap_mean = gap.mean, a.gap_p95 = gap.p95;
  a.coverage = points.empty() ? 0 : double(covered) / double(points.size());
  // Where corners were joined, the surface is as far from the input as they were moved.
  const double away = body.steps.joined_width + options.chord_error;
  a.gap_bound = gap_bound(body_surface.mesh(), set, options.floor - away).upper + away;
  // Triangles without area may lie apart from the others, so they are measured, too.
  if (!wrap) m.flat_gap = gap_bound(body.flat, set, options.floor).upper;
  a.gap_bound = std::max(a.gap_bound, m.flat_gap);
  a.gap_max = std::max(gap.max, a.gap_bound);

  const BallSampler sampler(body_surface, set, a.gap_max + 1e-6 * body_surface.bounds().diagonal());
  const std::int64_t n = options.samples_of_each_ball + options.ball_samples / std::int64_t(balls.size());
  std::vector<std::vector<BallSample>> found(balls.size());
#pragma omp parallel for schedule(dynamic)
  for (std::size_t k = 0; k < balls.size(); k++) {
    const Ball& ball = balls[k];
    const double weight = 4 * std::numbers::pi * ball.radius * ball.radius / double(n);
    std::vector<std::uint32_t> covering;
    for (std::int64_t j = 0; j < n; j++)
      if (const auto s = sampler.at(ball, sphere_point(j, n, double(k)), weight, covering))
        found[k].push_back(*s);
    // The point where the ball stands out farthest lies beyond the surface point nearest to its centre.
    const Nearest near = body_surface.signed_nearest(ball.center);
    Vector out = near.inside ? Vector(near.point - ball.center) : Vector(ball.center - near.point);
    if (out.norm() > 0)
      if (const auto s = sampler.at(ball, out.normalized(), 0, covering)) found[k].push_back(*s);
  }
  std::vector<Weighted> protrusions, angles;
  for (const auto& of_ball : found)
    for (const BallSample& s : of_ball) {
      if (s.protrusion >= 0) protrusions.push_back({s.protrusion, s.weight});
      if (s.angle >= 0) angles.push_back({s.angle, s.weight});
      m.volume_union += s.volume;
    }
  const Summary protrusion = summarize(protrusions), angle = summarize(angles);
  a.protrusion_max = protrusion.max, a.protrusion_mean = protrusion.mean, a.protrusion_p95 = protrusion.p95;
  const ProtrusionBound bound = protrusion_bound(body_surface, balls);
  // What a wrap bridges counts as body, so it is no part of the bounds of the balls. It may lie as far from
  // the input as the wrap does. So may what closes a crack, but it counts as surface.
  for (const double standoff : body.standoff) a.wrap_distance = std::max(a.wrap_distance, standoff);
  a.protrusion_bound =
      std::max({0.0, bound.max + body.steps.crack_width + body.steps.joined_width, a.wrap_distance});
  m.outside = bound.outside;
  a.protrusion_max = std::max(a.protrusion_max, a.protrusion_bound);
  if (bound.proved) a.proved_against = proved_against(body);
  a.normal_error_mean_deg = angle.mean, a.normal_error_p95_deg = angle.p95;
  if (body.kind != BodyKind::sheet) {
    const double volume = mass_properties(body.boundary()).volume;
    a.volume_ratio = volume > 0 ? m.volume_union / volume : 0;
  }
  return m;
}

}  // namespace padder
