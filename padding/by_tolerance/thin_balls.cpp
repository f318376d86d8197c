// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/thin_balls.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "padding/by_tolerance/cover.h"
#include "padding/by_tolerance/search/block_search.h"
#include "padding/by_tolerance/search/cover_problem.h"
#include "padding/verify/certify.h"

namespace padder {
namespace {

// Share of a point's own margin: there are no new balls to mend what the points miss.
constexpr double kThinningMargin = 0.5;
constexpr std::array<double, 3> kExchanges = {100, 200, 400};  // for each ball; of efforts 1 to 3

}  // namespace

std::vector<std::uint32_t> thin_balls(const Surface& surface, const std::vector<Ball>& balls, double gap,
                                      int effort) {
  const double bound = gap * (1 - kKeptBack);
  const double steps = effort > 0 ? kExchanges[static_cast<std::size_t>(std::min(effort, 3) - 1)] : 0;
  std::vector<Candidate> candidates(balls.size());
#pragma omp parallel for schedule(dynamic, 64)
  for (std::size_t k = 0; k < balls.size(); k++)
    candidates[k] = {balls[k], std::max(0.0, -surface.signed_nearest(balls[k].center).distance),
                     balls[k].center, 0};
  SampleOptions sampling;
  sampling.tolerance_sum = gap, sampling.coarse_density = sampling.fine_density = effort > 0 ? 6 : 4;
  // What these balls cover depends on their sizes and not on the local thickness.
  sampling.largest = 0;
  for (const Candidate& c : candidates) sampling.largest = std::max(sampling.largest, c.inner_distance);
  Samples samples = sample_surface(surface, sampling);
  for (CoverPoint& point : samples.fine) point.margin *= kThinningMargin;
  CoverProblem problem(bound);
  problem.add(samples.fine, candidates);

  std::vector<std::uint32_t> chosen;
  const BallSet all(balls);
  std::vector<Point> places;
  for (const Ball& ball : balls) places.push_back(ball.center);
  for (std::uint64_t round = 1;; round++) {
    const Sets sets = problem.sets();
    SetCover cover(sets, problem.points().size());
    cover.greedy(chosen);
    chosen = cover.best();
    if (steps > 0)
      chosen = improve_in_blocks(sets, problem.points().size(), places, chosen,
                                 {.steps = steps * std::pow(0.7, round - 1), .seed = round});
    std::vector<Ball> kept;
    for (auto k : chosen) kept.push_back(balls[k]);
    // Where the chosen balls leave a gap that others would close, those spots become points to cover. Beside
    // surface that no ball covers, the certificate may fail in the notch between two balls without knowing a
    // point that fails. Such a spot is skipped.
    std::vector<CoverPoint> points;
    for (const GapPart& part : gap_failures(surface.mesh(), BallSet(kept), bound, 0.1 * gap))
      if (part.value > bound && all.gap(part.point).value <= bound * (1 - kKeptBack))
        points.push_back({part.point, 0});
    if (points.empty()) return chosen;
    problem.add(points, {});
  }
}

}  // namespace padder
