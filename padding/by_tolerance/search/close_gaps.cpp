// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/search/close_gaps.h"

#include <algorithm>
#include <set>
#include <tuple>

#include "padding/by_tolerance/search/centre.h"
#include "padding/by_tolerance/search/open_pieces.h"
#include "padding/geometry/indices.h"
#include "padding/geometry/point_tree.h"

namespace padder {
namespace {

constexpr int kRepairedRounds = 60;   // after these, balls are only added
constexpr int kMostGapRounds = 100;   // after these, the cover is not proved
constexpr int kRepairPlaces = 4;      // tried around each ball beside an open point
constexpr double kRepairSteps = 30;   // exchanges for each of these balls
constexpr double kSpacing = 0.25;     // of the spots: share of the tolerance sum
constexpr double kGapMargin = 0.003;  // of their points: share of the tolerance sum

// Why no ball may be chosen that covers p.
WhyOpen why_open(const BallGrower& grower, const Point& p, std::uint32_t triangle) {
  BallLimits any_size = grower.limits();
  any_size.min_radius = 0;
  const Ball ball = BallGrower(grower.surface(), any_size).medial(p, triangle);
  return ball.radius + any_size.protrusion > 0 ? WhyOpen::min_radius : WhyOpen::no_inside;
}

// Spots for which no ball was found, which takes hundreds of balls to find out: they stay open, and the
// certificate finds them again in each round.
class Hopeless {
 public:
  bool contains(const GapPart& spot) const { return spots_.contains(key(spot)); }
  void add(const GapPart& spot) { spots_.insert(key(spot)); }

 private:
  using Key = std::tuple<double, double, double, std::uint32_t>;
  static Key key(const GapPart& spot) {
    return {spot.point.x(), spot.point.y(), spot.point.z(), spot.triangle};
  }
  std::set<Key> spots_;
};

// Adds the worst failures as points to cover, each with a ball of its own that covers it. Where there is no
// such ball for any of them, it returns the worst.
OpenSpot refine(CoverProblem& problem, const BallGrower& grower, const std::vector<GapPart>& failures,
                Hopeless& hopeless, CoverProblem* also) {
  const double tolerance_sum = grower.limits().tolerance_sum;
  std::vector<std::uint32_t> order = numbered(failures.size());
  std::stable_sort(order.begin(), order.end(),
                   [&](auto a, auto b) { return failures[a].value > failures[b].value; });
  std::vector<Point> points;
  for (const GapPart& part : failures) points.push_back(part.point);
  const std::vector<std::uint32_t> taken = sparse(points, order, kSpacing * tolerance_sum);
  std::vector<std::vector<Candidate>> proposed(taken.size());
#pragma omp parallel for schedule(dynamic, 16) if (taken.size() > 32)
  for (std::size_t k = 0; k < taken.size(); k++) {
    const GapPart& spot = failures[taken[k]];
    if (hopeless.contains(spot)) continue;
    grower.propose(spot.point, spot.triangle, grower.medial(spot.point, spot.triangle), proposed[k]);
  }
  std::vector<CoverPoint> fresh;
  std::vector<Candidate> candidates;
  for (std::size_t k = 0; k < taken.size(); k++) {
    candidates.insert(candidates.end(), proposed[k].begin(), proposed[k].end());
    // A ball must cover the spot with room to spare, or what is around it fails in the next round.
    if (proposed[k].empty())
      hopeless.add(failures[taken[k]]);
    else
      fresh.push_back({points[taken[k]], kGapMargin * tolerance_sum});
  }
  problem.add(fresh, candidates);
  if (also) also->add(fresh, candidates);
  if (!fresh.empty()) return {};
  const GapPart& worst = failures[taken.front()];
  return {why_open(grower, worst.point, worst.triangle), worst.point};
}

}  // namespace

OpenSpot close_gaps(Attempt& attempt, const BallGrower& grower, double steps, int places, Watch& watch,
                    CoverProblem* also) {
  OpenPieces open(grower.surface().mesh(), grower.limits().gap);
  Hopeless hopeless;
  for (int round = 0;; round++) {
    const std::vector<GapPart> failures =
        open.failures(attempt.balls(), kSpacing * grower.limits().tolerance_sum);
    if (failures.empty()) return {};
    const bool search = round < kSearchedRounds;
    if (search) watch.tick();
    watch.check();
    if (places > 0) attempt.try_places(grower, search ? places : 0);
    if (round == kMostGapRounds) return {WhyOpen::unfinished, failures.front().point};
    if (const OpenSpot left = refine(attempt.problem, grower, failures, hopeless, also);
        left.why != WhyOpen::nothing)
      return left;
    const std::vector<char> all(attempt.chosen.size(), search);
    if (places == 0 || round >= kRepairedRounds) {
      attempt.solve(search ? steps : 0);
    } else if (const std::size_t left = centre(attempt, grower, all); search) {
      attempt.solve(steps);
    } else if (left > 0) {
      const std::vector<char> moved = attempt.repair(grower, kRepairPlaces, kRepairSteps);
      centre(attempt, grower, moved);
    }
  }
}

}  // namespace padder
