// SPDX-License-Identifier: MIT
#include "padding/geometry/medial.h"

#include <gtest/gtest.h>

#include "tests/padding/random_input.h"
#include "tests/padding/shapes.h"

namespace padder {
namespace {

TEST(Medial, PlateGivesHalfItsThickness) {
  const Surface surface(shapes::box({0, 0, 0}, {2, 2, 0.05}, 20));
  const Ball ball = inner_medial_ball(surface, {1.01, 0.93, 0.05}, Vector::UnitZ(), 3, 1e-9);
  EXPECT_NEAR(ball.radius, 0.025, 1e-8);
  EXPECT_NEAR((ball.center - Point(1.01, 0.93, 0.025)).norm(), 0, 1e-8);
}

TEST(Medial, BoxFaceIsLimitedByTheNearestSide) {
  const Surface surface(shapes::box({0, 0, 0}, {1, 1, 1}));
  for (double x : {0.5, 0.3, 0.1, 0.01}) {
    const Ball ball = inner_medial_ball(surface, {x, 0.5, 1}, Vector::UnitZ(), 2, 1e-9);
    EXPECT_NEAR(ball.radius, x, 1e-8);
  }
}

TEST(Medial, SphereGivesItsInscribedBall) {
  const Surface surface(shapes::sphere(4));
  const Point p = surface.mesh().points[77];
  const Ball ball = inner_medial_ball(surface, p, p.normalized(), 3, 0.01);
  EXPECT_NEAR(ball.radius, 1, 0.011);
}

TEST(Medial, BallSitsOnAWallThatIsThinnerThanTheTolerance) {
  const Mesh outer = shapes::sphere(4);
  const Mesh inner = shapes::scaled(outer, 1 - 1e-4);
  const Surface shell(shapes::joined(outer, shapes::turned_over(inner)));
  for (const double guess : {0.0, 0.05, 2.0})
    for (const double side : {1.0, -1.0}) {
      const Point p = (side > 0 ? outer : inner).corner(77, 0);
      const Ball ball = inner_medial_ball(shell, p, side * p.normalized(), 3, 1e-2, guess);
      EXPECT_EQ(ball.center, p) << "guess " << guess << ", side " << side;
      EXPECT_EQ(ball.radius, 0);
    }
  // In a thick body the ball grows from a small guess.
  const Surface cube(shapes::box({0, 0, 0}, {1, 1, 1}));
  EXPECT_NEAR(inner_medial_ball(cube, {0.5, 0.5, 1}, Vector::UnitZ(), 2, 1e-2, 0.02).radius, 0.5, 1e-2);
}

TEST(Medial, LargestIsKept) {
  const Surface surface(shapes::box({0, 0, 0}, {1, 1, 1}));
  EXPECT_NEAR(inner_medial_ball(surface, {0.5, 0.5, 1}, Vector::UnitZ(), 0.2, 1e-9).radius, 0.2, 1e-12);
}

// The contract holds on any shape, at any point, on edges and corners, with normals that are off by up to 60
// degrees.
TEST(Medial, PostconditionHoldsForAnyNormal) {
  shapes::RandomInput random(3);
  for (const Mesh& mesh :
       {shapes::box({0, 0, 0}, {1, 2, 0.01}, 3), shapes::torus(1, 0.3, 24, 12), shapes::sphere(3)}) {
    const Surface surface(mesh);
    for (int k = 0; k < 2000; k++) {
      const std::size_t t = random.below(mesh.triangles.size());
      Point p = random.on(mesh, t);
      if (k % 3 == 0) p = mesh.corner(t, 0) + random.uniform(0, 1) * (mesh.corner(t, 2) - mesh.corner(t, 0));
      if (k % 9 == 0) p = mesh.corner(t, 0);
      const Vector off = 0.25 * (k % 5) * random.uniform(0, 3) * random.direction();
      const Vector normal = (mesh.area_normal(t).normalized() + off).normalized();
      const double tolerance = 1e-4;
      const Ball ball = inner_medial_ball(surface, p, normal, 3, tolerance);
      const Nearest at = surface.signed_nearest(ball.center);
      ASSERT_TRUE(at.distance <= 0 || ball.radius == 0);
      ASSERT_NEAR(std::abs(at.distance), ball.radius, 1e-12);
      ASSERT_LE((p - ball.center).norm(), ball.radius + 2 * tolerance + 1e-12);
    }
  }
}

// Noise of half an edge tilts the triangles by some 45 degrees.
TEST(Medial, ARoughSurfaceGivesTheBallsOfTheBody) {
  shapes::RandomInput random(5);
  const Mesh mesh = shapes::roughened(shapes::torus(1, 0.3, 400, 120), 0.008, random);
  const Surface surface(mesh, SideBy::winding);
  int large = 0;
  constexpr int tried = 500;
  for (std::size_t k = 0; k < tried; k++) {
    const std::size_t t = k * mesh.triangles.size() / tried;
    large +=
        inner_medial_ball(surface, mesh.middle(t), mesh.area_normal(t).normalized(), 3, 0.01).radius > 0.25;
  }
  EXPECT_GT(large, 0.3 * tried);  // 2 % of the balls below these points are so large
}

// What a ball nearby tells of the side is what the winding number tells.
TEST(Medial, ABallNearbyChangesNothing) {
  const Mesh mesh = shapes::torus(1, 0.3, 24, 12);
  const Surface surface(mesh, SideBy::winding);
  shapes::RandomInput random(3);
  int near = 0;
  for (int k = 0; k < 500; k++) {
    const std::size_t s = random.below(mesh.triangles.size()), t = (s + 1) % mesh.triangles.size();
    const auto ball_at = [&](std::size_t triangle, const Ball& inner) {
      return inner_medial_ball(surface, mesh.middle(triangle), mesh.area_normal(triangle).normalized(), 3,
                               1e-4, 0.5, inner);
    };
    const Ball inner = ball_at(s, {}), with = ball_at(t, inner), without = ball_at(t, {});
    near += (with.center - inner.center).norm() < inner.radius;
    EXPECT_EQ(with.center, without.center);
    EXPECT_EQ(with.radius, without.radius);
  }
  EXPECT_GT(near, 100);
}

}  // namespace
}  // namespace padder
