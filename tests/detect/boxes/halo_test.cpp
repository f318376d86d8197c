// SPDX-License-Identifier: MIT
// The halo theorem, tried on pairs at the limit of what touches: of all sizes, ratios and places.
#include "detect/boxes/halo.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/detect/random.h"

namespace padder::detect {
namespace {

bool inside(const Bounds& b, const Midpoint& m) {
  return b.low[0] <= m.x && m.x <= b.high[0] && b.low[1] <= m.y && m.y <= b.high[1] && b.low[2] <= m.z &&
         m.z <= b.high[2];
}

TEST(Halo, TheMidpointOfAContactLiesInBothHalos) {
  std::mt19937_64 random(20260101);
  std::uniform_real_distribution<double> unit(-1, 1), exponent(-40, 40), tiny(-4, 4);
  int touched = 0;
  for (int trial = 0; trial < 400000; trial++) {
    const double scale = trial % 5 == 0 ? std::exp2(10 * exponent(random)) : 1;
    Sphere a, b;
    a.r = scale * std::exp2(exponent(random)), b.r = scale * std::exp2(exponent(random));
    const double away = trial % 2 ? scale * std::exp2(exponent(random)) : 0;
    a.x = away * unit(random), a.y = away * unit(random), a.z = away * unit(random);
    double n[3] = {unit(random), unit(random), unit(random)};
    if (trial % 7 == 0) n[1] = n[2] = 0;
    const double length = std::hypot(n[0], n[1], n[2]);
    if (!(length > 0)) continue;
    // Just touching, just containing, or in between; moved by a few roundings.
    const double at = trial % 3 == 0   ? a.r + b.r
                      : trial % 3 == 1 ? std::abs(a.r - b.r)
                                       : a.r + unit(random) * b.r;
    const double d = at * (1 + tiny(random) * 0x1p-53);
    b.x = a.x + d * n[0] / length, b.y = a.y + d * n[1] / length, b.z = a.z + d * n[2] / length;
    if (!touching(a, b)) continue;
    touched++;
    const double largest = std::max(a.r, b.r);
    for (const Midpoint& m : {midpoint(a, b), midpoint(b, a)}) {
      ASSERT_TRUE(inside(halo_of(a, largest), m)) << "trial " << trial;
      ASSERT_TRUE(inside(halo_of(b, largest), m)) << "trial " << trial;
    }
  }
  EXPECT_GT(touched, 100000);
}

TEST(Halo, OneHugeSphereHardlyWidensTheHaloOfASmallOne) {
  const Bounds small = halo_of({10, 0, 0, 1}, 1), beside = halo_of({10, 0, 0, 1}, 1e9);
  EXPECT_NEAR(beside.high[0], small.high[0], 2e-5);
  EXPECT_NEAR(small.high[0], 11, 1e-12);
}

TEST(Halo, ABodysBoundsHoldTheHalosOfItsSpheres) {
  std::mt19937_64 random(77);
  for (int trial = 0; trial < 300; trial++) {
    std::vector<Sphere> spheres(1 + trial % 40);
    const double size = std::exp2(20 * signed_unit(random));
    for (Sphere& s : spheres)
      s = {size * signed_unit(random), 0.1 * size * signed_unit(random), size * (5 + signed_unit(random)),
           size * std::abs(signed_unit(random))};
    const Shape shape{spheres.data(), spheres.size()};
    const ShapeExtent extent = extent_of(shape);
    Body body;
    for (double& m : body.rotation) m = signed_unit(random) * (trial % 2 ? 1 : 3);  // any matrix
    for (double& p : body.position) p = 1e3 * signed_unit(random);
    const Bounds all = halo_of(body, extent, extent.largest_radius);
    for (const Sphere& s : spheres) {
      const Sphere there = placed(body, s);
      const Bounds own{{there.x - there.r, there.y - there.r, there.z - there.r},
                       {there.x + there.r, there.y + there.r, there.z + there.r}};
      for (int a = 0; a < 3; a++) {
        ASSERT_LT(all.low[a], own.low[a]);
        ASSERT_GT(all.high[a], own.high[a]);
      }
    }
  }
}

TEST(Halo, AnEmptyShapeMeetsNothing) {
  const Bounds b = halo_of(Body{}, extent_of({nullptr, 0}), 1);
  EXPECT_GT(b.low[0], b.high[0]);
}

}  // namespace
}  // namespace padder::detect
