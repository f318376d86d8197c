// SPDX-License-Identifier: GPL-3.0-or-later
// The way of the paper: remesh, fit a sphere to each triangle, and refit what stands out.
#include <algorithm>
#include <numbers>
#include <utility>

#include "padding/asset/error.h"
#include "padding/asset/excerpt.h"
#include "padding/by_depth/refit.h"
#include "padding/by_tolerance/thin_balls.h"
#include "padding/geometry/medial.h"
#include "padding/pad_steps.h"

namespace padder {
namespace {

// The radius of the middle one of some hundred medial balls below the surface, which is close to `remeshed`.
double middle_medial_radius(const Surface& surface, const Mesh& remeshed, double tolerance) {
  constexpr std::size_t places = 500;
  const std::size_t stride = 1 + remeshed.triangles.size() / places;
  std::vector<double> radii;
  for (std::size_t t = 0; t < remeshed.triangles.size(); t += stride) {
    const Vector normal = remeshed.area_normal(t).normalized();
    const Point p = surface.nearest(remeshed.middle(t)).point;
    radii.push_back(inner_medial_ball(surface, p, normal, surface.bounds().diagonal(), tolerance).radius);
  }
  const auto middle = radii.begin() + static_cast<std::ptrdiff_t>(radii.size() / 2);
  std::nth_element(radii.begin(), middle, radii.end());
  return *middle;
}

// On a flat, a ball covers a disc of the radius sqrt(4 r gap) with the radius r of its medial ball. So a tiny
// depth ratio needs spheres without end: two to four times as many as these discs were needed for parts of
// machines, because edges need more.
void check_feasible(const PadJob& job, const Mesh& remeshed, const std::vector<FittedBall>& fitted) {
  const Surface& surface = job.surface;
  if (!surface.closed() || job.options.force) return;
  double gap = 0;
  for (const FittedBall& f : fitted) gap = std::max(gap, f.cap);
  constexpr double million = 1e6, times_as_many = 4;
  const double most = std::max(million, times_as_many * static_cast<double>(fitted.size()));
  const auto needed = [&](double r) { return surface.mesh().area() / (4 * std::numbers::pi * r * gap); };
  if (needed(gap) <= most) return;
  if (const double n = needed(middle_medial_radius(surface, remeshed, 0.25 * gap) + gap); n > most)
    throw Error(
        "a depth ratio of " + short_number(job.options.depth_ratio_used(), 3) + " would need more than " +
        short_number(n / million, 2) +
        " million spheres: use a larger --depth, or --tolerance; --force (force=True in Python) tries it");
}

Mesh remeshed_body(const PadJob& job) {
  const Repaired& body = job.body;
  PadReport& report = job.report;
  // Folded walls have much surface in a small box: whoever waits is told how much work that is.
  const std::uint64_t expected = expected_triangles(body.mesh, job.edge_length);
  constexpr std::uint64_t most = 100'000'000;  // an hour of remeshing
  if (expected > most && !job.options.force)
    throw Error("edges of this length would make about " + counted(expected, "triangle") +
                ": use a larger --edge-length, or --tolerance; --force (force=True in Python) tries it");
  job.step(("remesh to about " + counted(expected, "triangle")).c_str(), 1);
  RemeshOptions remeshing;
  remeshing.edge_length = job.edge_length;
  remeshing.sharp_angle = body.kind == BodyKind::wrap ? 180 : job.options.sharp_angle;
  if (body.solid) remeshing.slivers = 0.02;  // a cap of depth ratio 0.2 is six times as high
  Remeshed remeshed = remesh(body.mesh, remeshing);
  report.quality = remeshed.quality;
  report.quality.circumradius_max *= report.diagonal;
  report.triangles_remeshed = remeshed.mesh.triangles.size();
  report.edge_length = job.edge_length * report.diagonal;
  report.seconds.remesh = job.clock.lap();
  return std::move(remeshed.mesh);
}

// None where all of the body is thinner than a sliver.
std::vector<FittedBall> fitted_balls(const PadJob& job, const Mesh& remeshed) {
  if (remeshed.triangles.empty()) return {};
  job.step("fit", 2);
  std::vector<FittedBall> fitted = fit(remeshed, job.options.depth_ratio_used(), job.edge_length);
  job.report.seconds.fit = job.clock.lap();
  check_feasible(job, remeshed, fitted);
  job.step("refit", 3);
  const auto tell = [&](std::size_t open) {
    job.step(("refit, " + counted(open, "part") + " of the surface open").c_str(), 3);
  };
  fitted = refit(job.surface, remeshed, std::move(fitted), {.tell = tell});
  job.report.seconds.refit = job.clock.lap();
  return fitted;
}

}  // namespace

double edge_length_by_depth(const PadOptions& options, double diagonal) {
  if (options.edge_length.given()) return options.edge_length.in_unit_frame(diagonal);
  constexpr double cap = 1.0 / 400;  // an equilateral triangle of edge L has the circumradius L / sqrt(3)
  return std::clamp(std::numbers::sqrt3 * cap / options.depth_ratio_used(), 0.002, 0.05);
}

RungSpheres spheres_by_depth(const PadJob& job, const Length& tolerance) {
  RungSpheres made;
  made.mesh = remeshed_body(job);
  std::vector<FittedBall> fitted = fitted_balls(job, made.mesh);
  job.step("cull", 4);
  if (const double asked = tolerance.in_unit_frame(job.frame.scale()); asked > 0) {
    std::vector<Ball> balls;
    for (const FittedBall& f : fitted) balls.push_back(f.ball);
    std::vector<FittedBall> kept;
    for (const auto k :
         thin_balls(job.surface, balls, gap_left(asked, job.chord_error()), job.options.effort))
      kept.push_back(fitted[k]);
    fitted.swap(kept);
  }
  for (const FittedBall& f : fitted) made.balls.push_back(f.ball), made.triangle.push_back(f.triangle);
  made.why = "the spheres of the depth ratio stand out farther, or leave more open";
  job.report.seconds.cull += job.clock.lap();
  return made;
}

}  // namespace padder
