// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/cover.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "padding/asset/error.h"
#include "padding/by_tolerance/block_search.h"
#include "padding/by_tolerance/cover_problem.h"
#include "padding/geometry/medial.h"
#include "padding/geometry/point_tree.h"
#include "padding/geometry/random.h"

namespace padder {
namespace {

// The share of a tolerance that is kept back, so that scaling to another unit does not break the proof.
constexpr double rounding = 1e-9;
// The share of a point's own margin that a ball must cover around it; late, when the certificate finds what
// the points miss, a smaller one.
constexpr double margin = 0.5, late_margin = 0.3;
constexpr double medial_tolerance = 0.05;  // share of the tolerance sum
// How far from the place of a chosen ball new ones are tried: share of the radius of the disc that it covers.
constexpr double step_size = 0.25;

// A large cover is searched longer: with more rounds and more places, and also while the certificate still
// finds spots. A small cover would gain as much, but there the seconds matter more: users can ask for a
// higher effort.
constexpr int late_moves = 4, late_places = 12, late_refinements = 8;
constexpr double late_share = 0.6;  // of the exchanges
constexpr std::array late_step_sizes = {0.5 * step_size, 1.6 * step_size};

constexpr int most_rounds = 100;

// What an effort buys.
struct EffortPlan {
  double fine_density;
  int moves;     // rounds that try new places around the chosen balls
  int places;    // tried around each ball
  double steps;  // exchanges of the local search, for each ball
};
EffortPlan plan_for(int effort) {
  constexpr EffortPlan plans[] = {{4, 0, 0, 0}, {6, 2, 8, 100}, {8, 3, 16, 150}, {10, 4, 16, 400}};
  return plans[std::clamp(effort, 0, 3)];
}

class CoverSearch {
 public:
  CoverSearch(const Surface& surface, const CoverOptions& options)
      : surface_(surface),
        mesh_(surface.mesh()),
        protrusion_(std::min(options.protrusion, options.max_radius) * (1 - rounding)),
        gap_(options.gap * (1 - rounding)),
        tolerance_sum_(protrusion_ + gap_),
        min_radius_(options.min_radius),
        largest_(std::min(options.max_radius - protrusion_, surface.bounds().diagonal())),
        large_(options.effort > 1 ? 0 : options.large),
        plan_(plan_for(options.effort)),
        problem_(gap_) {
    if (mesh_.triangles.empty()) throw Error("there is no surface to cover: the mesh has no triangles");
    if (!(tolerance_sum_ > 0)) throw Error("a cover needs a tolerance above 0");
  }

  Cover run() {
    if (single()) return finish(true);
    SampleOptions sampling;
    sampling.tolerance_sum = tolerance_sum_, sampling.largest = largest_,
    sampling.fine_density = plan_.fine_density;
    Samples samples = sample_surface(surface_, sampling);
    std::vector<Candidate> candidates;
    for (const Sample& s : samples.grown) propose(s.point, s.triangle, s.ball, candidates);
    problem_.add(with_margin(samples.coarse, margin), candidates);
    solve(1);
    for (int k = 0; k < plan_.moves; k++) {
      move(plan_.places, {step_size, step_size});
      if (k == 0) problem_.replace_points(with_margin(samples.fine, margin));
      solve(1);
    }
    const bool large = plan_.moves > 0 && chosen_.size() > large_;
    if (large) problem_.replace_points(with_margin(samples.fine, late_margin));
    for (int k = 0; large && k < late_moves; k++) {
      move(late_places, late_step_sizes);
      solve(late_share);
    }
    // About ten rounds are enough, except beside surface that a radius limit leaves open: the cap is for
    // that.
    double share = 0.4;
    for (int round = 0;; round++, share *= 0.7) {
      const std::vector<GapPart> failures =
          gap_failures(mesh_, BallSet(balls()), gap_, 0.25 * tolerance_sum_);
      if (failures.empty()) return finish(true);
      if (large && round < late_refinements) move(late_places, late_step_sizes);
      if (round == most_rounds || !refine(failures)) return finish(false);
      solve(share);
    }
  }

 private:
  void solve(double share) {
    const Sets sets = problem_.sets();
    SetCover cover(sets, problem_.points().size());
    cover.greedy(chosen_);
    chosen_ = cover.best();
    if (!(plan_.steps > 0)) return;
    std::vector<Point> places;
    for (const Candidate& c : problem_.candidates()) places.push_back(c.ball.center);
    BlockSearch search;
    search.steps = share * plan_.steps, search.seed = ++seed_;
    chosen_ = improve_in_blocks(sets, problem_.points().size(), places, chosen_, search);
  }

  Ball medial(const Point& p, std::uint32_t triangle) const {
    return inner_medial_ball(surface_, p, mesh_.area_normal(triangle).normalized(), largest_,
                             medial_tolerance * tolerance_sum_);
  }

  // Adds the medial ball, dilated by the whole protrusion, unless it is too small.
  void propose(const Point& p, std::uint32_t triangle, const Ball& medial,
               std::vector<Candidate>& candidates) const {
    const double radius = medial.radius + protrusion_;
    if (radius >= min_radius_) candidates.push_back({{medial.center, radius}, medial.radius, p, triangle});
  }

  static std::vector<CoverPoint> with_margin(std::vector<CoverPoint> points, double share) {
    for (CoverPoint& point : points) point.margin *= share;
    return points;
  }

  std::vector<Ball> balls() const {
    std::vector<Ball> balls;
    for (auto k : chosen_) balls.push_back(problem_.candidates()[k].ball);
    return balls;
  }

  // Tries one ball for everything. No cover is smaller, and this must come before any step whose cost grows
  // with the area: on a fine sphere every triangle is equally near to the centre, which makes each query
  // slow.
  bool single() {
    Random random(1);
    for (int k = 0; k < 4; k++) {
      const auto t = static_cast<std::uint32_t>(random.below(mesh_.triangles.size()));
      if (!(mesh_.area_normal(t).squaredNorm() > 0)) continue;
      const Point p = (mesh_.corner(t, 0) + mesh_.corner(t, 1) + mesh_.corner(t, 2)) / 3;
      std::vector<Candidate> candidates;
      propose(p, t, medial(p, t), candidates);
      if (candidates.empty()) continue;
      const Candidate& c = candidates[0];
      const double limit = (c.ball.radius + gap_) * (c.ball.radius + gap_);
      bool all = true;
      for (const auto& triangle : mesh_.triangles) {
        for (auto v : triangle) all = all && (mesh_.points[v] - c.ball.center).squaredNorm() <= limit;
        if (!all) break;
      }
      if (!all) continue;
      problem_.add({}, candidates);
      chosen_ = {0};
      return true;
    }
    return false;
  }

  // Makes the next problem: the chosen balls, and new medial balls at places around theirs. The places lie up
  // to away[0] and away[1], in turn, of the covered disc's radius from the place of the chosen ball.
  void move(int tries, std::array<double, 2> away) {
    const std::size_t n = chosen_.size() * static_cast<std::size_t>(tries);
    const std::uint64_t seed = ++moves_ << 40;
    std::vector<Sample> places(n);
#pragma omp parallel for schedule(dynamic, 16) if (n > 64)
    for (std::size_t k = 0; k < n; k++) {
      const Candidate& c = problem_.candidates()[chosen_[k / static_cast<std::size_t>(tries)]];
      Random random(seed + k);
      const double most = away[k % 2] * covered_disc(c.inner_distance, tolerance_sum_);
      Vector step;
      for (int axis = 0; axis < 3; axis++) step[axis] = (2 * random.uniform() - 1) * most;
      const Nearest at = surface_.nearest(c.point + step);
      places[k] = {at.point, at.triangle, medial(at.point, at.triangle)};
    }
    std::vector<Candidate> fresh;
    for (const Sample& s : places) propose(s.point, s.triangle, s.ball, fresh);
    problem_.keep(chosen_);
    std::iota(chosen_.begin(), chosen_.end(), 0u);
    problem_.add({}, fresh);
  }

  // Adds the worst failures as points to cover, each with a ball of its own that covers it. Returns false if
  // the radius limits allow no such ball.
  bool refine(const std::vector<GapPart>& failures) {
    std::vector<std::uint32_t> order(failures.size());
    std::iota(order.begin(), order.end(), 0u);
    std::stable_sort(order.begin(), order.end(),
                     [&](auto a, auto b) { return failures[a].value > failures[b].value; });
    std::vector<Point> points;
    for (const GapPart& part : failures) points.push_back(part.point);
    const PointTree tree(points);
    std::vector<char> gone(failures.size());
    std::vector<std::uint32_t> near, taken;
    for (auto k : order) {
      if (gone[k]) continue;
      taken.push_back(k);
      near.clear();
      tree.find(points[k], 0.25 * tolerance_sum_, near);
      for (auto other : near) gone[other] = 1;
    }
    std::vector<Ball> medials(taken.size());
#pragma omp parallel for schedule(dynamic, 16) if (taken.size() > 32)
    for (std::size_t k = 0; k < taken.size(); k++)
      medials[k] = medial(points[taken[k]], failures[taken[k]].triangle);
    std::vector<CoverPoint> fresh;
    std::vector<Candidate> candidates;
    for (std::size_t k = 0; k < taken.size(); k++) {
      const std::size_t before = candidates.size();
      propose(points[taken[k]], failures[taken[k]].triangle, medials[k], candidates);
      // Where only rounding prevented the proof, the new ball must cover the spot with room to spare.
      const double spare = failures[taken[k]].value > gap_ ? 0 : 0.01 * tolerance_sum_;
      if (candidates.size() > before) fresh.push_back({points[taken[k]], spare});
    }
    problem_.add(fresh, candidates);
    return !fresh.empty();
  }

  Cover finish(bool covered) const {
    Cover cover;
    cover.balls = balls(), cover.covered = covered;
    if (covered) {
      const ProtrusionBound bound = protrusion_bound(surface_, cover.balls);
      cover.proved = bound.proved && bound.max <= protrusion_ + rounding * tolerance_sum_;
    }
    for (auto k : chosen_) cover.triangle.push_back(problem_.candidates()[k].triangle);
    return cover;
  }

  const Surface& surface_;
  const Mesh& mesh_;
  const double protrusion_, gap_, tolerance_sum_, min_radius_, largest_;
  const std::size_t large_;
  const EffortPlan plan_;
  CoverProblem problem_;
  std::vector<std::uint32_t> chosen_;
  std::uint64_t seed_ = 0, moves_ = 0;  // used so far
};

}  // namespace

Cover cover_surface(const Surface& surface, const CoverOptions& options) {
  return CoverSearch(surface, options).run();
}

std::vector<std::uint32_t> thin_balls(const Surface& surface, const std::vector<Ball>& balls, double gap,
                                      int effort) {
  const double bound = gap * (1 - rounding);
  const EffortPlan plan = plan_for(effort);
  std::vector<Candidate> candidates(balls.size());
#pragma omp parallel for schedule(dynamic, 64)
  for (std::size_t k = 0; k < balls.size(); k++)
    candidates[k] = {balls[k], std::max(0.0, -surface.signed_nearest(balls[k].center).distance),
                     balls[k].center, 0};
  SampleOptions sampling;
  sampling.tolerance_sum = gap, sampling.coarse_density = sampling.fine_density = plan.fine_density;
  // What these balls cover depends on their sizes and not on the local thickness.
  sampling.largest = 0;
  for (const Candidate& c : candidates) sampling.largest = std::max(sampling.largest, c.inner_distance);
  Samples samples = sample_surface(surface, sampling);
  for (CoverPoint& point : samples.fine) point.margin *= margin;
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
    if (plan.steps > 0)
      chosen = improve_in_blocks(sets, problem.points().size(), places, chosen,
                                 {.steps = plan.steps * std::pow(0.7, round - 1), .seed = round});
    std::vector<Ball> kept;
    for (auto k : chosen) kept.push_back(balls[k]);
    // Where the chosen balls leave a gap that others would close, those spots become points to cover. Beside
    // surface that no ball covers, the certificate may fail in the notch between two balls without knowing a
    // point that fails. Such a spot is skipped.
    std::vector<CoverPoint> points;
    for (const GapPart& part : gap_failures(surface.mesh(), BallSet(kept), bound, 0.25 * gap))
      if (part.value > bound && all.gap(part.point).value <= bound * (1 - rounding))
        points.push_back({part.point, 0});
    if (points.empty()) return chosen;
    problem.add(points, {});
  }
}

}  // namespace padder
