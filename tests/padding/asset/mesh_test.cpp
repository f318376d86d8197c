// SPDX-License-Identifier: MIT
#include "padding/asset/mesh.h"

#include <gtest/gtest.h>

#include <Eigen/LU>

namespace padder {
namespace {

Mesh box(const Vector& size, const Point& low) {
  Mesh m;
  for (int k = 0; k < 8; k++)
    m.points.push_back(low + Vector(size.x() * (k & 1), size.y() * (k >> 1 & 1), size.z() * (k >> 2)));
  m.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                 {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return m;
}

TEST(Mesh, BoxHasClosedFormMassProperties) {
  const Vector s(1, 2, 3);
  const MassProperties m = mass_properties(box(s, Point(10, -20, 1000)));
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
  const Mesh m = box(Vector(1, 2, 3), Point::Zero());
  EXPECT_DOUBLE_EQ(m.area(), 22);
  EXPECT_DOUBLE_EQ(m.bounds().diagonal(), std::sqrt(14.0));
  EXPECT_TRUE(Mesh().bounds().empty());
}

}  // namespace
}  // namespace padder
