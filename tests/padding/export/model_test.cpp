// SPDX-License-Identifier: MIT
#include "padding/export/model.h"

#include "padding/asset/error.h"
#include "tests/padding/export/samples.h"

namespace padder::samples {
namespace {

TEST(Model, ScalingTakesEveryLengthWithItsPower) {
  Model m = arm();
  m.bodies[4].inertial = Inertial{2, {1, 0, 0}, Eigen::Matrix3d::Identity()};
  const Model s = scaled(m, 10, "cm");
  EXPECT_EQ(s.unit, "cm");
  EXPECT_EQ(s.bodies[1].pose.translation(), Point(0, 0, 5));
  EXPECT_EQ(s.bodies[1].joint.lower, -0.5);  // radians
  EXPECT_EQ(s.bodies[4].joint.lower, -5);
  EXPECT_EQ(s.bodies[4].inertial->mass, 2);
  EXPECT_EQ(s.bodies[4].inertial->center.x(), 10);
  EXPECT_EQ(s.bodies[4].inertial->inertia(0, 0), 100);
  const Cluster &a = m.bodies[0].cluster, &b = s.bodies[0].cluster;
  EXPECT_NEAR(b.mass.volume, 1000 * a.mass.volume, 1e-9);
  EXPECT_NEAR(b.mass.moments.x(), 1e5 * a.mass.moments.x(), 1e-9);
  EXPECT_NEAR(b.radii[0], 10 * a.radii[0], 1e-12);
  EXPECT_NEAR(b.bounds.diagonal(), 10 * a.bounds.diagonal(), 1e-9);
}

TEST(Model, Units) {
  EXPECT_EQ(metres(""), 1);
  EXPECT_EQ(metres("in"), 0.0254);
  EXPECT_THROW(metres("ft"), Error);
}

TEST(Model, InertialOfASheetIsUnknown) {
  Body b;
  b.cluster = brick();
  EXPECT_NEAR(inertial_of(b, 500)->mass, 24, 1e-9);
  b.cluster.mass = {};
  EXPECT_FALSE(inertial_of(b, 500));
  b.inertial = Inertial{1, Point::Zero(), Eigen::Matrix3d::Zero()};
  EXPECT_EQ(inertial_of(b, 500)->mass, 1);
}

}  // namespace
}  // namespace padder::samples
