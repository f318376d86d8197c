// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/search/attempt.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/padding/shapes.h"

namespace padder {
namespace {

std::size_t open_points(const Attempt& attempt) {
  std::vector<char> covered(attempt.problem.points().size(), 0);
  for (const auto k : attempt.chosen)
    for (const auto r : attempt.problem.covered(k)) covered[r] = 1;
  return static_cast<std::size_t>(std::count(covered.begin(), covered.end(), 0));
}

// Of a cover that was searched for, a few new points are open. Adding balls covers them, too, but needs more.
TEST(Attempt, RepairMovesBallsWhereOthersWouldBeAdded) {
  const Surface surface(shapes::torus(1, 0.3, 48, 24));
  const double tolerance = 0.01;
  const BallGrower grower(surface, {tolerance, tolerance, 2 * tolerance, 0, 3});
  SampleOptions sampling;
  sampling.tolerance_sum = 2 * tolerance, sampling.largest = 3;
  const Samples samples = sample_surface(surface, sampling);
  std::vector<Candidate> candidates;
  for (const Sample& s : samples.grown) grower.propose(s.point, s.triangle, s.ball, candidates);
  Attempt attempt{CoverProblem(tolerance), {}, 1};
  attempt.problem.add(samples.coarse, candidates);
  attempt.solve(50);
  ASSERT_EQ(open_points(attempt), 0u);
  const std::size_t before = attempt.chosen.size();

  std::vector<CoverPoint> spots(samples.fine.begin(), samples.fine.end());
  for (CoverPoint& spot : spots) spot.margin *= 1.35;
  attempt.problem.add(spots, {});
  ASSERT_GT(open_points(attempt), 0u);
  Attempt added = attempt, repaired = attempt;
  added.solve(0);
  const std::vector<char> moved = repaired.repair(grower, 16, 100);
  EXPECT_EQ(open_points(added), 0u);
  EXPECT_EQ(open_points(repaired), 0u);
  EXPECT_GE(repaired.chosen.size(), before);
  EXPECT_LT(repaired.chosen.size(), added.chosen.size());
  EXPECT_EQ(moved.size(), repaired.chosen.size());
  EXPECT_GT(std::count(moved.begin(), moved.end(), 1), 0);
}

}  // namespace
}  // namespace padder
