// SPDX-License-Identifier: MIT
#include "padding/geometry/unit_frame.h"

#include <gtest/gtest.h>

#include "padding/asset/error.h"
#include "tests/error_of.h"
#include "tests/padding/shapes.h"

namespace padder {
namespace {

TEST(UnitFrame, CentresAndScalesToADiagonalOfOne) {
  const Box box{{10, 20, 30}, {13, 24, 42}};  // diagonal 13
  const UnitFrame frame(box, "box");
  EXPECT_DOUBLE_EQ(frame.scale(), 13);
  Box unit;
  unit.add(frame.into(box.low)), unit.add(frame.into(box.high));
  EXPECT_NEAR(unit.diagonal(), 1, 1e-10);
  EXPECT_LT(unit.center().norm(), 1e-10);
  EXPECT_LT((frame.back(frame.into(box.high)) - box.high).norm(), 1e-9);
}

TEST(UnitFrame, AMovedPointGetsTheSameCoordinates) {
  const Box box{{0, 0, 0}, {1, 2, 2}};
  const Vector move(1000.3, -77.7, 0.1);
  const UnitFrame here(box, "box"), there({box.low + move, box.high + move}, "box");
  for (const Point& p : {Point(0.3, 1.7, 0.9), Point(1, 0, 2)})
    EXPECT_EQ(here.into(p), there.into(p + move)) << p.transpose();
}

TEST(UnitFrame, WhatIsWrittenFarFromTheOriginStandsWhereDoublesAre) {
  const Box near{{-1, -1, -1}, {1, 1, 1}},
      far{near.low + Vector::Constant(1e15), near.high + Vector::Constant(1e15)};
  const Point p(0.0123, 0.0456, -0.0789);
  EXPECT_EQ(UnitFrame(near, "box").written(p), p);
  const UnitFrame frame(far, "box");
  const Point there = frame.written(p);
  EXPECT_GT((there - p).norm(), 0.001);
  EXPECT_EQ(frame.back(there), frame.back(p));
  EXPECT_GE(frame.coarseness(), (there - p).norm());
  EXPECT_LT(frame.coarseness(), 0.3);
  EXPECT_EQ(UnitFrame(near, "box").coarseness(), 0);
}

TEST(UnitFrame, MassGoesBackWithItsPowersOfTheLength) {
  const Mesh mesh = shapes::box({1, 2, 3}, {3, 6, 4});
  const UnitFrame frame(mesh.bounds(), "box");
  const Mesh unit = shapes::mapped(mesh, [&](const Point& p) { return frame.into(p); });
  const MassProperties expected = mass_properties(mesh), mass = frame.back(mass_properties(unit));
  EXPECT_NEAR(mass.volume, expected.volume, 1e-8);
  EXPECT_LT((mass.center - expected.center).norm(), 1e-8);
  EXPECT_LT((mass.moments - expected.moments).norm(), 1e-7);
  EXPECT_NEAR(frame.back_volume(1), std::pow(frame.scale(), 3), 1e-12);
}

TEST(UnitFrame, RefusesWhatHasNoMeasurableSize) {
  EXPECT_THROW(UnitFrame({{1, 1, 1}, {1, 1, 1}}, "point"), Error);
  EXPECT_THROW(UnitFrame({{0, 0, 0}, {1e61, 1, 1}}, "huge"), Error);
  for (const double size : {1e-61, 1e-160, 1e-300})  // the squares of the last two are 0 or nearly so
    EXPECT_TRUE(refuses([&] { UnitFrame({{0, 0, 0}, {size, 0, 0}}, "tiny"); }, "to above 1e-60")) << size;
  EXPECT_THROW(UnitFrame(Box(), "empty"), Error);
}

}  // namespace
}  // namespace padder
