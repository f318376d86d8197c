// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/lower_bound.h"

#include <gtest/gtest.h>

#include "padding/asset/error.h"
#include "padding/by_tolerance/cover.h"
#include "padding/geometry/random.h"
#include "tests/padding/shapes.h"
#include "tests/padding/threads.h"

namespace padder {
namespace {

using shapes::unit, shapes::joined, shapes::moved;

std::uint64_t bound_of(const Mesh& mesh, double e) {
  return fewest_balls(Surface(mesh), {.protrusion = e, .gap = e});
}

TEST(LowerBound, OneBallCoversASphere) { EXPECT_EQ(bound_of(unit(shapes::sphere(2)), 0.05), 1u); }

TEST(LowerBound, FarSpheresNeedABallEach) {
  const Mesh one = shapes::sphere(2);
  const Mesh two = joined(one, moved(one, {5, 0, 0}));
  EXPECT_EQ(bound_of(unit(two), 0.03), 2u);
  EXPECT_EQ(bound_of(unit(joined(two, moved(one, {0, 5, 0}))), 0.03), 3u);
}

// The corners of a thin bar are farther apart than any ball of it reaches: at least one ball for each
// section.
TEST(LowerBound, GrowsWithTheLengthOfABar) {
  const Mesh bar = unit(shapes::box({0, 0, 0}, {1, 0.02, 0.02}));
  const std::uint64_t bound = bound_of(bar, 0.015);
  const Cover cover = cover_surface(Surface(bar), {.protrusion = 0.015, .gap = 0.015, .effort = 3});
  EXPECT_GE(bound, 10u);
  EXPECT_LE(bound, cover.balls.size());
  EXPECT_LE(static_cast<double>(cover.balls.size()), 2.0 * static_cast<double>(bound));
}

// No cover that is found has fewer balls, whatever the share of both errors.
TEST(LowerBound, NoCoverHasFewerBalls) {
  Random random(11);
  for (int k = 0; k < 3; k++) {
    const Mesh meshes[] = {
        shapes::box({0, 0, 0}, {1, 0.2 + random.uniform(), 0.1 + random.uniform()}),
        shapes::torus(0.3, 0.05 + 0.15 * random.uniform(), 30, 16),
        joined(shapes::box({0, 0, 0}, {1, 1, 0.2}), shapes::box({0.3, 0.3, 0}, {0.6, 0.6, 0.9}))};
    const Mesh mesh = unit(meshes[k]);
    const double protrusion = 0.04 * random.uniform(), gap = 0.04 + 0.03 * random.uniform();
    // The last one intersects itself.
    const Surface surface(mesh, SideBy::winding);
    const Cover cover = cover_surface(surface, {.protrusion = protrusion, .gap = gap});
    ASSERT_EQ(cover.open.why, WhyOpen::nothing);
    const std::uint64_t bound = fewest_balls(surface, {.protrusion = protrusion, .gap = gap});
    EXPECT_GE(bound, 1u);
    EXPECT_LE(bound, cover.balls.size()) << "seed 11, round " << k;
  }
}

TEST(LowerBound, ComesNear) {
  const Mesh mesh = unit(shapes::torus(0.3, 0.1, 40, 20));
  const Cover cover = cover_surface(Surface(mesh), {.protrusion = 0.03, .gap = 0.03});
  EXPECT_LE(static_cast<double>(cover.balls.size()), 2.0 * static_cast<double>(bound_of(mesh, 0.03)));
}

// Smaller balls can only do worse.
TEST(LowerBound, ARadiusLimitRaisesIt) {
  const Surface surface(unit(shapes::box({0, 0, 0}, {1, 1, 1})));
  LowerBoundOptions options{.protrusion = 0.06, .gap = 0.06, .boxes = 10};
  const std::uint64_t free = fewest_balls(surface, options);
  options.max_radius = 0.06;
  EXPECT_GT(fewest_balls(surface, options), free);
}

TEST(LowerBound, SameForAnyNumberOfThreads) {
  const Mesh mesh = unit(shapes::box({0, 0, 0}, {1, 0.5, 0.2}));
  const auto bound = [&] { return bound_of(mesh, 0.05); };
  EXPECT_EQ(with_threads(1, bound), with_threads(3, bound));
}

TEST(LowerBound, EdgesOfWhatCanBeAsked) {
  EXPECT_EQ(bound_of(unit(shapes::square(1)), 0.01), 1u);  // no inside
  EXPECT_EQ(bound_of({}, 0.01), 0u);
  EXPECT_THROW(bound_of(unit(shapes::sphere(1)), 0), Error);
}

}  // namespace
}  // namespace padder
