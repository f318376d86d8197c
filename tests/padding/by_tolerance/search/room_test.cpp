// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/search/room.h"

#include <gtest/gtest.h>

#include "padding/by_tolerance/cover.h"
#include "tests/padding/random_input.h"
#include "tests/padding/shapes.h"

namespace padder {
namespace {

TEST(Room, ABoxHasRoomForBallsOfHalfItsEdge) {
  const Surface box(shapes::box({0, 0, 0}, {1, 1, 1}, 2));
  EXPECT_FALSE(Room(box, 0.499).none());
  EXPECT_TRUE(Room(box, 0.6).none());
  // Such balls have their centres within 0.1 of the middle, and come near to each side and to no corner.
  const Room room(box, 0.4);
  EXPECT_FALSE(room.none_within({0.5, 0.5, 1}, 0.01));
  EXPECT_TRUE(room.none_within({1, 1, 1}, 0.05));
  EXPECT_FALSE(room.none_within({1, 1, 1}, 0.3));
}

TEST(Room, WhatItDeniesIsSo) {
  const Surface torus(shapes::torus(1, 0.3, 48, 24));
  const Room room(torus, 0.25);
  shapes::RandomInput random(1);
  for (int k = 0; k < 2000; k++) {
    const Point c(random.uniform(-1.3, 1.3), random.uniform(-1.3, 1.3), random.uniform(-0.3, 0.3));
    const double radius = -torus.signed_nearest(c).distance;
    if (radius < 0.25) continue;
    const Vector away(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1));
    const Point p = c + 2 * away;
    EXPECT_FALSE(room.none_within(p, (p - c).norm() - radius));
  }
}

TEST(Room, NothingIsDeniedWithoutABody) {
  EXPECT_FALSE(Room(Surface(shapes::square(1, 3)), 10).none());
  EXPECT_FALSE(Room(Surface(shapes::box({0, 0, 0}, {1, 1, 1})), 0).none());
}

// Spheres as large as those that are asked for do not fit: nothing is searched.
TEST(Room, ACoverOfTooLargeSpheresEndsAtOnce) {
  int told = 0;
  const Cover cover = cover_surface(
      Surface(shapes::torus(1, 0.3, 48, 24)),
      {.protrusion = 0.01, .gap = 0.01, .min_radius = 0.4, .tell = [&told](double) { told++; }});
  EXPECT_TRUE(cover.balls.empty());
  EXPECT_EQ(cover.open.why, WhyOpen::min_radius);
  EXPECT_EQ(told, 0);
}

}  // namespace
}  // namespace padder
