// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/tools/audit/measure.h"

#include <gtest/gtest.h>

#include "tests/error_of.h"
#include "tests/padding/shapes.h"

namespace padder::audit {
namespace {

// The lines go along z, the shortest side.
const Point low(0, 0, 0), high(2, 3, 1);
constexpr double kVolume = 6;
const Vector inertia(kVolume*(9 + 1) / 12, kVolume*(4 + 1) / 12, kVolume*(4 + 9) / 12);

void expect_box(const Mesh& mesh, double relative) {
  const MassInside inside = mass_inside(mesh, 1);
  EXPECT_NEAR(inside.volume, kVolume, relative * kVolume);
  for (int k = 0; k < 3; k++) EXPECT_NEAR(inside.inertia(k, k), inertia[k], relative * inertia[k]) << k;
}

TEST(MassInside, IsThatOfAClosedBox) { expect_box(shapes::box(low, high), 1e-3); }

// On the flat lid that is missing the winding number is 1/2: what lies below it counts, although no line that
// leaves through it crosses a triangle there.
TEST(MassInside, GoesOnBehindAHole) {
  Mesh open = shapes::box(low, high);
  std::erase_if(open.triangles, [&](const auto& t) {
    return open.points[t[0]].z() == 1 && open.points[t[1]].z() == 1 && open.points[t[2]].z() == 1;
  });
  ASSERT_EQ(open.triangles.size(), 10u);
  expect_box(open, 0.01);
}

// A box in one ball.
Cluster ball() {
  Cluster c;
  c.centers = {(low + high) / 2}, c.radii = {(high - low).norm() / 2 + 1e-9}, c.triangle = {0};
  c.accuracy.protrusion_max = (high - low).norm() / 2;
  return c;
}

TEST(Measure, TrianglesWithTwoCornersAtOnePointAreNoSurface) {
  Mesh mesh = shapes::box(low, high);
  EXPECT_TRUE(measure(mesh, nullptr, ball(), 1000, 1).holds());
  mesh.points.push_back({1, 1, 3}), mesh.points.push_back({1, 2, 3});
  mesh.triangles.push_back({8, 9, 9}), mesh.triangles.push_back({8, 8, 8});
  const Measured degenerate = measure(mesh, nullptr, ball(), 1000, 1);
  EXPECT_TRUE(degenerate.holds()) << degenerate.gap;
  mesh.points.push_back({2, 1, 3}), mesh.triangles.push_back({8, 9, 10});
  EXPECT_FALSE(measure(mesh, nullptr, ball(), 1000, 1).holds());
}

TEST(Measure, WhatIsTooThinIsRefused) {
  const Mesh needle = shapes::box({0, 0, 0}, {1, 1e-10, 1e-10});
  EXPECT_TRUE(refuses([&] { measure(needle, nullptr, ball(), 1000, 1); }, "no triangle is high enough"));
}

}  // namespace
}  // namespace padder::audit
