// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/cover.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "padding/asset/error.h"
#include "padding/by_tolerance/search/centre.h"
#include "padding/by_tolerance/search/close_gaps.h"
#include "padding/geometry/indices.h"

namespace padder {
namespace {

// What one stage of the search does. Each effort above 0 adds a stage, which begins with the cover of the one
// before, so that a higher effort never gives more balls.
struct Stage {
  // Searches that differ in nothing but their random numbers run side by side. All balls that one of them has
  // chosen are the candidates of another search, which therefore finds less than the best of them.
  int starts;
  int moves;      // rounds of each that try new places around the chosen balls
  double steps;   // exchanges of the local search, for each ball
  double margin;  // share of a point's own margin that a ball must cover around it; the certificate finds
                  // what it misses
};
constexpr std::array kStages = {Stage{3, 2, 50, 0.15}, Stage{4, 3, 100, 0.1}, Stage{6, 4, 200, 0.1}};
constexpr double kGreedyMargin = 0.3;

constexpr int kMovePlaces = 16;  // tried around each ball
constexpr int kMergeMoves = 2;
// On a rough surface, a search whose last stage begins with four times the balls may still come down to the
// number that is asked for, but with eight times as many none did.
constexpr std::uint64_t kTooMany = 8;
// What a searched round of close_gaps() does: share of the stage's steps, and places tried around each ball.
constexpr double kClosingShare = 0.5;
constexpr int kClosingPlaces = 4;

// Up to so many balls, all searches of a stage run. Of more balls, fewer do: there the many blocks of one
// search differ enough. So the time grows with the number of balls, and no faster.
constexpr double kBallsForAllStarts = 400;

class CoverSearch {
 public:
  CoverSearch(const Surface& surface, const CoverOptions& options)
      : surface_(surface),
        mesh_(surface.mesh()),
        limits_(limits_of(surface, options)),
        grower_(surface, limits_),
        effort_(std::clamp(options.effort, 0, 3)),
        most_balls_(options.most_balls),
        watch_(options.tell, steps_of(effort_)) {
    if (mesh_.triangles.empty()) throw Error("there is no surface to cover: the mesh has no triangles");
    if (!(limits_.tolerance_sum > 0)) throw Error("a cover needs a tolerance above 0");
  }

  Cover run() const {
    Attempt best{CoverProblem(limits_.gap), {}, 0};
    if (grower_.none_fits()) return finish(best, {WhyOpen::min_radius, mesh_.middle(0)});
    if (single(best)) return finish(best, {});
    SampleOptions sampling;
    sampling.tolerance_sum = limits_.tolerance_sum;
    sampling.largest = limits_.largest_inner_distance;
    const Samples samples = sample_surface(surface_, sampling);
    step();
    std::vector<Candidate> candidates;
    for (const Sample& s : samples.grown) grower_.propose(s.point, s.triangle, s.ball, candidates);
    best.problem.add(with_margin(samples.coarse, kGreedyMargin), candidates);
    best.solve(0);
    Attempt common = best;
    OpenSpot open = close_gaps(best, grower_, 0, 0, watch_, &common.problem);
    for (int k = 0; k < effort_; k++) {
      const Stage& stage = kStages[static_cast<std::size_t>(k)];
      const std::uint64_t seed = static_cast<std::uint64_t>(k + 1) << 56;
      Attempt next = merge(samples, search_side_by_side(common, best, stage, seed), best, stage, seed);
      if (k + 1 == effort_ && std::min(next.chosen.size(), best.chosen.size()) / kTooMany > most_balls_)
        return finish(next, {WhyOpen::unfinished, mesh_.middle(0)});
      centre(next, grower_, std::vector<char>(next.chosen.size(), 1));
      const OpenSpot next_open =
          close_gaps(next, grower_, kClosingShare * stage.steps, kClosingPlaces, watch_, nullptr);
      const bool covered = open.why == WhyOpen::nothing, next_covered = next_open.why == WhyOpen::nothing;
      if (next_covered == covered ? next.chosen.size() < best.chosen.size() : next_covered)
        best = std::move(next), open = next_open;
    }
    return finish(best, open);
  }

 private:
  static BallLimits limits_of(const Surface& surface, const CoverOptions& options) {
    const double sum = options.protrusion + options.gap;
    const double max_radius = options.max_radius * (1 - kKeptBack);
    BallLimits limits;
    limits.tolerance_sum = sum * (1 - 2 * kKeptBack);
    limits.protrusion = std::min(options.protrusion, max_radius) - kKeptBack * sum;
    limits.gap = options.gap - kKeptBack * sum;
    limits.min_radius = options.min_radius * (1 + kKeptBack);
    limits.largest_inner_distance = std::min(max_radius - limits.protrusion, surface.bounds().diagonal());
    return limits;
  }

  // Of a search with all starts; a search with fewer is done at a smaller share.
  static double steps_of(int effort) {
    double steps = 2;  // samples, and the first cover
    for (int k = 0; k < effort; k++) {
      const Stage& stage = kStages[static_cast<std::size_t>(k)];
      steps += stage.starts * (stage.moves + 1) + kMergeMoves + 1 + kSearchedRounds;
    }
    return steps + kSearchedRounds;
  }

  void step() const {
    watch_.tick();
    watch_.check();
  }

  // Searches from the same beginning with different random numbers. Returns the balls that each has chosen.
  std::vector<std::vector<Candidate>> search_side_by_side(const Attempt& common, const Attempt& best,
                                                          const Stage& stage, std::uint64_t seed) const {
    const auto n = static_cast<double>(best.chosen.size());
    const auto starts =
        static_cast<std::size_t>(1 + std::lround((stage.starts - 1) * std::min(1.0, kBallsForAllStarts / n)));
    std::vector<std::vector<Candidate>> found(starts);
    // Few balls make few blocks, so that whole searches run in parallel; of many balls the blocks do.
#pragma omp parallel for schedule(dynamic, 1) if (n <= 2 * kBallsForAllStarts)
    for (std::size_t start = 0; start < starts; start++) {
      Attempt attempt = common;
      attempt.seed = seed + ((start + 1) << 48);
      for (int k = 0; k <= stage.moves && !watch_.stopped(); k++) {
        if (k > 0) attempt.try_places(grower_, kMovePlaces);
        attempt.solve(stage.steps);
        watch_.tick();
      }
      found[start] = attempt.chosen_candidates();
    }
    watch_.check();
    return found;
  }

  // Chooses again from what all searches have found.
  Attempt merge(const Samples& samples, const std::vector<std::vector<Candidate>>& found, const Attempt& best,
                const Stage& stage, std::uint64_t seed) const {
    Attempt attempt{CoverProblem(limits_.gap), {}, seed};
    std::size_t fewest = 0;
    for (std::size_t k = 0; k < found.size(); k++)
      if (found[k].size() < found[fewest].size()) fewest = k;
    std::vector<Candidate> pool = found[fewest];
    attempt.chosen = numbered(pool.size());
    for (std::size_t k = 0; k < found.size(); k++)
      if (k != fewest) pool.insert(pool.end(), found[k].begin(), found[k].end());
    const std::vector<Candidate> known = best.chosen_candidates();
    pool.insert(pool.end(), known.begin(), known.end());
    attempt.problem.add(with_margin(samples.fine, stage.margin), pool);
    for (int k = 0; k <= kMergeMoves; k++) {
      if (k > 0) attempt.try_places(grower_, kMovePlaces);
      attempt.solve(stage.steps);
      step();
    }
    return attempt;
  }

  static std::vector<CoverPoint> with_margin(std::vector<CoverPoint> points, double share) {
    for (CoverPoint& point : points) point.margin *= share;
    return points;
  }

  // Tries one ball for everything. No cover is smaller, and this must come before any step whose cost grows
  // with the area: on a fine sphere every triangle is equally near to the centre, which makes each query
  // slow. The middle of its box is the best place in a sphere, and in what is about as long as wide.
  bool single(Attempt& attempt) const {
    const auto covers = [&](const Point& at, std::uint32_t triangle, const Ball& ball) {
      std::vector<Candidate> candidates;
      grower_.propose(at, triangle, ball, candidates);
      if (candidates.empty() || !covers_all(candidates[0])) return false;
      attempt.problem.add({}, candidates);
      attempt.chosen = {0};
      return true;
    };
    const Point middle = surface_.bounds().center();
    if (const double inner = surface_.closed() ? -surface_.certified_distance(middle) : 0; inner > 0) {
      const Nearest at = surface_.nearest(middle);
      if (covers(at.point, at.triangle, {middle, std::min(inner, limits_.largest_inner_distance)}))
        return true;
    }
    Random random(1);
    for (int k = 0; k < 4; k++) {
      const auto t = static_cast<std::uint32_t>(random.below(mesh_.triangles.size()));
      if (!(mesh_.area_normal(t).squaredNorm() > 0)) continue;
      const Point p = mesh_.middle(t);
      if (covers(p, t, grower_.medial(p, t))) return true;
    }
    return false;
  }

  bool covers_all(const Candidate& c) const {
    const double reach = c.ball.radius + limits_.gap;
    const auto covered = [&](std::uint32_t v) {
      return (mesh_.points[v] - c.ball.center).squaredNorm() <= reach * reach;
    };
    return std::all_of(mesh_.triangles.begin(), mesh_.triangles.end(),
                       [&](const Corners& t) { return std::all_of(t.begin(), t.end(), covered); });
  }

  Cover finish(const Attempt& attempt, const OpenSpot& open) const {
    Cover cover;
    cover.balls = attempt.balls(), cover.open = open;
    if (open.why == WhyOpen::nothing) {
      const ProtrusionBound bound = protrusion_bound(surface_, cover.balls);
      cover.proved = bound.proved && bound.max <= limits_.protrusion + kKeptBack * limits_.tolerance_sum;
    }
    for (const Candidate& c : attempt.chosen_candidates()) cover.triangle.push_back(c.triangle);
    return cover;
  }

  const Surface& surface_;
  const Mesh& mesh_;
  const BallLimits limits_;
  const BallGrower grower_;
  const int effort_;
  const std::uint64_t most_balls_;
  mutable Watch watch_;
};

}  // namespace

Cover cover_surface(const Surface& surface, const CoverOptions& options) {
  return CoverSearch(surface, options).run();
}

}  // namespace padder
