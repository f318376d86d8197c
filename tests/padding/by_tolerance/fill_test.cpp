// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/fill.h"

#include <gtest/gtest.h>
#include <omp.h>

#include "padding/by_tolerance/cover.h"
#include "padding/by_tolerance/cull.h"
#include "padding/geometry/random.h"
#include "padding/verify/certify.h"
#include "tests/padding/shapes.h"

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
    EXPECT_TRUE(culled.covered && culled.proved && culled.filled);
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
  ASSERT_TRUE(cover.covered);
  ASSERT_GT(missed(surface, cover.balls, 3), 1000) << "seed 3";
  const FillOptions options{.depth = 0.0099 * e, .protrusion = e};
  const int before = omp_get_max_threads();
  std::vector<Filled> found;
  for (int threads : {1, 3}) {
    omp_set_num_threads(threads);
    found.push_back(fill_body(surface, BallSet(cover.balls), options));
  }
  omp_set_num_threads(before);
  const Filled& filled = found[0];
  EXPECT_TRUE(filled.covered);
  EXPECT_GE(filled.balls.size(), 1u);
  EXPECT_LT(filled.balls.size(), 60u);
  ASSERT_EQ(found[1].balls.size(), filled.balls.size());
  for (std::size_t k = 0; k < filled.balls.size(); k++)
    ASSERT_EQ(found[1].balls[k].center, filled.balls[k].center);
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

TEST(Fill, AnOpenSurfaceHasNoInside) {
  const Surface surface(unit(shapes::square(1)));
  EXPECT_FALSE(
      fill_body(surface, BallSet({{Point::Zero(), 2}}), {.depth = 0.01, .protrusion = 0.01}).covered);
}

TEST(Cull, WithoutProtrusionAllBallsAreInside) {
  const Surface surface(shape(2));
  const Culled culled = cull(surface, {.only_protrusion = 0, .only_gap = 0.02});
  EXPECT_TRUE(culled.covered && culled.proved);
  EXPECT_LE(protrusion_bound(surface, culled.balls).max, 0);
  EXPECT_LE(gap_bound(surface.mesh(), BallSet(culled.balls), 0.02).upper, 0.02);
}

}  // namespace
}  // namespace padder
