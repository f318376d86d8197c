// SPDX-License-Identifier: MIT
#include "detect/body.h"

#include <cmath>

#include "detect/core/errors.h"
#include "padding/asset/error.h"

namespace padder::detect {

void rotation_of(double w, double x, double y, double z, double (&m)[9]) {
  double largest = 0;
  bool finite = true;
  for (const double v : {w, x, y, z}) largest = std::max(largest, std::abs(v)), finite &= std::isfinite(v);
  if (!finite || largest == 0)
    throw Error("the quaternion (" + formatted(w) + ", " + formatted(x) + ", " + formatted(y) + ", " +
                formatted(z) + ") is no rotation: its four numbers must be finite, and not all 0");
  // Scaled by a power of two, which rounds nothing, to a length of about 1, so that the squares below neither
  // overflow nor underflow.
  int exponent;
  std::frexp(largest, &exponent);
  for (double* v : {&w, &x, &y, &z}) *v = std::ldexp(*v, -exponent);
  const double s = 2 / (w * w + x * x + y * y + z * z);
  const double rows[9] = {1 - s * (y * y + z * z), s * (x * y - w * z),     s * (x * z + w * y),
                          s * (x * y + w * z),     1 - s * (x * x + z * z), s * (y * z - w * x),
                          s * (x * z - w * y),     s * (y * z + w * x),     1 - s * (x * x + y * y)};
  std::copy_n(rows, 9, m);
}

}  // namespace padder::detect
