// SPDX-License-Identifier: MIT
#include "padding/asset/mesh.h"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include "tests/padding/shapes.h"

namespace padder {
namespace {

TEST(Mesh, BoxHasClosedFormMassProperties) {
  const Vector s(1, 2, 3);
  const MassProperties m = mass_properties(shapes::box({10, -20, 1000}, {11, -18, 1003}));
  EXPECT_NEAR(m.volume, 6, 1e-12);
  EXPECT_NEAR((m.center - Point(10.5, -19, 1001.5)).norm(), 0, 1e-12);
  const Vector sq = s.cwiseProduct(s);
  EXPECT_NEAR(m.inertia(0, 0), 6 * (sq.y() + sq.z()) / 12, 1e-10);
  EXPECT_NEAR(m.inertia(1, 1), 6 * (sq.x() + sq.z()) / 12, 1e-10);
  EXPECT_NEAR(m.inertia(2, 2), 6 * (sq.x() + sq.y()) / 12, 1e-10);
  EXPECT_NEAR(m.moments[0], m.inertia(2, 2), 1e-10);
  EXPECT_NEAR(m.axes.determinant(), 1, 1e-12);
}

TEST(Mesh, AreaAndBounds) {
  const Mesh m = shapes::box({0, 0, 0}, {1, 2, 3});
  EXPECT_DOUBLE_EQ(m.area(), 22);
  EXPECT_DOUBLE_EQ(m.bounds().diagonal(), std::sqrt(14.0));
  EXPECT_TRUE(Mesh().bounds().empty());
}

TEST(Mesh, UnusedPointsGoAndTheOthersFollowTheTriangles) {
  Mesh m{{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}}, {{3, 1, 0}, {0, 1, 3}}};
  m.drop_unused_points();
  EXPECT_EQ(m.points, (std::vector<Point>{{3, 0, 0}, {1, 0, 0}, {0, 0, 0}}));
  EXPECT_EQ(m.triangles, (decltype(m.triangles){{0, 1, 2}, {2, 1, 0}}));
}

}  // namespace
}  // namespace padder
