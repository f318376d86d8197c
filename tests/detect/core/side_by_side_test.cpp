// SPDX-License-Identifier: MIT
#include "detect/core/side_by_side.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/detect/random.h"

namespace padder::detect {
namespace {

double gap(const Sphere& a, const Sphere& b) {
  return std::hypot(a.x - b.x, a.y - b.y, a.z - b.z) - a.r - b.r;
}

TEST(SideBySide, SpheresOfOneWorldKeepTheirDistanceAndThoseOfTwoAreFarApart) {
  std::random_device device;
  for (int round = 0; round < 200; round++) {
    const std::uint64_t seed = device();
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    WorldBounds b{};
    const double size = std::exp2(40 * unit(random) - 20);
    for (int c = 0; c < 3; c++) {
      b.low[c] = size * (random() % 2 ? 1e6 : 1) * (unit(random) - 0.5);
      b.high[c] = b.low[c] + (random() % 4 ? size * unit(random) : 0);
    }
    b.radius_min = 0, b.radius_max = size * (0.01 + unit(random)) * (random() % 2 ? 1e-3 : 1);
    b.first_world = static_cast<std::uint32_t>(random() % 1000);
    b.last_world = b.first_world + static_cast<std::uint32_t>(random() % (random() % 2 ? 5 : 100000));
    b.every = random() % 2;
    const double margin = random() % 2 ? 0 : size * unit(random);
    SideBySide boxes;
    double extent = 0;
    ASSERT_TRUE(lay_side_by_side(b, 100000, margin, boxes, extent));
    const auto sphere = [&] {
      const auto at = [&](int c) {
        return std::clamp(b.low[c] + unit(random) * (b.high[c] - b.low[c]), b.low[c], b.high[c]);
      };
      return Sphere{at(0), at(1), at(2), b.radius_max * (random() % 2 ? 1 : unit(random))};
    };
    const auto world = [&] {
      if (b.every && random() % 4 == 0) return kEveryWorld;
      return b.first_world + static_cast<std::uint32_t>(random() % (b.last_world - b.first_world + 1));
    };
    for (int k = 0; k < 100; k++) {
      const Sphere p = sphere(), q = sphere();
      const std::uint32_t w = world(), v = random() % 2 ? world() : w + (w < b.last_world);
      const bool same = v == w || !b.many();
      const Sphere moved = boxes.moved(p, w);
      for (const double x : {moved.x, moved.y, moved.z}) EXPECT_LE(std::abs(x), extent);
      EXPECT_NEAR(gap(moved, boxes.moved(q, w)), gap(p, q), 0x1p-50 * extent + 0x1p-50 * std::abs(gap(p, q)));
      if (!same) {
        EXPECT_GT(gap(moved, boxes.moved(q, v)), margin + 0.4 * b.radius_max);
      }
    }
  }
}

TEST(SideBySide, WhatHasNoPlaceIsRefused) {
  const WorldBounds good{{0, 0, 0}, {1, 1, 1}, 0.1, 0.1, 3, 10};
  SideBySide boxes;
  double extent;
  EXPECT_TRUE(lay_side_by_side(good, 100, 0, boxes, extent));
  const auto refused = [&](auto change) {
    WorldBounds b = good;
    change(b);
    return !lay_side_by_side(b, 100, 0, boxes, extent);
  };
  EXPECT_TRUE(refused([](WorldBounds& b) { b.last_world = kEveryWorld - 1; }));
  EXPECT_TRUE(
      refused([](WorldBounds& b) { b.first_world = 0, b.last_world = kEveryWorld - 1, b.every = 1; }));
  EXPECT_FALSE(refused([](WorldBounds& b) { b.first_world = kEveryWorld, b.last_world = 0, b.every = 100; }));
  EXPECT_TRUE(refused([](WorldBounds& b) { b.last_world = 1000; }));
  EXPECT_TRUE(refused([](WorldBounds& b) { b.high[1] = NAN; }));
  EXPECT_TRUE(refused([](WorldBounds& b) { b.low[2] = -INFINITY; }));
  EXPECT_TRUE(refused([](WorldBounds& b) { b.radius_max = NAN; }));
  EXPECT_TRUE(refused([](WorldBounds& b) { b.radius_min = -1; }));
  EXPECT_TRUE(refused([](WorldBounds& b) { b.low[0] = 1e50, b.high[0] = 1e50 + 1; }));
}

}  // namespace
}  // namespace padder::detect
