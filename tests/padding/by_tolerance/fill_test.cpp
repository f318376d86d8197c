// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/fill.h"

#include <gtest/gtest.h>

#include "padding/by_tolerance/cover.h"
#include "padding/by_tolerance/cull.h"
#include "padding/geometry/random.h"
#include "padding/verify/certify.h"
#include "tests/padding/balls.h"
#include "tests/padding/shapes.h"
#include "tests/padding/threads.h"

namespace padder {
namespace {

using shapes::unit;

Mesh shape(int k) {
  switch (k) {
    case 0:
      return unit(shapes::box({0, 0, 0}, {1, 1, 1}));
    case 1:
      return unit(shapes::torus(0.3, 0.12, 40, 20));
    default:
      return unit(shapes::box({0, 0, 0}, {1, 0.5, 0.1}));
  }
}

// Random points of the body that lie in no ball.
int missed(const Surface& surface, const std::vector<Ball>& balls, std::uint64_t seed) {
  Random random(seed);
  const BallSet set(balls);
  const Box box = surface.bounds();
  int outside = 0;
  for (int k = 0; k < 20000; k++) {
    Point x;
    for (int axis = 0; axis < 3; axis++)
      x[axis] = box.low[axis] + random.uniform() * (box.high[axis] - box.low[axis]);
    if (surface.winding_number(x).value_or(0) > 0) outside += !set.any_contains(x);
  }
  return outside;
}

class FillShapes : public testing::TestWithParam<int> {};

TEST_P(FillShapes, NoPointOfTheBodyIsOutsideACoverWithoutGap) {
  const Surface surface(shape(GetParam()));
  for (const double protrusion : {0.02, 0.04}) {
    const Culled culled = cull(surface, {.only_protrusion = protrusion, .only_gap = 0});
    EXPECT_TRUE(culled.proved && culled.filled);
    EXPECT_EQ(culled.balls.size(), culled.triangle.size());
    EXPECT_LE(protrusion_bound(surface, culled.balls).max, protrusion);
    EXPECT_EQ(gap_bound(surface.mesh(), BallSet(culled.balls)).upper, 0);
    EXPECT_EQ(missed(surface, culled.balls, 7), 0) << "seed 7";
    // Now nothing is left to fill.
    const Filled again =
        fill_body(surface, BallSet(culled.balls), {.depth = 0.009 * protrusion, .protrusion = protrusion});
    EXPECT_TRUE(again.covered);
    EXPECT_LE(again.balls.size(), culled.balls.size() / 20);
  }
}

INSTANTIATE_TEST_SUITE_P(Shapes, FillShapes, testing::Range(0, 3));

// A cube whose balls all lie along its surface has a hollow in the middle.
TEST(Fill, FindsAndFillsAHollowWithinRadiusLimits) {
  const Surface surface(shape(0));
  const double e = 0.02;
  const Cover cover = cover_surface(surface, {.protrusion = e, .gap = -0.01 * e, .max_radius = 0.06});
  ASSERT_EQ(cover.open.why, WhyOpen::nothing);
  ASSERT_GT(missed(surface, cover.balls, 3), 1000) << "seed 3";
  const FillOptions options{.depth = 0.0099 * e, .protrusion = e};
  const auto found = [&] { return fill_body(surface, BallSet(cover.balls), options); };
  const Filled filled = with_threads(1, found), again = with_threads(3, found);
  EXPECT_TRUE(filled.covered);
  EXPECT_GE(filled.balls.size(), 1u);
  EXPECT_LT(filled.balls.size(), 60u);
  expect_same(again.balls, filled.balls);
  std::vector<Ball> all = cover.balls;
  all.insert(all.end(), filled.balls.begin(), filled.balls.end());
  EXPECT_EQ(missed(surface, all, 4), 0) << "seed 4";
  EXPECT_LE(protrusion_bound(surface, filled.balls).max, e + 1e-12);

  // Spheres too large are forbidden in a hollow, too, and spheres too small leave it open.
  const Filled small =
      fill_body(surface, BallSet(cover.balls), {.depth = 0.0099 * e, .protrusion = e, .max_radius = 0.1});
  EXPECT_TRUE(small.covered);
  for (const Ball& ball : small.balls) EXPECT_LE(ball.radius, 0.1);
  const Filled none =
      fill_body(surface, BallSet(cover.balls), {.depth = 0.0099 * e, .protrusion = e, .min_radius = 1});
  EXPECT_FALSE(none.covered);
}

// All that is nearer than `depth` to the surface of a cube counts as covered. Two balls cover the rest, but
// not wherever they are moved to; balls that are as much smaller stand for that.
TEST(Fill, HoldsWhereTheBallsMove) {
  const Surface surface(shape(0));
  const double depth = 0.2, core = surface.bounds().high.x() - depth, moved = 0.008;
  const double radius = std::hypot(0.3, core, core) + 0.004;  // the corners of the core are so deep inside
  const std::vector<Ball> two = {{{-0.3, 0, 0}, radius}, {{0.3, 0, 0}, radius}};
  const auto uncovered = [&](const std::vector<Ball>& balls, double smaller) {
    Random random(3);
    int count = 0;
    for (int k = 0; k < 20000; k++) {
      const Point x(random.uniform() * core / 8, (1 - random.uniform() / 8) * core,
                    (1 - random.uniform() / 8) * core);
      count += std::ranges::none_of(
          balls, [&](const Ball& b) { return (x - b.center).norm() <= b.radius - smaller; });
    }
    return count;
  };
  ASSERT_EQ(uncovered(two, 0), 0) << "seed 3";
  ASSERT_GT(uncovered(two, moved), 100) << "seed 3";
  FillOptions options{.depth = depth, .protrusion = 0.02, .max_radius = 0.06};
  EXPECT_TRUE(fill_body(surface, BallSet(two), options).balls.empty());
  options.moved = moved;
  const Filled filled = fill_body(surface, BallSet(two), options);
  EXPECT_TRUE(filled.covered);
  std::vector<Ball> balls = filled.balls;
  balls.insert(balls.end(), two.begin(), two.end());
  EXPECT_EQ(uncovered(balls, moved), 0) << "seed 3";
}

TEST(Fill, WithoutRoomToMoveNothingIsProved) {
  const Surface surface(shape(0));
  EXPECT_TRUE(cull(surface, {.only_protrusion = 0.05, .only_gap = -0.02}).filled);
  EXPECT_FALSE(cull(surface, {.only_protrusion = 0.05, .only_gap = -0.03}).filled);
  EXPECT_FALSE(fill_body(surface, BallSet({{Point::Zero(), 0.1}}),
                         {.depth = 0.01, .protrusion = 0.05, .max_radius = 0.1, .moved = 0.1})
                   .covered);
}

TEST(Fill, AnOpenSurfaceHasNoInside) {
  const Surface surface(unit(shapes::square(1)));
  EXPECT_FALSE(
      fill_body(surface, BallSet({{Point::Zero(), 2}}), {.depth = 0.01, .protrusion = 0.01}).covered);
}

TEST(Cull, WithoutProtrusionAllBallsAreInside) {
  const Surface surface(shape(2));
  const Culled culled = cull(surface, {.only_protrusion = 0, .only_gap = 0.02});
  EXPECT_TRUE(culled.proved);
  EXPECT_LE(protrusion_bound(surface, culled.balls).max, 0);
  EXPECT_LE(gap_bound(surface.mesh(), BallSet(culled.balls), 0.02).upper, 0.02);
}

}  // namespace
}  // namespace padder
