// SPDX-License-Identifier: MIT
#include "padding/verify/union_shape.h"

#include <gtest/gtest.h>

#include <numbers>

#include "tests/padding/shapes.h"

namespace padder {
namespace {

constexpr double kPi = std::numbers::pi;

TEST(UnionShape, VolumeOfTwoOverlappingBalls) {
  const Surface surface(shapes::sphere(2));
  const double d = 1.2;  // between the centres of two unit balls, far from the origin
  const Point at(5, 7, -3);
  const UnionShape shape = union_shape(surface, {{at, 1}, {at + Vector(d, 0, 0), 1}}, 400000);
  const double lens = kPi * (4 + d) * (2 - d) * (2 - d) / 12;
  EXPECT_NEAR(shape.volume, 2 * 4 / 3.0 * kPi - lens, 0.003 * shape.volume);
}

TEST(UnionShape, ConcentricBallIsAllProtrusion) {
  const Surface surface(shapes::sphere(5));
  const UnionShape shape = union_shape(surface, {{Point::Zero(), 1.1}});
  EXPECT_NEAR(shape.volume, 4 / 3.0 * kPi * 1.331, 0.01);
  EXPECT_NEAR(shape.protrusion, 0.1, 1e-3);
  EXPECT_EQ(shape.gap, 0);
  EXPECT_LT(shape.normal_error, 1.5);  // the facets' own
}

TEST(UnionShape, SmallBallIsAllGap) {
  const Surface surface(shapes::sphere(5));
  const UnionShape shape = union_shape(surface, {{Point::Zero(), 0.9}, {Point::Zero(), 0.5}});
  EXPECT_NEAR(shape.gap, 0.1, 2e-3);
  EXPECT_EQ(shape.protrusion, 0);
}

TEST(UnionShape, NormalErrorOfAShiftedBall) {
  // Shifted by s, the normals differ by s sin(theta), on the mean over the sphere by s pi / 4.
  const Surface surface(shapes::sphere(6));
  const UnionShape shape = union_shape(surface, {{Point(0, 0.1, 0), 1}});
  EXPECT_NEAR(shape.normal_error, 0.1 * kPi / 4 * 180 / kPi, 0.2);
}

TEST(UnionShape, HiddenBallsDoNotCount) {
  const Surface surface(shapes::sphere(4));
  const UnionShape one = union_shape(surface, {{Point::Zero(), 1.1}});
  const UnionShape two = union_shape(surface, {{Point::Zero(), 1.1}, {Point(0.2, 0, 0), 0.5}});
  EXPECT_NEAR(one.volume, two.volume, 0.01);
  EXPECT_NEAR(one.protrusion, two.protrusion, 1e-4);
}

}  // namespace
}  // namespace padder
