// SPDX-License-Identifier: MIT
#include "padding/geometry/balls.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace padder {
namespace {

std::vector<Ball> random_balls(std::size_t n, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> position(-1, 1), exponent(-6, 0);
  std::vector<Ball> balls(n);
  for (Ball& ball : balls) {
    ball.center = {position(random), position(random), position(random)};
    ball.radius = std::exp(exponent(random));
  }
  return balls;
}

// The oracle asks all balls.
BallGap slow_gap(const std::vector<Ball>& balls, const Point& x) {
  BallGap best;
  for (std::uint32_t k = 0; k < balls.size(); k++)
    if (gap_to(balls[k], x) < best.value) best = {gap_to(balls[k], x), k};
  return best;
}

TEST(Balls, AgreesWithBruteForce) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> position(-1.5, 1.5);
  for (std::size_t n : {1, 2, 3, 4, 5, 9, 100, 2000}) {
    const BallSet set(random_balls(n, static_cast<unsigned>(n)));
    for (int k = 0; k < 300; k++) {
      const Point x(position(random), position(random), position(random));
      const BallGap expected = slow_gap(set.balls(), x), found = set.gap(x);
      ASSERT_EQ(found.value, expected.value);
      ASSERT_EQ(found.ball, expected.ball);
      ASSERT_EQ(set.gap(x, expected.value).value, std::numeric_limits<double>::infinity());
      ASSERT_EQ(set.gap(x, expected.value + 1e-9).ball, expected.ball);
      ASSERT_EQ(set.any_contains(x), expected.value <= 0);
      ASSERT_EQ(set.any_contains(x, 0.1), expected.value <= -0.1);
      std::vector<std::uint32_t> near, slow;
      set.find(x, 0.2, near);
      for (std::uint32_t b = 0; b < n; b++)
        if (gap_to(set.balls()[b], x) < 0.2) slow.push_back(b);
      std::sort(near.begin(), near.end());
      ASSERT_EQ(near, slow);
    }
  }
}

TEST(Balls, EmptyUnionIsInfinitelyFar) {
  const BallSet set;
  EXPECT_EQ(set.gap(Point::Zero()).value, std::numeric_limits<double>::infinity());
  EXPECT_FALSE(set.any_contains(Point::Zero(), -1e9));
}

TEST(Balls, EqualBallsGiveTheLowestIndex) {
  const BallSet set(std::vector<Ball>(1000, Ball{Point(1, 2, 3), 0.5}));
  const BallGap gap = set.gap(Point(1, 2, 5));
  EXPECT_EQ(gap.value, 1.5);
  EXPECT_EQ(gap.ball, 0u);
}

}  // namespace
}  // namespace padder
