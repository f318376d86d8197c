// SPDX-License-Identifier: MIT
// Rotations from quaternions of any length, and what is none.
#include "detect/body.h"

#include <gtest/gtest.h>

#include <random>

#include "padding/asset/error.h"
#include "tests/error_of.h"

namespace padder::detect {
namespace {

TEST(Place, ARotationOfAnyLength) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  for (int k = 0; k < 1000; k++) {
    const double q[4] = {normal(random), normal(random), normal(random), k % 5 ? normal(random) : 0};
    double at_one[9];
    rotation_of(q[0], q[1], q[2], q[3], at_one);
    for (int i = 0; i < 3; i++)
      for (int j = 0; j < 3; j++) {
        double dot = 0;
        for (int c = 0; c < 3; c++) dot += at_one[3 * i + c] * at_one[3 * j + c];
        ASSERT_NEAR(dot, i == j, 1e-14);
      }
    for (const int exponent : {-900, -530, -500, 1, 510, 515, 1000}) {
      double m[9];
      const auto by = [&](double v) { return std::ldexp(v, exponent); };
      rotation_of(by(q[0]), by(q[1]), by(q[2]), by(q[3]), m);
      for (int c = 0; c < 9; c++) ASSERT_EQ(m[c], at_one[c]) << exponent;
    }
  }
  double m[9];
  rotation_of(1e-160, 0, 0, 1e-160, m);  // a quarter turn about z
  EXPECT_NEAR(m[1], -1, 1e-15);
  rotation_of(0, 0, 0, 5e-324, m);
  EXPECT_EQ(m[0], -1);
  rotation_of(1.7e308, 1.7e308, 0, 0, m);
  EXPECT_NEAR(m[7], 1, 1e-15);
}

TEST(Place, WhatIsNoRotationIsRefused) {
  double m[9];
  for (const double bad : {double(NAN), double(INFINITY), -double(INFINITY)}) {
    EXPECT_THROW(rotation_of(bad, 0, 0, 1, m), Error);
    EXPECT_THROW(rotation_of(1, 0, 0, bad, m), Error);
  }
  EXPECT_EQ(error_of([&] { rotation_of(0, 0, 0, -0.0, m); }),
            "the quaternion (0, 0, 0, -0) is no rotation: its four numbers must be finite, and not all 0");
}

}  // namespace
}  // namespace padder::detect
