// SPDX-License-Identifier: GPL-3.0-or-later
#include "assets/solid.h"

#include <gtest/gtest.h>

#include <numbers>

#include "padding/asset/error.h"
#include "tests/padding/shapes.h"

namespace padder::assets {
namespace {

using shapes::polygon_area, shapes::volume, std::numbers::pi;

Mesh box(const Point& low, const Point& high) {
  std::vector<Ring> rings;
  for (const double z : {low.z(), high.z()})
    rings.push_back(
        {{low.x(), low.y(), z}, {high.x(), low.y(), z}, {high.x(), high.y(), z}, {low.x(), high.y(), z}});
  return loft(rings);
}

TEST(Solid, LoftsHaveClosedFormVolumes) {
  EXPECT_NEAR(volume(box({0, 0, 0}, {1, 2, 3})), 6, 1e-12);
  EXPECT_NEAR(volume(cylinder(1, 2, 0.5, -1, 2, 24)), 3 * polygon_area(24, 0.5), 1e-12);
  EXPECT_NEAR(volume(cylinder(1, 2, 0.5, 2, -1, 24)), 3 * polygon_area(24, 0.5),
              1e-12);  // turned outward all the same
  // A square of side 0.2 around radius 1: Pappus, with the polygon's area in place of the circle's.
  const Ring square = {{0.9, -0.1, 0}, {1.1, -0.1, 0}, {1.1, 0.1, 0}, {0.9, 0.1, 0}};
  EXPECT_NEAR(volume(revolve(square, 40)), 0.2 * (polygon_area(40, 1.1) - polygon_area(40, 0.9)), 1e-12);
  EXPECT_THROW(loft({square, {{0, 0, 0}, {1, 0, 0}, {0, 0, 1}}}), Error);
}

TEST(Solid, RoundedRectangleInsetAndHull) {
  const Ring ring = rounded_rectangle({0, 0, 0}, 2, 1, 0.25, 64);
  Mesh slab = loft({ring, [&] {
                      Ring up = ring;
                      for (Point& p : up) p.z() = 1;
                      return up;
                    }()});
  EXPECT_NEAR(volume(slab), 8 - (4 - pi) * 0.0625, 1e-4);
  EXPECT_THROW(rounded_rectangle({0, 0, 0}, 2, 1, 1.5), Error);
  const Ring square = {{0, 0, 0}, {2, 0, 0}, {2, 0, 2}, {0, 0, 2}};
  for (Ring turned : {square, Ring(square.rbegin(), square.rend())})
    for (const Point& p : inset(turned, 0.25))
      EXPECT_NEAR((p - Point(1, 0, 1)).cwiseAbs().maxCoeff(), 0.75, 1e-12);
  std::vector<Point> cloud = square;
  cloud.emplace_back(1, 0, 1), cloud.emplace_back(1, 0, 0), cloud.emplace_back(0.5, 0, 1.7);
  EXPECT_EQ(hull(cloud).size(), 4u);
  // The chamfer takes from each end the square's frustum complement.
  EXPECT_NEAR(volume(extrude(square, 0, 1, 0.25)), 4 * 0.5 + 2 * 0.25 / 3 * (4 + 2.25 + 3), 1e-12);
}

TEST(Solid, BooleansAreExactWhereFacesLieOnEachOther) {
  Solid solid(box({0, 0, 0}, {1, 1, 1}));
  solid.add(box({1, 0, 0}, {2, 1, 1}));  // a common face
  EXPECT_NEAR(volume(solid.mesh()), 2, 1e-12);
  solid.cut(box({0.5, 0.5, 0.5}, {3, 3, 3}));  // coplanar nowhere
  EXPECT_NEAR(volume(solid.mesh()), 2 - 1.5 * 0.25, 1e-12);
  Solid drilled(box({0, 0, 0}, {1, 1, 1}));
  drilled.cut(cylinder(0.5, 0.5, 0.25, -1, 2, 32));
  EXPECT_NEAR(volume(drilled.mesh()), 1 - polygon_area(32, 0.25), 1e-12);
  const Mesh m = drilled.mesh();
  EXPECT_EQ(static_cast<long>(m.points.size()) - static_cast<long>(m.triangles.size()) / 2, 0);  // one handle
}

TEST(Solid, FinishedLeavesNoTraceOfTheOperands) {
  Solid solid(box({0, 0, 0}, {1, 1, 1}));
  for (int k = 1; k < 4; k++) solid.add(box({0.5 * k, 0, 0}, {0.5 * k + 1, 1, 1}));
  const Mesh bar = finished(solid.mesh(), 6);
  EXPECT_EQ(bar.triangles.size(), 12u);
  EXPECT_EQ(bar.points.size(), 8u);
  EXPECT_NEAR(volume(bar), 2.5, 1e-12);
  solid.cut(cylinder(1, 0.5, 0.25, -1, 2, 32));
  const Mesh drilled = finished(solid.mesh(), 6);
  EXPECT_EQ(drilled.points.size(), 8u + 2 * 32);
  EXPECT_EQ(drilled.triangles.size(), 2 * drilled.points.size());  // genus 1
  EXPECT_NEAR(volume(drilled), 2.5 - polygon_area(32, 0.25), 1e-5);
}

TEST(Solid, WhatIsNoSolidIsRefused) {
  Mesh open = box({0, 0, 0}, {1, 1, 1});
  open.triangles.pop_back();
  EXPECT_ANY_THROW(finished(open, 6));
  const Mesh cube = box({0, 0, 0}, {1, 1, 1});
  EXPECT_THROW(finished(shapes::turned_over(cube), 6), Error);
  EXPECT_THROW(finished(shapes::joined(cube, box({0.5, 0.5, 0.5}, {2, 2, 2})), 6), Error);
}

TEST(Solid, ObjTextHasItsDecimalsAndNoMinusZero) {
  const Mesh m = rounded(box({-1e-9, 0, 0}, {1, 1.23456789, 1}), 3);
  const std::string text = to_obj(m, "first\nsecond", 3);
  EXPECT_EQ(text.find("# first\n# second\nv 0.000 0.000 0.000\nv 1.000 0.000 0.000\nv 1.000 1.235 0.000\n"),
            0u)
      << text;
  EXPECT_EQ(text.find("-0.000"), std::string::npos);
  Mesh sliver = box({0, 0, 0}, {1, 1, 1e-5});
  EXPECT_EQ(rounded(sliver, 3).points.size(), 4u);
}

}  // namespace
}  // namespace padder::assets
