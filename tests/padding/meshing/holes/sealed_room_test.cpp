// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/meshing/holes/sealed_room.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/padding/shapes.h"

namespace padder {
namespace {

// A box of size 1 with a window in its floor, as wide as `width`.
Mesh box_with_window(double width, bool slit) {
  Mesh mesh = shapes::box({0, 0, 0}, {1, 1, 1}, 80);
  std::erase_if(mesh.triangles, [&](const auto& t) {
    const Point p = (mesh.points[t[0]] + mesh.points[t[1]] + mesh.points[t[2]]) / 3;
    return p.z() == 0 && std::abs(p.x() - 0.5) < width / 2 && (slit || std::abs(p.y() - 0.5) < width / 2);
  });
  return mesh;
}

TEST(SealedRoom, AWindowIsClosedWhereItIsNarrow) {
  const Point inside(0.31, 0.47, 0.6), outside(1.5, 0.5, 0.5), above(0.5, 0.5, 1.4);
  for (const double width : {0.05, 0.08}) {
    const SealedRoom closed(box_with_window(0, false), width);
    EXPECT_TRUE(closed.holds(inside));
    EXPECT_FALSE(closed.holds(outside));
    EXPECT_FALSE(closed.holds(above));
    EXPECT_FALSE(closed.holds({0.5, 0.5, 1}));  // in the wall
    for (const bool slit : {false, true}) {
      EXPECT_TRUE(SealedRoom(box_with_window(0.9 * width, slit), width).holds(inside));
      EXPECT_FALSE(SealedRoom(box_with_window(3.1 * width, slit), width).holds(inside));
    }
  }
}

// Cubes of that width would be too many.
TEST(SealedRoom, CubesAreNeverTooMany) {
  EXPECT_TRUE(SealedRoom(box_with_window(0, false), 1e-9).holds({0.5, 0.5, 0.5}));
  EXPECT_FALSE(SealedRoom(box_with_window(0.1, false), 1e-9).holds({0.5, 0.5, 0.5}));
}

}  // namespace
}  // namespace padder
