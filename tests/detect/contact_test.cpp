// SPDX-License-Identifier: MIT
// The decision, the filter's band, the record and the midpoint rule, without a detector.
#include "detect/contact.h"

#include <limits>
#include <random>

#include "detect/core/grid.h"
#include "tests/detect/oracle.h"

namespace padder::detect {
namespace {

TEST(Contact, TouchingCounts) {
  EXPECT_TRUE(touching({0, 0, 0, 1}, {2, 0, 0, 1}));
  EXPECT_FALSE(touching({0, 0, 0, 1}, {std::nextafter(2, 3), 0, 0, 1}));
  EXPECT_TRUE(touching({0, 0, 0, 0}, {0, 0, 0, 0}));
  EXPECT_FALSE(touching({0, 0, 0, 0}, {0, 0, 1e-100, 0}));
  EXPECT_TRUE(touching({1e300 * 0, 0, 0, 4}, {1, 0, 0, 1}));  // contained
}

// The geometry decides at every size, not what is left of squares: against long double, whose exponents go
// far beyond, wherever rounding cannot matter; and the same spheres times a power of two always.
TEST(Contact, TheDecisionHoldsAtAnySize) {
  ASSERT_LT(std::numeric_limits<long double>::min_exponent, -10000);
  EXPECT_FALSE(touching({0, 0, 0, 0}, {0, 0, 1e-170, 0}));
  EXPECT_FALSE(touching({0, 0, 0, 0}, {5e-324, 0, 0, 0}));
  EXPECT_TRUE(touching({0, 0, 0, 5e-324}, {5e-324, 0, 0, 0}));
  EXPECT_FALSE(touching({0, 0, 0, 5e-324}, {5e-324, 5e-324, 0, 0}));
  EXPECT_TRUE(touching({0, 0, 0, 1e-170}, {2e-170, 0, 0, 1e-170}));
  EXPECT_FALSE(touching({0, 0, 0, 1e-170}, {2.0000001e-170, 0, 0, 1e-170}));
  EXPECT_FALSE(touching({1e100, -1e100, 0, 0}, {-1e100, 1e100, 0, 5e-324}));
  EXPECT_TRUE(touching({1e-320, 0, 0, 1e-320}, {1, 0, 0, 1}));
  std::mt19937_64 random(11);
  for (const int exponent :
       {0, 300, -400, -470, -499, -500, -501, -502, -520, -600, -900, -1000, -1022, -1060})
    for (int k = 0; k < 20000; k++) {
      Sphere a{signed_unit(random), signed_unit(random), signed_unit(random), std::abs(signed_unit(random))};
      Sphere b{signed_unit(random), signed_unit(random), signed_unit(random),
               std::abs(signed_unit(random)) * (k % 3 == 0 ? 1e-9 : 1)};
      const bool at_one = touching(a, b);
      for (Sphere* s : {&a, &b})
        for (double* v : {&s->x, &s->y, &s->z, &s->r}) *v = std::ldexp(*v, exponent);
      if (exponent > -900) {
        ASSERT_EQ(touching(a, b), at_one) << exponent;
      }
      const long double x = static_cast<long double>(b.x) - a.x, y = static_cast<long double>(b.y) - a.y,
                        z = static_cast<long double>(b.z) - a.z, s = static_cast<long double>(a.r) + b.r;
      const long double excess = x * x + y * y + z * z - s * s;
      if (std::abs(excess) < 1e-14L * s * s) continue;
      ASSERT_EQ(touching(a, b), excess <= 0) << exponent;
      ASSERT_EQ(touching(a, b), touching(b, a)) << exponent;
      ASSERT_EQ(touching(a, b), oracle_touching(a, b)) << exponent;
      if (a.r + b.r >= kSmallSum) {
        ASSERT_EQ(touching(a, b), touching_unscaled(a, b));
      }
    }
}

TEST(Contact, FaultsAreTold) {
  EXPECT_EQ(fault_of({0, 0, 0, 0}), Fault::none);
  EXPECT_EQ(fault_of({0, 0, 0, -1e-300}), Fault::negative_radius);
  EXPECT_EQ(fault_of({0, NAN, 0, 1}), Fault::not_finite);
  EXPECT_EQ(fault_of({0, 0, -INFINITY, 1}), Fault::not_finite);
  EXPECT_EQ(fault_of({0, 0, 0, INFINITY}), Fault::not_finite);
  EXPECT_EQ(fault_of({-2e100, 0, 0, 1}), Fault::too_large);
}

// Near-threshold pairs, as a search meets them: whenever the filter is sure, it is right.
template <class MakeSlot>
void filter_is_right(double scale, double far, bool to_float, MakeSlot slot) {
  std::mt19937_64 random(42);
  std::normal_distribution<double> normal;
  int sure = 0, doubt = 0;
  for (int k = 0; k < 200000; k++) {
    Sphere a{far + unit(random) * 20, far + unit(random) * 20, unit(random) * 20, 0.25 + 0.75 * unit(random)},
        b;
    double d[3], length = 0;
    for (double& v : d) v = normal(random), length += v * v;
    b.r = k % 3 ? 0.25 + 0.75 * unit(random) : 1e-4 * unit(random);
    const double t =
        (a.r + b.r) * (1 + std::pow(10.0, -1 - 14 * unit(random)) * normal(random)) / std::sqrt(length);
    b.x = a.x + t * d[0], b.y = a.y + t * d[1], b.z = a.z + t * d[2];
    for (Sphere* s : {&a, &b})
      for (double* v : {&s->x, &s->y, &s->z, &s->r}) {
        *v *= scale;
        if (to_float) *v = static_cast<float>(*v);
      }
    const auto sa = slot(a), sb = slot(b);
    const Verdict v = verdict<std::decay_t<decltype(sa)>>(measured(sa, sb));
    if (v == Verdict::doubt) {
      doubt++;
      continue;
    }
    sure++;
    ASSERT_EQ(v == Verdict::touch, touching(a, b)) << "pair " << k;
  }
  EXPECT_GT(sure, 30000);
  if (!to_float || (far == 0 && scale == 1)) {  // rounding the input to float leaves few pairs so close
    EXPECT_GT(doubt, 10000);
  }
}

TEST(Contact, FilterIsRightOutsideItsBandInFloat) {
  for (const double far : {0., 1e3, 1e5}) filter_is_right(1, far, true, float_slot);
  filter_is_right(1e12, 0, true, float_slot);
  filter_is_right(1e-8, 0, true, float_slot);
}

TEST(Contact, FilterIsRightOutsideItsBandInFixedPoint) {
  for (const double scale : {1., 1e-150, 1e60})
    for (const double far : {0., 1e3, 1e7, 1e9}) {
      Level l;
      l.size = scale == 1 ? 2.00390625 : std::ldexp(0x201p-8, std::ilogb(scale) + 1), l.per_size = 1 / l.size;
      l.units = std::ldexp(l.per_size, kUnitBits);
      ASSERT_GE(l.size, 2 * scale);
      filter_is_right(scale, far, false, [&](const Sphere& s) { return fixed_point_slot(l, s); });
    }
}

TEST(Contact, RecordOfTwoSpheres) {
  const Geometry g = geometry({0, 0, 0, 2}, {3, 4, 0, 4});
  EXPECT_DOUBLE_EQ(g.normal[0], 0.6);
  EXPECT_DOUBLE_EQ(g.normal[1], 0.8);
  EXPECT_EQ(g.normal[2], 0);
  EXPECT_DOUBLE_EQ(g.depth, 1);
  EXPECT_DOUBLE_EQ(g.on_i[0], 1.2);
  EXPECT_DOUBLE_EQ(g.on_i[1], 1.6);
  EXPECT_DOUBLE_EQ(g.on_j[0], 0.6);
  EXPECT_DOUBLE_EQ(g.on_j[1], 0.8);
  const Geometry same = geometry({1, 2, 3, 2}, {1, 2, 3, 0.5});
  EXPECT_EQ(same.normal[0], 1);
  EXPECT_EQ(same.normal[1], 0);
  EXPECT_EQ(same.depth, 2.5);
}

TEST(Contact, RecordAndMidpointAtAnySize) {
  for (const int exponent : {0, 330, -450, -500, -530, -560, -700, -1000, -1040}) {
    const double by = std::ldexp(1.0, exponent), digits = exponent < -1000 ? 1e-6 : 1e-14;
    const Sphere i{0, 0, 0, 2 * by}, j{3 * by, 4 * by, 0, 4 * by};
    const Geometry g = geometry(i, j);
    EXPECT_NEAR(g.normal[0], 0.6, digits) << exponent;
    EXPECT_NEAR(g.normal[1], 0.8, digits) << exponent;
    EXPECT_NEAR(g.depth / by, 1, digits) << exponent;
    EXPECT_NEAR(g.on_i[0] / by, 1.2, digits) << exponent;
    EXPECT_NEAR(midpoint(i, j).x / by, 0.9, digits) << exponent;  // deepest points 2 and 1 along the line
    const Sphere inside{by, by, 0, 0.25 * by};
    EXPECT_EQ(midpoint(i, inside).x, by) << exponent;
    // Centres much nearer to each other than the radii.
    const Geometry near = geometry({0, 0, 0, 1}, {0, 3 * by, -4 * by, 2});
    if (exponent > 0) continue;
    EXPECT_NEAR(near.normal[1], 0.6, digits) << exponent;
    EXPECT_NEAR(near.normal[2], -0.8, digits) << exponent;
    EXPECT_NEAR(near.depth, 3 - 5 * by, 1e-14) << exponent;
  }
}

TEST(Contact, MidpointRule) {
  const Midpoint m = midpoint({0, 0, 0, 1}, {1.5, 0, 0, 1});
  EXPECT_DOUBLE_EQ(m.x, 0.75);
  const Midpoint unequal = midpoint({0, 0, 0, 2}, {2.5, 0, 0, 1});  // deepest points at 2 and 1.5
  EXPECT_DOUBLE_EQ(unequal.x, 1.75);
  const Midpoint inside = midpoint({0, 0, 0, 4}, {1, 1, 0, 1});
  EXPECT_EQ(inside.x, 1);
  EXPECT_EQ(inside.y, 1);
  const Midpoint outside = midpoint({1, 1, 0, 1}, {0, 0, 0, 4});
  EXPECT_EQ(outside.x, 1);
  EXPECT_EQ(outside.y, 1);
}

TEST(Contact, RegionsShareSpaceWithoutOverlap) {
  Region left, right;
  left.high[0] = right.low[0] = 2;
  EXPECT_FALSE(owns(left, {2, 0, 0}));
  EXPECT_TRUE(owns(right, {2, 0, 0}));
  EXPECT_TRUE(owns(left, {-1e300, 5, 5}));
}

TEST(Contact, PairHashDependsOnTheOrder) { EXPECT_NE(pair_hash(1, 2), pair_hash(2, 1)); }

}  // namespace
}  // namespace padder::detect
