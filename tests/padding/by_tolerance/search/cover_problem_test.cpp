// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/search/cover_problem.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace padder {
namespace {

std::vector<std::uint32_t> points_of(const CoverProblem& problem, std::size_t set) {
  const Sets sets = problem.sets();
  std::vector<std::uint32_t> points(sets[set].begin(), sets[set].end());
  std::sort(points.begin(), points.end());
  return points;
}

Candidate ball(double x, double radius, double inner_distance = 0) {
  return {{Point(x, 0, 0), radius}, inner_distance, Point(x, 0, 0), 0};
}

TEST(CoverProblem, CoversWithinTheGapAndItsMargin) {
  CoverProblem problem(0.5);
  // Radius 1 and gap 0.5, a slope of 1 for a centre on the surface: all within 1.5 less the margin.
  problem.add({{Point(1.4, 0, 0), 0}, {Point(1.6, 0, 0), 0}, {Point(1.4, 0, 0), 0.2}}, {ball(0, 1)});
  EXPECT_EQ(points_of(problem, 0), (std::vector<std::uint32_t>{0}));
}

TEST(CoverProblem, DeepCentreNeedsLessMargin) {
  CoverProblem problem(0.5);
  // With the centre 1.2 below and 1.5 reached the surface leaves the ball with a slope of 0.6 (3-4-5).
  problem.add({{Point(1.35, 0, 0), 0.2}}, {ball(0, 1), ball(0, 1, 1.2)});
  EXPECT_TRUE(points_of(problem, 0).empty());
  EXPECT_EQ(points_of(problem, 1), (std::vector<std::uint32_t>{0}));
}

TEST(CoverProblem, DepthIsTheRoomLeftAroundAPoint) {
  const CoverProblem problem(0.5);
  EXPECT_NEAR(problem.depth(ball(0, 1), {Point(1.25, 0, 0), 0}), 0.25, 1e-11);
  EXPECT_NEAR(problem.depth(ball(0, 1), {Point(1.75, 0, 0), 0}), -0.25, 1e-11);
  EXPECT_NEAR(problem.depth(ball(0, 1, 1.2), {Point(1.25, 0, 0), 0.2}), 0.25 - 0.6 * 0.2, 1e-11);
}

TEST(CoverProblem, LaterPointsAndCandidatesLearnOfEachOther) {
  CoverProblem problem(0.5);
  problem.add({{Point(0, 0, 0), 0}}, {ball(0, 1)});
  problem.add({{Point(3, 0, 0), 0}, {Point(1, 0, 0), 0}}, {ball(2, 1)});
  EXPECT_EQ(points_of(problem, 0), (std::vector<std::uint32_t>{0, 2}));
  EXPECT_EQ(points_of(problem, 1), (std::vector<std::uint32_t>{1, 2}));
  problem.keep({1});
  EXPECT_EQ(points_of(problem, 0), (std::vector<std::uint32_t>{1, 2}));
}

}  // namespace
}  // namespace padder
