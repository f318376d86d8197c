// SPDX-License-Identifier: MIT
#include "padding/verify/certify.h"

#include <gtest/gtest.h>

#include <random>

#include "padding/geometry/medial.h"
#include "padding/geometry/random.h"
#include "tests/padding/shapes.h"
#include "tests/padding/threads.h"

namespace padder {
namespace {

std::vector<Ball> balls_of(const Surface& surface, double dilation) {
  std::vector<Ball> balls;
  const Mesh& mesh = surface.mesh();
  for (std::size_t t = 0; t < mesh.triangles.size(); t++) {
    balls.push_back(inner_medial_ball(surface, mesh.middle(t), mesh.area_normal(t).normalized(), 2, 1e-6));
    balls.back().radius += dilation;
  }
  return balls;
}

TEST(Certify, OneBallOverASquareIsExact) {
  // The farthest point of the square [0,1]^2 from the ball is the corner (1,1,0).
  const Mesh mesh = shapes::square(1);
  const BallSet balls({{Point(0.25, 0.25, -0.5), 0.6}});
  const GapBound bound = gap_bound(mesh, balls);
  const double exact = std::sqrt(2 * 0.75 * 0.75 + 0.25) - 0.6;
  EXPECT_GE(bound.upper, exact);
  EXPECT_LE(bound.lower, exact);
  EXPECT_NEAR(bound.upper, exact, 1e-3 * exact);
  EXPECT_NEAR((bound.point - Point(1, 1, 0)).norm(), 0, 1e-3);
}

TEST(Certify, GapBetweenBallsInsideOneTriangle) {
  // Four balls at the corners of a square: the gap is at its middle, far from any vertex of the mesh.
  const Mesh mesh = shapes::square(1);
  const BallSet balls(
      {{Point(0, 0, 0), 0.5}, {Point(1, 0, 0), 0.5}, {Point(0, 1, 0), 0.5}, {Point(1, 1, 0), 0.5}});
  const GapBound bound = gap_bound(mesh, balls);
  const double exact = std::sqrt(0.5) - 0.5;
  EXPECT_GE(bound.upper, exact - 1e-15);
  EXPECT_NEAR(bound.upper, exact, 1e-3 * exact + 1e-12);
  EXPECT_TRUE(gap_failures(mesh, balls, exact + 1e-6, 0.1).empty());
  const auto failures = gap_failures(mesh, balls, exact - 1e-6, 0.1);
  ASSERT_FALSE(failures.empty());
  for (const GapPart& part : failures) EXPECT_LT((part.centroid() - Point(0.5, 0.5, 0)).norm(), 0.1);
}

TEST(Certify, CoveredSurfaceHasNoGap) {
  const Mesh mesh = shapes::sphere(2);
  EXPECT_EQ(gap_bound(mesh, BallSet({{Point(0.1, 0, 0), 1.2}})).upper, 0);
  EXPECT_EQ(gap_bound(mesh, BallSet()).upper, std::numeric_limits<double>::infinity());
  EXPECT_EQ(gap_bound(Mesh(), BallSet()).upper, 0);
}

// The corners of the cube are nearest to the sphere, from inside.
TEST(Certify, AFloorBelow0AsksHowDeepInsideTheSurfaceLies) {
  const Mesh mesh = shapes::box({-0.5, -0.5, -0.5}, {0.5, 0.5, 0.5});
  const BallSet ball({{Point(0, 0, 0), 1}});
  const double exact = std::sqrt(0.75) - 1;
  const GapBound depth = gap_bound(mesh, ball, -1);
  EXPECT_GE(depth.upper, exact - 1e-15);
  EXPECT_NEAR(depth.upper, exact, 1e-3);
  EXPECT_EQ(gap_bound(mesh, ball, -0.1).upper, -0.1);
  EXPECT_GT(gap_bound(mesh, BallSet({{Point(0, 0, 0), 0.8}}), -0.1).upper, 0);
}

// The oracle is a dense random sampling: it must stay below the proved bound and come near to it.
TEST(Certify, BoundsHoldAgainstDenseSampling) {
  for (const Mesh& mesh : {shapes::box({0, 0, 0}, {1, 0.7, 0.1}, 4), shapes::torus(1, 0.3, 24, 12)}) {
    const Surface surface(mesh);
    const std::vector<Ball> balls = balls_of(surface, 0.01);
    const BallSet set(balls);
    const GapBound gap = gap_bound(mesh, set);
    const ProtrusionBound protrusion = protrusion_bound(surface, balls);
    EXPECT_LE(protrusion.max, 0.01 + 1e-9);
    EXPECT_LE(gap.lower, gap.upper);
    EXPECT_LE(gap.upper, gap.lower * 1.001 + 1e-9);
    std::mt19937 random(5);
    Random places(5);
    std::normal_distribution<double> gauss;
    double sampled_gap = 0, sampled_protrusion = 0;
    for (int k = 0; k < 200000; k++) {
      const Point x = random_point(places, mesh.corners(places.below(mesh.triangles.size())));
      sampled_gap = std::max(sampled_gap, set.gap(x).value);
      const Ball& ball = balls[random() % balls.size()];
      const Point y =
          ball.center + ball.radius * Vector(gauss(random), gauss(random), gauss(random)).normalized();
      if (k % 10 == 0) sampled_protrusion = std::max(sampled_protrusion, surface.signed_nearest(y).distance);
    }
    EXPECT_LE(sampled_gap, gap.upper + 1e-12);
    EXPECT_GE(sampled_gap, 0.8 * gap.upper);
    EXPECT_LE(sampled_protrusion, protrusion.max + 1e-12);
    EXPECT_GE(sampled_protrusion, 0.8 * protrusion.max);
    EXPECT_TRUE(gap_failures(mesh, set, gap.upper, 0.02).empty());
    EXPECT_FALSE(gap_failures(mesh, set, 0.99 * gap.lower, 0.02).empty());
  }
}

double bound_of(const Surface& surface, const Ball& ball) { return protrusion_bound(surface, {ball}).max; }

TEST(Certify, BallOutsideStandsOutByItsWholeReach) {
  const Surface surface(shapes::sphere(3));
  const Ball outside{Point(3, 0, 0), 0.25}, inside{Point(0, 0, 0), 0.5};
  EXPECT_NEAR(bound_of(surface, outside), 2.25, 1e-12);
  EXPECT_LT(bound_of(surface, inside), -0.48);
  EXPECT_EQ(protrusion_bound(surface, {inside, outside}).max, bound_of(surface, outside));
}

// The bound checks its own premises, whatever SideBy the surface was made with.
TEST(Certify, ABodyTurnedInsideOutHasNoInside) {
  const std::vector<Ball> balls = {{Point(0.5, 0.5, 0.5), 0.4}, {Point(3, 0.5, 0.5), 1.9}};
  const Mesh cube = shapes::box({0, 0, 0}, {1, 1, 1});
  const Surface right(cube), wrong(shapes::turned_over(cube));
  EXPECT_TRUE(protrusion_bound(right, balls).proved);
  EXPECT_EQ(protrusion_bound(right, balls).outside, 1u);
  EXPECT_NEAR(bound_of(right, balls[0]), -0.1, 1e-12);
  EXPECT_NEAR(bound_of(right, balls[1]), 3.9, 1e-12);
  EXPECT_EQ(protrusion_bound(wrong, balls).outside, 2u);
  EXPECT_NEAR(bound_of(wrong, balls[0]), 0.9, 1e-12);
  EXPECT_NEAR(bound_of(wrong, balls[1]), 3.9, 1e-12);  // by the normals it would be -0.1
}

// Pseudonormals would give the wrong side here: outside above a face that lies inside the other solid, and
// inside below a face of a part that is turned inside out.
TEST(Certify, CrossingSolidsAreProvedByTheirWindingNumber) {
  const Mesh mesh =
      shapes::joined(shapes::box({0, 0, 0}, {1, 1, 1}), shapes::box({0.4, 0.4, 0.4}, {1.6, 0.6, 0.6}));
  const Surface surface(mesh);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> u(-0.3, 1.9);
  std::vector<Ball> balls;
  for (int k = 0; k < 2000; k++) balls.push_back({Point(u(random), u(random), u(random)), 0.05});
  EXPECT_TRUE(protrusion_bound(surface, balls).proved);
  using shapes::in_box;
  for (std::size_t k = 0; k < balls.size(); k++) {
    const Point& c = balls[k].center;
    const bool inside = in_box(c, {0, 0, 0}, {1, 1, 1}) || in_box(c, {0.4, 0.4, 0.4}, {1.6, 0.6, 0.6});
    const double distance = surface.nearest(c).distance;
    EXPECT_NEAR(bound_of(surface, balls[k]), 0.05 + (inside ? -distance : distance), 1e-12) << k;
  }
}

TEST(Certify, AnOpenSurfaceProvesNothing) {
  Mesh box = shapes::box({0, 0, 0}, {1, 1, 1}, 2);
  EXPECT_TRUE(protrusion_bound(Surface(box), {{Point(0.5, 0.5, 0.5), 0.4}}).proved);
  box.triangles.pop_back();
  EXPECT_FALSE(protrusion_bound(Surface(box), {{Point(0.5, 0.5, 0.5), 0.4}}).proved);
}

TEST(Certify, SameResultForAnyNumberOfThreads) {
  const Mesh mesh = shapes::torus(1, 0.3, 60, 30);
  const Surface surface(mesh);
  const std::vector<Ball> balls = balls_of(surface, 0.001);
  const BallSet set(balls);
  const auto bound = [&] { return gap_bound(mesh, set); };
  const GapBound one = with_threads(1, bound);
  const auto failures = [&] { return gap_failures(mesh, set, 0.5 * one.upper, 0.02).size(); };
  for (const int threads : {2, 5}) {
    const GapBound more = with_threads(threads, bound);
    EXPECT_EQ(more.upper, one.upper);
    EXPECT_EQ(more.lower, one.lower);
    EXPECT_EQ(more.point, one.point);
    EXPECT_EQ(with_threads(threads, failures), with_threads(1, failures));
  }
}

TEST(Certify, WhereBallsAreOnlyAddedWhatFailedBeforeIsEnoughToAsk) {
  const Mesh mesh = shapes::torus(1, 0.2, 40, 12);
  const Surface surface(mesh);
  const std::vector<Ball> all = balls_of(surface, 0.005);
  std::vector<Ball> half(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2));
  constexpr double bound = 0.01, grain = 0.02;
  constexpr std::size_t any = std::numeric_limits<std::size_t>::max();
  const auto first = gap_failures(mesh, BallSet(half), bound, grain);
  const auto fresh = gap_failures(mesh, BallSet(all), bound, grain);
  const auto again = gap_failures(first, BallSet(all), bound, grain, any);
  ASSERT_FALSE(fresh.empty());
  ASSERT_LT(fresh.size(), first.size());
  ASSERT_EQ(again->size(), fresh.size());
  for (std::size_t k = 0; k < fresh.size(); k++) {
    EXPECT_EQ((*again)[k].corner, fresh[k].corner);
    EXPECT_EQ((*again)[k].value, fresh[k].value);
    EXPECT_EQ((*again)[k].triangle, fresh[k].triangle);
  }
}

TEST(Certify, GivesUpWhereMorePartsFailThanAreWanted) {
  const Mesh mesh = shapes::sphere(4);
  const BallSet balls({{Point(0, 0, 0), 0.5}});
  const std::vector<GapPart> whole = whole_triangles(mesh);
  const std::size_t all = gap_failures(mesh, balls, 0.1, 0.05).size();
  ASSERT_GE(all, mesh.triangles.size());
  EXPECT_FALSE(gap_failures(whole, balls, 0.1, 0.05, all - 1));
  EXPECT_EQ(gap_failures(whole, balls, 0.1, 0.05, all).value().size(), all);
}

}  // namespace
}  // namespace padder
