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
// The share of a point's own margin that a ball must cover around it. The certificate finds what it leaves open.
double env(const char* n, double d) { const char* e = getenv(n); return e ? atof(e) : d; }
const double margin = env("MG", 0.3);
constexpr double medial_tolerance = 0.05;  // share of the tolerance sum

constexpr int most_rounds = 100;

// What one stage of the search does. Each effort above 0 adds one stage, which begins with the cover of the stage
// before it. So a higher effort never gives more balls.
struct Stage {
  int starts;    // searches that begin alike, differ in their random numbers, and run side by side
  int moves;     // rounds of each that try new places around the chosen balls
  int places;    // tried around each ball
  double steps;  // exchanges of the local search, for each ball
};
const Stage stages[] = {
    {(int)env("S1", 3), (int)env("M1", 2), (int)env("P1", 16), env("T1", 50)},
    {(int)env("S2", 4), (int)env("M2", 3), (int)env("P2", 16), env("T2", 100)},
    {(int)env("S3", 6), (int)env("M3", 4), (int)env("P3", 16), env("T3", 200)}};
// How far from the place of a chosen ball new ones are tried, in turn: share of the radius of the disc that it
// covers.
const std::array step_sizes = {env("SA", 0.2), env("SB", 0.3)};

// A cover that is being looked for: the points to cover, the balls to choose from, and those that are chosen.
struct Attempt {
  CoverProblem problem;
  std::vector<std::uint32_t> chosen;  // indices of candidates
  std::uint64_t seed;                 // of all random numbers from here on

  std::vector<Candidate> chosen_candidates() const {
    std::vector<Candidate> candidates;
    for (auto k : chosen) candidates.push_back(problem.candidates()[k]);
    return candidates;
  }
  std::vector<Ball> balls() const {
    std::vector<Ball> balls;
    for (auto k : chosen) balls.push_back(problem.candidates()[k].ball);
    return balls;
  }
};

class CoverSearch {
 public:
  CoverSearch(const Surface& surface, const CoverOptions& options)
      : surface_(surface),
        mesh_(surface.mesh()),
        tolerance_sum_((options.protrusion + options.gap) * (1 - 2 * rounding)),
        protrusion_(std::min(options.protrusion, options.max_radius) - rounding * (options.protrusion + options.gap)),
        gap_(options.gap - rounding * (options.protrusion + options.gap)),
        min_radius_(options.min_radius),
        largest_(std::min(options.max_radius - protrusion_, surface.bounds().diagonal())),
        effort_(std::clamp(options.effort, 0, 3)) {
    if (mesh_.triangles.empty()) throw Error("there is no surface to cover: the mesh has no triangles");
    if (!(tolerance_sum_ > 0)) throw Error("a cover needs a tolerance above 0");
  }

  Cover run() {
    Attempt best{CoverProblem(gap_), {}, 0};
    if (single(best)) return finish(best, true);
    SampleOptions sampling;
    sampling.tolerance_sum = tolerance_sum_, sampling.largest = largest_;
    sampling.coarse_density=env("CD",4), sampling.fine_density=env("FD",6);
    const Samples samples = sample_surface(surface_, sampling);
    std::vector<Candidate> candidates;
    for (const Sample& s : samples.grown) propose(s.point, s.triangle, s.ball, candidates);
    best.problem.add(with_margin(samples.coarse, margin), candidates);
    solve(best, 0);
    Attempt common = best;
    bool covered = certify(best, 0, 0, &common.problem);
    for (int k = 0; k < effort_; k++) {
      Attempt next = merge(samples, search_side_by_side(common, best, k), best, k);
      const bool next_covered = certify(next, stages[k].steps * env("CS",0.5), (int)env("CM",8), nullptr);
      if (next_covered == covered ? next.chosen.size() < best.chosen.size() : next_covered)
        best = std::move(next), covered = next_covered;
    }
    return finish(best, covered);
  }

 private:
  // Chooses the fewest candidates, beginning with those that are chosen.
  void solve(Attempt& attempt, double steps, int tries = 1) const {
    const Sets sets = attempt.problem.sets();
    const std::size_t n = attempt.problem.points().size();
    SetCover cover(sets, n);
    cover.greedy(attempt.chosen);
    attempt.chosen = cover.best();
    if (!(steps > 0)) return;
    std::vector<Point> places;
    for (const Candidate& c : attempt.problem.candidates()) places.push_back(c.ball.center);
    BlockSearch search;
    search.steps = steps, search.seed = ++attempt.seed;
    if (attempt.chosen.size() <= search.block) {
      cover.improve(static_cast<std::uint64_t>(steps * static_cast<double>(attempt.chosen.size())), search.seed);
      attempt.chosen = cover.best();
      return;
    }
    attempt.chosen = improve_in_blocks(sets, n, places, attempt.chosen, search);
  }

  // Searches from the same beginning with different random numbers. Returns the balls that each has chosen.
  std::vector<std::vector<Candidate>> search_side_by_side(const Attempt& common, const Attempt& best, int stage) const {
    const Stage& plan = stages[stage];
    std::vector<std::vector<Candidate>> found(static_cast<std::size_t>(plan.starts));
    // Few balls make few blocks, so that whole searches run in parallel; of many balls the blocks do.
#pragma omp parallel for schedule(dynamic, 1) if (best.chosen.size() < 1000)
    for (int start = 0; start < plan.starts; start++) {
      Attempt attempt = common;
      attempt.seed = static_cast<std::uint64_t>((stage + 1) * 100 + start + 1) << 32;
      solve(attempt, plan.steps);
      for (int k = 0; k < plan.moves; k++) {
        move(attempt, plan.places);
        solve(attempt, plan.steps);
      }
      found[static_cast<std::size_t>(start)] = attempt.chosen_candidates();
      if (getenv("VERB")) fprintf(stderr,"start %zu\n",attempt.chosen.size());
    }
    return found;
  }

  // Chooses again from what all searches have found.
  Attempt merge(const Samples& samples, const std::vector<std::vector<Candidate>>& found, const Attempt& best,
                int stage) const {
    Attempt attempt{CoverProblem(gap_), {}, static_cast<std::uint64_t>(stage + 1) << 48};
    std::vector<Candidate> pool;
    std::size_t fewest = 0;
    for (std::size_t k = 0; k < found.size(); k++)
      if (found[k].size() < found[fewest].size()) fewest = k;
    pool = found[fewest];
    attempt.chosen.resize(pool.size());
    std::iota(attempt.chosen.begin(), attempt.chosen.end(), 0u);
    for (std::size_t k = 0; k < found.size(); k++)
      if (k != fewest) pool.insert(pool.end(), found[k].begin(), found[k].end());
    const std::vector<Candidate> known = best.chosen_candidates();
    pool.insert(pool.end(), known.begin(), known.end());
    attempt.problem.add(with_margin(samples.fine, margin), pool);
    solve(attempt, stages[stage].steps);
      if (getenv("VERB")) fprintf(stderr,"pool %zu -> %zu\n",pool.size(),attempt.chosen.size());
    for (int k = 0; k < (int)env("MM",2); k++) {
      move(attempt, stages[stage].places);
      solve(attempt, stages[stage].steps);
      if (getenv("VERB")) fprintf(stderr,"moved %zu\n",attempt.chosen.size());
    }
    return attempt;
  }

  // Adds the spots that the certificate finds, until none is left. Returns false if the radius limits leave some.
  // `also` gets the same points and balls.
  bool certify(Attempt& attempt, double steps, int places, CoverProblem* also) const {
    // About ten rounds are enough, except beside surface that a radius limit leaves open: the cap is for
    // that.
    for (int round = 0;; round++, steps *= env("SD",0.7)) {
      const std::vector<GapPart> failures =
          gap_failures(mesh_, BallSet(attempt.balls()), gap_, 0.25 * tolerance_sum_);
      if (failures.empty()) return true;
      if (round < env("CR",4) && places > 0) move(attempt, places);
      if (round == most_rounds || !refine(attempt.problem, failures, also)) return false;
      solve(attempt, steps);
      if (getenv("VERB")) fprintf(stderr,"round %d: %zu failures -> %zu\n",round,failures.size(),attempt.chosen.size());
    }
  }

  Ball medial(const Point& p, std::uint32_t triangle, double guess = 0) const {
    return inner_medial_ball(surface_, p, mesh_.area_normal(triangle).normalized(), largest_,
                             medial_tolerance * tolerance_sum_, guess);
  }

  // Adds the medial ball, dilated by the whole protrusion, unless it is too small.
  void propose(const Point& p, std::uint32_t triangle, const Ball& medial,
               std::vector<Candidate>& candidates) const {
    const double radius = medial.radius + protrusion_;
    if (radius > 0 && radius >= min_radius_)
      candidates.push_back({{medial.center, radius}, medial.radius, p, triangle});
  }

  static std::vector<CoverPoint> with_margin(std::vector<CoverPoint> points, double share) {
    for (CoverPoint& point : points) point.margin *= share;
    return points;
  }

  // Tries one ball for everything. No cover is smaller, and this must come before any step whose cost grows
  // with the area: on a fine sphere every triangle is equally near to the centre, which makes each query
  // slow.
  bool single(Attempt& attempt) const {
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
      attempt.problem.add({}, candidates);
      attempt.chosen = {0};
      return true;
    }
    return false;
  }

  // Makes the next problem: the chosen balls, and new medial balls at places around theirs. The places lie up
  // to a share of the covered disc's radius from the place of the chosen ball.
  void move(Attempt& attempt, int tries) const {
    const std::size_t n = attempt.chosen.size() * static_cast<std::size_t>(tries);
    const std::uint64_t seed = ++attempt.seed << 20;
    std::vector<Sample> places(n);
#pragma omp parallel for schedule(dynamic, 16) if (n > 64)
    for (std::size_t k = 0; k < n; k++) {
      const Candidate& c = attempt.problem.candidates()[attempt.chosen[k / static_cast<std::size_t>(tries)]];
      Random random(seed + k);
      const double most = step_sizes[k % 2] * covered_disc(c.inner_distance, tolerance_sum_);
      Vector step;
      for (int axis = 0; axis < 3; axis++) step[axis] = (2 * random.uniform() - 1) * most;
      const Nearest at = surface_.nearest(c.point + step);
      places[k] = {at.point, at.triangle, medial(at.point, at.triangle, env("GF",1.5)*c.inner_distance+env("GT",1)*tolerance_sum_)};
    }
    std::vector<Candidate> fresh;
    for (const Sample& s : places) propose(s.point, s.triangle, s.ball, fresh);
    attempt.problem.keep(attempt.chosen);
    std::iota(attempt.chosen.begin(), attempt.chosen.end(), 0u);
    attempt.problem.add({}, fresh);
  }

  // Adds the worst failures as points to cover, each with a ball of its own that covers it. Returns false if
  // the radius limits allow no such ball.
  bool refine(CoverProblem& problem, const std::vector<GapPart>& failures, CoverProblem* also) const {
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
    problem.add(fresh, candidates);
    if (also) also->add(fresh, candidates);
    return !fresh.empty();
  }

  Cover finish(const Attempt& attempt, bool covered) const {
    Cover cover;
    cover.balls = attempt.balls(), cover.covered = covered;
    if (covered) {
      const ProtrusionBound bound = protrusion_bound(surface_, cover.balls);
      cover.proved = bound.proved && bound.max <= protrusion_ + rounding * tolerance_sum_;
    }
    for (const Candidate& c : attempt.chosen_candidates()) cover.triangle.push_back(c.triangle);
    return cover;
  }

  const Surface& surface_;
  const Mesh& mesh_;
  const double tolerance_sum_, protrusion_, gap_, min_radius_, largest_;
  const int effort_;
};

}  // namespace

Cover cover_surface(const Surface& surface, const CoverOptions& options) {
  return CoverSearch(surface, options).run();
}

std::vector<std::uint32_t> thin_balls(const Surface& surface, const std::vector<Ball>& balls, double gap,
                                      int effort) {
  const double bound = gap * (1 - rounding);
  const double steps = effort > 0 ? stages[std::min(effort, 3) - 1].steps : 0;
  std::vector<Candidate> candidates(balls.size());
#pragma omp parallel for schedule(dynamic, 64)
  for (std::size_t k = 0; k < balls.size(); k++)
    candidates[k] = {balls[k], std::max(0.0, -surface.signed_nearest(balls[k].center).distance),
                     balls[k].center, 0};
  SampleOptions sampling;
  sampling.tolerance_sum = gap, sampling.coarse_density = sampling.fine_density = 6;
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
    if (steps > 0)
      chosen = improve_in_blocks(sets, problem.points().size(), places, chosen,
                                 {.steps = steps * std::pow(0.7, round - 1), .seed = round});
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
