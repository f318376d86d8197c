// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/verify/wrapped.h"

#include <gtest/gtest.h>

#include "padding/by_tolerance/cover.h"
#include "padding/meshing/repair.h"
#include "padding/verify/certify.h"
#include "tests/padding/random_input.h"
#include "tests/padding/threads.h"

namespace padder {
namespace {

using shapes::RandomInput, shapes::joined;

// The distance of two slabs is `width`, that of their far faces 0.8 + width.
Mesh slit(double width) {
  return joined(shapes::box({0, 0, 0}, {1, 1, 0.4}, 2),
                shapes::box({0, 0, 0.4 + width}, {1, 1, 0.8 + width}, 2));
}

Repaired wrapped(const Mesh& mesh, double tolerance) {
  return repair(mesh, {.mode = RepairMode::wrap, .tolerance = tolerance}, "input");
}

TEST(Standoffs, AreUpperBoundsNearTheTruth) {
  for (std::uint64_t seed = 1; seed <= 5; seed++) {
    RandomInput random(seed);
    const Mesh input = shapes::random_soup(random, 40, 0.3, 0.25), mesh = shapes::blob(random, 2);
    const Surface surface(input);
    const double slack = 0.01;
    const std::vector<double> found = standoffs(mesh, surface, slack);
    ASSERT_EQ(found.size(), mesh.triangles.size());
    for (std::size_t t = 0; t < found.size(); t++) {
      double largest = 0;
      for (int k = 0; k < 200; k++) largest = std::max(largest, surface.nearest(random.on(mesh, t)).distance);
      for (int k = 0; k < 3; k++) largest = std::max(largest, surface.nearest(mesh.corner(t, k)).distance);
      EXPECT_GE(found[t], largest);
      EXPECT_LE(found[t], largest + 3 * slack);  // 200 points miss the largest by some
    }
  }
}

TEST(Standoffs, OfAParallelPlateAreItsDistance) {
  const Mesh above = shapes::moved(shapes::square(1, 7), {0, 0, 0.25});
  for (const double standoff : standoffs(above, Surface(shapes::square(1, 50)), 0.002)) {
    EXPECT_GE(standoff, 0.25);
    EXPECT_LE(standoff, 0.252 + 1e-12);
  }
}

TEST(Wrapped, ClosedSlotsHaveTheirWidthAreaAndPlace) {
  const double width = 0.06;
  const Mesh input = slit(width);
  const Repaired wrap = repair(input, {.mode = RepairMode::wrap, .alpha = 0.1}, "slit");
  const auto found = standoffs(wrap.mesh, Surface(input), 0.0005);
  EXPECT_TRUE(closed_slots(wrap.mesh, found, 0.04).empty());
  const auto slots = closed_slots(wrap.mesh, found, 0.02);
  ASSERT_FALSE(slots.empty());
  double area = 0;
  for (std::size_t k = 0; k < slots.size(); k++) {
    EXPECT_LE(slots[k].width, width + 0.025);
    EXPECT_NEAR(slots[k].place.z(), 0.43, 0.04);
    EXPECT_FALSE(slots[k].triangles.empty());
    if (k > 0) {
      EXPECT_LE(slots[k].width, slots[k - 1].width);
    }
    area += slots[k].area;
  }
  EXPECT_GE(slots[0].width, width);
  EXPECT_GE(area, 3 * width);  // around the slit, with parts of the facets beside it
  EXPECT_LE(area, 12 * width);
}

TEST(Wrapped, TouchableSurfaceEndsWhereTheWrapIsFar) {
  const Mesh input =
      joined(shapes::box({0, 0, 0}, {1, 1, 1}, 2), shapes::box({0.5, 0.25, 0.25}, {1.5, 0.75, 0.75}, 2));
  const Repaired wrap = repair(input, {.mode = RepairMode::wrap, .accuracy = 0.05}, "boxes");
  const Touchable kept = touchable(input, Surface(wrap.mesh), 2 * wrap.offset, 0.02);
  // Half of the small box but its end, its other end, and the patch that it covers on the large one.
  EXPECT_NEAR(kept.buried.area(), 0.25 + 4 * 0.5 * 0.5 + 0.25, 0.17);
  EXPECT_NEAR(kept.mesh.area() + kept.buried.area(), input.area(), 1e-9);
}

// The theorem of docs/tolerance.md, sampled: what a ball has outside of the wrap lies within the protrusion
// of the input, and every point of the input lies within the gap of a ball.
TEST(Wrapped, ACertifiedCoverKeepsTheToleranceAgainstTheInput) {
  const double tolerance = 0.06;
  for (std::uint64_t seed = 1; seed <= 6; seed++) {
    RandomInput random(seed);
    Mesh input = seed % 3 == 0 ? slit(random.uniform(0.01, 0.2))
                               : shapes::random_soup(random, 6 + int(seed), 0.3, 0.25);
    if (seed == 4) input.triangles.push_back({0, 1, 1});  // without area
    const Repaired wrap = wrapped(input, tolerance);
    const Surface plain(input);
    const auto hull =
        std::make_shared<const Surface>(wrap.mesh, wrap.side(), standoffs(wrap.mesh, plain, 0.001));
    const Surface surface(plain, hull);
    const Cover cover = cover_surface(surface, {.protrusion = tolerance, .gap = tolerance, .effort = 0});
    ASSERT_EQ(cover.open.why, WhyOpen::nothing);
    ASSERT_TRUE(cover.proved);
    const BallSet balls(cover.balls);
    EXPECT_LE(gap_bound(input, balls, tolerance).upper, tolerance);
    double gap = 0, protrusion = 0;
    for (int k = 0; k < 20000; k++)
      gap = std::max(gap, balls.gap(random.on(input, random.below(input.triangles.size()))).value);
    EXPECT_LE(gap, tolerance);
    for (int k = 0; k < 20000; k++) {
      const Ball& ball = cover.balls[static_cast<std::size_t>(k) % cover.balls.size()];
      const Point x = ball.center + ball.radius * random.direction();
      const double distance = plain.nearest(x).distance;
      if (distance > protrusion && shapes::winding(wrap.mesh, x) < 0.5) protrusion = distance;
    }
    EXPECT_LE(protrusion, tolerance);
    EXPECT_GT(protrusion, 0.5 * tolerance);  // or nothing was tested
  }
}

TEST(Wrapped, SameForAnyNumberOfThreads) {
  RandomInput random(3);
  const Mesh input = shapes::random_soup(random, 30, 0.3, 0.25), mesh = shapes::blob(random, 3);
  const auto found = [&] { return standoffs(mesh, Surface(input), 0.01); };
  EXPECT_EQ(with_threads(1, found), with_threads(3, found));
  const auto kept = [&] { return touchable(input, Surface(mesh), 0.1, 0.01); };
  const Touchable whole = with_threads(1, kept), again = with_threads(3, kept);
  EXPECT_EQ(again.mesh.points, whole.mesh.points);
  EXPECT_EQ(again.buried.points, whole.buried.points);
}

}  // namespace
}  // namespace padder
