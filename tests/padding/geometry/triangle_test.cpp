// SPDX-License-Identifier: MIT
#include "padding/geometry/triangle.h"

#include <gtest/gtest.h>

#include "tests/padding/random_input.h"

namespace padder {
namespace {

TEST(Triangle, EquilateralHasClosedForms) {
  const Triangle3 t{{0, 0, 0}, {1, 0, 0}, {0.5, std::sqrt(3) / 2, 0}};
  EXPECT_NEAR(t.circumradius(), 1 / std::sqrt(3), 1e-15);
  EXPECT_NEAR(t.angle(0), std::numbers::pi / 3, 1e-15);
  EXPECT_NEAR(t.area_normal().z(), std::sqrt(3) / 4, 1e-15);
}

TEST(Triangle, CircumcenterIsAsFarFromEachCorner) {
  shapes::RandomInput random(1);
  for (int k = 0; k < 1000; k++) {
    const Triangle3 t{random.point(), random.point(), random.point()};
    if (t.circumradius() > 100) continue;  // nearly a line: the centre is far away and loses digits
    const Point c = t.circumcenter();
    for (const Point& p : {t.a, t.b, t.c})
      EXPECT_NEAR((p - c).norm(), t.circumradius(), 1e-9 * t.circumradius());
    EXPECT_NEAR(t.angle(0) + t.angle(1) + t.angle(2), std::numbers::pi, 1e-12);
  }
}

TEST(Triangle, EnclosingCircleHoldsTheCornersAndIsNoLargerThanTheCircumcircle) {
  shapes::RandomInput random(2);
  for (int k = 0; k < 1000; k++) {
    const Triangle3 t{random.point(), random.point(), random.point()};
    const auto circle = t.enclosing_circle();
    for (const Point& p : {t.a, t.b, t.c}) EXPECT_LE((p - circle.center).norm(), circle.radius * (1 + 1e-9));
    EXPECT_LE(circle.radius, t.circumradius() * (1 + 1e-9));
  }
}

TEST(Triangle, ALineHasAnEnclosingCircle) {
  const Triangle3 t{{0, 0, 0}, {1, 0, 0}, {3, 0, 0}};
  EXPECT_TRUE(std::isinf(t.circumradius()));
  EXPECT_DOUBLE_EQ(t.enclosing_circle().radius, 1.5);
}

struct Tagged : TrianglePart {
  double tag = 0;
};

TEST(TrianglePart, IsCutAcrossItsLongestEdge) {
  const Tagged part{{{Point(0, 0, 0), Point(4, 0, 0), Point(1, 1, 0)}, 7}, 0.5};
  EXPECT_EQ(part.longest_edge().second, 0);
  EXPECT_EQ(part.size(), 4);
  const auto halves = bisect(part);
  EXPECT_EQ(halves[0].corner[1], Point(2, 0, 0));
  EXPECT_EQ(halves[1].corner[0], Point(2, 0, 0));
  for (const Tagged& half : halves) {
    EXPECT_EQ(half.corner[2], part.corner[2]);
    EXPECT_EQ(half.triangle, 7u);
    EXPECT_EQ(half.tag, 0.5);
  }
}

}  // namespace
}  // namespace padder
