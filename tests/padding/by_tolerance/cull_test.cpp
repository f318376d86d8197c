// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/cull.h"

#include <gtest/gtest.h>

#include "padding/asset/error.h"
#include "padding/verify/union_shape.h"
#include "tests/padding/balls.h"
#include "tests/padding/random_input.h"
#include "tests/padding/shapes.h"

namespace padder {
namespace {

const Surface& torus() {
  static const Surface surface(shapes::unit(shapes::torus(1, 0.35, 32, 16)));
  return surface;
}

// The certificate proves what the result says of itself.
void expect_proved(const Surface& surface, const Culled& culled) {
  ASSERT_TRUE(culled.proved);
  EXPECT_EQ(culled.triangle.size(), culled.balls.size());
  EXPECT_LE(protrusion_bound(surface, culled.balls).max, culled.protrusion + 1e-12);
  EXPECT_TRUE(
      gap_failures(surface.mesh(), BallSet(culled.balls), culled.gap + 1e-12, 0.1 * culled.gap).empty());
}

TEST(Cull, ToleranceIsKept) {
  const Culled culled = cull(torus(), {.tolerance = 0.03});
  expect_proved(torus(), culled);
  EXPECT_LE(culled.protrusion, 0.03);
  EXPECT_LE(culled.gap, 0.03);
  EXPECT_TRUE(culled.within);
}

TEST(Cull, CountIsUsedUpAndMoreSpheresAreBetter) {
  double last = 1;
  for (std::uint64_t count : {3, 25}) {
    const Culled culled = cull(torus(), {.max_spheres = count});
    expect_proved(torus(), culled);
    EXPECT_LE(culled.balls.size(), count);
    EXPECT_GE(static_cast<double>(culled.balls.size()), 0.8 * static_cast<double>(count));
    EXPECT_LT(culled.gap, last);
    last = culled.gap;
  }
}

// A larger count is never worse, and no tolerance is kept by so few that the count finds none as small. The
// rungs of the search are 0.6 % apart.
TEST(Cull, ASmallCountIsUsedWell) {
  shapes::RandomInput random(5);
  const Mesh meshes[] = {shapes::box({0, 0, 0}, {1, 1, 1}), shapes::blob(random, 3),
                         shapes::torus(1, 0.3, 48, 24)};
  for (std::size_t m = 0; m < std::size(meshes); m++) {
    const Surface surface(shapes::unit(meshes[m]));
    double errors[9] = {1};
    for (std::uint64_t count = 1; count <= 8; count++) {
      const Culled culled = cull(surface, {.max_spheres = count});
      expect_proved(surface, culled);
      EXPECT_LE(culled.balls.size(), count);
      errors[count] = culled.gap;
      EXPECT_LE(errors[count], errors[count - 1]) << "mesh " << m << ", count " << count;
    }
    for (double tolerance = 0.45;; tolerance *= 0.9) {
      const std::size_t count = cull(surface, {.tolerance = tolerance}).balls.size();
      if (count > 8) break;
      EXPECT_LE(errors[count], 1.01 * tolerance) << "mesh " << m << ", count " << count;
    }
  }
}

// Spheres too large for the ring's inside stand out of it: the smallest error for that is found, and nothing
// smaller tried.
TEST(Cull, ASmallestRadiusIsKeptByACount) {
  const Culled large = cull(torus(), {.max_spheres = 60, .min_radius = 0.15});
  expect_proved(torus(), large);
  EXPECT_EQ(large.open.why, WhyOpen::nothing);
  for (const Ball& ball : large.balls) EXPECT_GE(ball.radius, 0.15);
  EXPECT_GT(large.gap, 2 * cull(torus(), {.max_spheres = 60}).gap);
}

TEST(Cull, CountComesBeforeTolerance) {
  const Culled few = cull(torus(), {.tolerance = 0.004, .max_spheres = 20});
  expect_proved(torus(), few);
  EXPECT_LE(few.balls.size(), 20u);
  EXPECT_FALSE(few.within);
  EXPECT_GT(few.gap, 0.004);
  const Culled plenty = cull(torus(), {.tolerance = 0.03, .max_spheres = 100000});
  EXPECT_TRUE(plenty.within);
  EXPECT_EQ(plenty.balls.size(), cull(torus(), {.tolerance = 0.03}).balls.size());
}

TEST(Cull, VolumeIsMatchedWithinTheTolerance) {
  const Culled culled = cull(torus(), {.tolerance = 0.03, .balance = Balance::volume});
  expect_proved(torus(), culled);
  EXPECT_LE(std::max(culled.protrusion, culled.gap), 0.03 * (1 + 1e-9));
  const double body = mass_properties(torus().mesh()).volume;
  EXPECT_NEAR(union_shape(torus(), culled.balls, 400000).volume / body, 1, 0.01);
}

TEST(Cull, MeansGetSmallerWithinTheTolerance) {
  const Culled none = cull(torus(), {.tolerance = 0.03});
  const Culled mean = cull(torus(), {.tolerance = 0.03, .balance = Balance::mean});
  expect_proved(torus(), mean);
  EXPECT_LE(std::max(mean.protrusion, mean.gap), 0.03 * (1 + 1e-9));
  EXPECT_LE(mean.balls.size(), none.balls.size() * 3 / 2);
  const UnionShape before = union_shape(torus(), none.balls), after = union_shape(torus(), mean.balls);
  EXPECT_LT(after.protrusion + after.gap, 0.9 * (before.protrusion + before.gap));
}

TEST(Cull, RadiusLimitsAreKeptWhateverIsBalanced) {
  const Surface box(shapes::unit(shapes::box({0, 0, 0}, {1, 1, 1})));
  const auto radius = [](const Ball& ball) { return ball.radius; };
  for (const Balance balance : {Balance::none, Balance::volume, Balance::mean}) {
    SCOPED_TRACE(static_cast<int>(balance));
    const Culled small = cull(box, {.tolerance = 0.1, .max_radius = 0.04, .balance = balance, .effort = 0});
    expect_proved(box, small);
    EXPECT_LE(radius(*std::ranges::max_element(small.balls, {}, radius)), 0.04);
    const Culled large = cull(box, {.tolerance = 0.1, .min_radius = 0.15, .balance = balance, .effort = 0});
    expect_proved(box, large);
    EXPECT_GE(radius(*std::ranges::min_element(large.balls, {}, radius)), 0.15);
  }
}

// Smaller errors, which are smoother, are beyond spheres so large. The tolerance is not.
TEST(Cull, WhatTheToleranceCoversStaysCovered) {
  const Surface box(shapes::unit(shapes::box({0, 0, 0}, {1, 1, 1})));
  const CullOptions plain{.tolerance = 0.05, .min_radius = 0.08, .effort = 0};
  const std::size_t balls = cull(box, plain).balls.size();
  CullOptions options = plain;
  options.smooth = 10;
  const Culled smooth = cull(box, options);
  expect_proved(box, smooth);
  EXPECT_LE(smooth.balls.size(), 10 * balls);
  // Of a ring so thin no sphere is as large.
  options = {.tolerance = 0.1, .min_radius = 0.15, .effort = 0};
  for (const Balance balance : {Balance::none, Balance::volume, Balance::mean}) {
    options.balance = balance, options.smooth = balance == Balance::none ? 10 : 0;
    expect_proved(torus(), cull(torus(), options));
  }
}

TEST(Cull, SmoothnessIsReached) {
  const double rough = union_shape(torus(), cull(torus(), {.tolerance = 0.03}).balls).normal_error;
  const Culled smooth = cull(torus(), {.tolerance = 0.03, .smooth = 0.8 * rough});
  expect_proved(torus(), smooth);
  EXPECT_LE(union_shape(torus(), smooth.balls).normal_error, 0.8 * rough);
}

// From a plate that is much thinner than the tolerance, balls of any size stand out alike.
TEST(Cull, WhatGetsNoSmootherIsNotMadeFiner) {
  const Surface plate(shapes::unit(shapes::box({0, 0, 0}, {1, 1, 1e-4})));
  const Culled rough = cull(plate, {.tolerance = 0.1, .effort = 0});
  const Culled smooth = cull(plate, {.tolerance = 0.1, .smooth = 45, .effort = 0});
  expect_proved(plate, smooth);
  EXPECT_GT(union_shape(plate, smooth.balls).normal_error, 45);
  EXPECT_LE(smooth.balls.size(), 2 * rough.balls.size());
}

// Much less than that is asked for: one cover of a smaller sum tells that more are in vain.
TEST(Cull, WhatGetsNoSmootherIsToldByOneCover) {
  const Surface plate(shapes::unit(shapes::box({0, 0, 0}, {1, 1, 1e-4})));
  const auto told = [&plate](double smooth) {
    int times = 0;
    cull(plate, {.tolerance = 0.1, .smooth = smooth, .effort = 0, .tell = [&times](double) { times++; }});
    return times;
  };
  EXPECT_LE(told(10), 3 * told(0));
}

TEST(Cull, SmoothnessTakesWhatTheCountAllows) {
  const Culled rough = cull(torus(), {.tolerance = 0.03, .effort = 0});
  const std::size_t count = 2 * rough.balls.size();
  const Culled smooth = cull(torus(), {.tolerance = 0.03, .max_spheres = count, .smooth = 1, .effort = 0});
  expect_proved(torus(), smooth);
  EXPECT_LE(smooth.balls.size(), count);
  EXPECT_GT(smooth.balls.size(), rough.balls.size());
  EXPECT_LT(union_shape(torus(), smooth.balls).normal_error,
            0.9 * union_shape(torus(), rough.balls).normal_error);
}

// The smallest error that so many spheres can keep is known: a smaller one is not tried.
TEST(Cull, NothingIsTriedThatACountForbids) {
  const auto told = [](double smooth, Culled& culled) {
    int times = 0;
    CullOptions options{.max_spheres = 20, .smooth = smooth, .effort = 0};
    options.tell = [&](double) { times++; };
    culled = cull(torus(), options);
    return times;
  };
  Culled plain, smooth;
  EXPECT_EQ(told(1, smooth), told(0, plain));
  expect_same(smooth.balls, plain.balls);
}

TEST(Cull, SomethingMustBeAsked) { EXPECT_THROW(cull(torus(), {}), Error); }

}  // namespace
}  // namespace padder
