// SPDX-License-Identifier: MIT
#include "padding/by_depth/fit.h"

#include <gtest/gtest.h>

#include "padding/asset/error.h"
#include "padding/geometry/triangle.h"
#include "tests/padding/random_input.h"

namespace padder {
namespace {

constexpr double kNoGuard = 1e300;

TEST(Fit, EverySphereGoesThroughItsCornersAndStandsOutByItsCap) {
  for (std::uint64_t seed = 1; seed <= 20; seed++) {
    shapes::RandomInput random(seed);
    const Mesh mesh = shapes::blob(random, 3);
    const double depth = random.uniform(0.05, 1);
    const auto balls = fit(mesh, depth, kNoGuard);
    ASSERT_EQ(balls.size(), mesh.triangles.size());
    for (std::size_t t = 0; t < balls.size(); t++) {
      const auto& [ball, cap, triangle] = balls[t];
      EXPECT_EQ(triangle, t);
      for (int k = 0; k < 3; k++)
        EXPECT_NEAR((mesh.corner(t, k) - ball.center).norm(), ball.radius, 1e-10 * ball.radius);
      const Triangle3 tri{mesh.corner(t, 0), mesh.corner(t, 1), mesh.corner(t, 2)};
      EXPECT_NEAR(cap, depth * tri.circumradius(), 1e-12);
      const Vector n = tri.area_normal().normalized();
      EXPECT_NEAR((ball.center + ball.radius * n - tri.a).dot(n), cap, 1e-10);  // its top, above the plane
    }
  }
}

const Mesh kRightAngle{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}};

TEST(Fit, RadiusAtDepthOneFifthIsTwoPointSixCircumradii) {
  const auto balls = fit(kRightAngle, 0.2, kNoGuard);
  EXPECT_NEAR(balls[0].ball.radius, 2.6 * std::sqrt(0.5), 1e-12);
  EXPECT_LT(balls[0].ball.center.z(), 0);  // below, the normal being +z
}

TEST(Fit, DepthOneIsTheSphereOverTheCircumcircle) {
  const auto balls = fit(kRightAngle, 1, kNoGuard);
  EXPECT_NEAR(balls[0].ball.radius, std::sqrt(0.5), 1e-12);
  EXPECT_NEAR(balls[0].ball.center.z(), 0, 1e-12);
}

TEST(Fit, ASliverYieldsNoRunawaySphere) {
  const Mesh mesh{{{0, 0, 0}, {1, 0, 0}, {0.5, 1e-9, 0}}, {{0, 1, 2}}};
  const auto balls = fit(mesh, 0.2, 1);
  EXPECT_NEAR(balls[0].ball.radius, 2.6 * 0.5, 1e-9);
  for (const Point& p : mesh.points)
    EXPECT_LE((p - balls[0].ball.center).norm(), balls[0].ball.radius + 1e-9);
}

// The area of corners on a line is rounding, and so is the direction of its normal. Found by fuzzing.
TEST(Fit, CornersOnALineLieInTheSphereOfTheirSegment) {
  const Mesh mesh{{Point(52, 118, 49) / 3, Point(50, 83, 48) / 3, Point(48, 48, 47) / 3}, {{2, 1, 0}}};
  const Ball ball = fit(mesh, 0.2, 0.125)[0].ball;
  for (const Point& p : mesh.points) EXPECT_LE((p - ball.center).norm(), ball.radius * (1 + 1e-12));
}

TEST(Fit, RefusesADepthOutsideItsRange) {
  for (const double depth : {0.0, -0.1, 1.5, std::nan("")})
    EXPECT_THROW(fit(shapes::sphere(1), depth, 1), Error) << depth;
}

}  // namespace
}  // namespace padder
