// SPDX-License-Identifier: MIT
// Sphere against sphere, for host and device: the decision, the float filter in front of it, what a contact
// record holds, and who owns a contact. Lengths in the caller's unit. Proofs and drawings: docs/detector.md.
#pragma once
#include "detect/host_device.h"

namespace padder::detect {

// A sphere as given: float input is widened without loss. Radius 0 is a point.
struct Sphere {
  double x = 0, y = 0, z = 0, r = 0;
};

// Why a sphere is refused.
enum class Fault : std::uint32_t { none, not_finite, negative_radius, too_large };
inline constexpr double kLargest = 1e100;  // of a coordinate or radius: squares and sums of it stay finite

PADDER_HD Fault fault_of(const Sphere& s) {
  const double m = larger(larger(magnitude(s.x), magnitude(s.y)), magnitude(s.z));
  if (!(magnitude(s.x) <= 1.7976931348623157e308 && magnitude(s.y) <= 1.7976931348623157e308 &&
        magnitude(s.z) <= 1.7976931348623157e308 && magnitude(s.r) <= 1.7976931348623157e308))
    return Fault::not_finite;
  if (s.r < 0) return Fault::negative_radius;
  return m > kLargest || s.r > kLargest ? Fault::too_large : Fault::none;
}

// THE decision, in plain IEEE double arithmetic, each operation rounded once, in this order. Every backend,
// path and thread count reports exactly the pairs for which it is true. Symmetric in a and b; touching
// counts.
PADDER_HD double length_squared(double x, double y, double z) {
  return add(add(mul(x, x), mul(y, y)), mul(z, z));
}
// Squares of small lengths underflow, so small pairs are first scaled up, which is exact. With u = 2^-53:
//   s >= 2^-500: s s >= 2^-1000, and what squares of differences lose, 3 * 2^-1075, is below 2^-73 of it.
//   s < 2^-500: scaled, s < 2^100, and a length that is not 0 is at least 2^(600 - 1074), its square
//   2^-948: nothing underflows. A difference may overflow; then it is infinite, and rightly apart.
// So at any size the decision is that of the rounded differences and sum up to 5 u of s s, and a scene times
// a power of two has the same contacts.
inline constexpr double kSmallSum = 0x1p-500, kScaleUp = 0x1p600;
PADDER_HD bool touching(const Sphere& a, const Sphere& b) {
  double x = sub(b.x, a.x), y = sub(b.y, a.y), z = sub(b.z, a.z), s = add(a.r, b.r);
  if (s < kSmallSum) x = mul(x, kScaleUp), y = mul(y, kScaleUp), z = mul(z, kScaleUp), s = mul(s, kScaleUp);
  return length_squared(x, y, z) <= mul(s, s);
}
// The same where a.r + b.r is known not to be small: no branch, for loops over many b.
PADDER_HD bool touching_unscaled(const Sphere& a, const Sphere& b) {
  const double s = add(a.r, b.r);
  return length_squared(sub(b.x, a.x), sub(b.y, a.y), sub(b.z, a.z)) <= mul(s, s);
}

// What the search reads of a sphere, 16 bytes. Input in float is kept as it is. Input in double becomes fixed
// point in units of the bin (grid.h: 2^-24 of its edge, modulo 256 bins): the difference of two neighbours is
// exact in integers however far from the origin they are, so the band below does not grow with the domain.
struct alignas(16) FloatSlot {
  float x, y, z, r;
};
// The same in fixed point.
struct alignas(16) FixedPointSlot {
  std::int32_t x, y, z;
  float r;  // in the same units
};

// The filter: what float says about a pair, and the band in which it says nothing. With u = 2^-24:
//   float input:  |d2 - true| <= 5.01 u d2, |s2 - true| <= 3.01 u s2 (+ 2^-147 where a square underflows)
//   fixed point:  each difference is off by at most 1.001 units and u of itself; |s2 - true| <= 5.01 u s2
// The band 16 u s2 + kAbsolute covers both (docs/detector.md), also where the compiler fuses operations here.
enum class Verdict : std::uint32_t { apart, touch, doubt };
inline constexpr float kRelativeBand = 0x1p-20f;

template <class Slot>
inline constexpr float kAbsoluteBand = 0x1p-100f;
template <>
inline constexpr float kAbsoluteBand<FixedPointSlot> = 0x1p26f;

// Squares of the distance and of the sum of the radii, in float.
struct Measured {
  float d2, s2;
};
PADDER_HD Measured measured(const FloatSlot& a, const FloatSlot& b) {
  const float x = b.x - a.x, y = b.y - a.y, z = b.z - a.z, s = a.r + b.r;
  return {x * x + y * y + z * z, s * s};
}
PADDER_HD std::int32_t wrapped_difference(std::int32_t a, std::int32_t b) {
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(b) - static_cast<std::uint32_t>(a));
}
PADDER_HD Measured measured(const FixedPointSlot& a, const FixedPointSlot& b) {
  const float x = static_cast<float>(wrapped_difference(a.x, b.x));
  const float y = static_cast<float>(wrapped_difference(a.y, b.y));
  const float z = static_cast<float>(wrapped_difference(a.z, b.z));
  const float s = a.r + b.r;
  return {x * x + y * y + z * z, s * s};
}
template <class Slot>
PADDER_HD Verdict verdict(const Measured& m) {
  const float band = kRelativeBand * m.s2 + kAbsoluteBand<Slot>, excess = m.d2 - m.s2;
  return excess > band ? Verdict::apart : excess < -band ? Verdict::touch : Verdict::doubt;
}

// Float input may be searched as it is where no square can overflow and few can underflow; beyond, it is
// treated as double input. `extent` is the largest coordinate by magnitude, `radius` the largest radius.
PADDER_HD bool float_range(double extent, double radius) {
  return extent < 0x1p55 && radius < 0x1p55 && radius > 0x1p-40;
}

// What a contact record holds, in double; i is the sphere of the smaller index.
struct Geometry {
  double normal[3];         // unit, from i to j; (1, 0, 0) for equal centres
  double depth;             // ri + rj - distance, >= 0 up to rounding
  double on_i[3], on_j[3];  // the deepest point of each sphere in the other: ci + ri n, cj - rj n
};
// From one centre to another, and how far. All but `down` is multiplied by `up`: 1, but where squares would
// lose digits a power of two; down = 1 / up.
struct Line {
  double x, y, z, length, up, down;
};
inline constexpr double kSmallSquare = 0x1p-900;
PADDER_HD Line line_of(double x, double y, double z) {
  const double d2 = length_squared(x, y, z);
  if (!(d2 < kSmallSquare)) return {x, y, z, root(d2), 1, 1};
  x = mul(x, kScaleUp), y = mul(y, kScaleUp), z = mul(z, kScaleUp);
  return {x, y, z, root(length_squared(x, y, z)), kScaleUp, 1 / kScaleUp};
}
PADDER_HD Line line_of(const Sphere& i, const Sphere& j) {
  return line_of(sub(j.x, i.x), sub(j.y, i.y), sub(j.z, i.z));
}
PADDER_HD Geometry geometry(const Sphere& i, const Sphere& j) {
  Geometry g;
  const Line l = line_of(i, j);
  g.depth = sub(add(i.r, j.r), mul(l.length, l.down));
  const double per_d = l.length > 0 ? div(1, l.length) : 0;
  g.normal[0] = l.length > 0 ? mul(l.x, per_d) : 1;
  g.normal[1] = mul(l.y, per_d);
  g.normal[2] = mul(l.z, per_d);
  const double ci[3] = {i.x, i.y, i.z}, cj[3] = {j.x, j.y, j.z};
  for (int k = 0; k < 3; k++) {
    g.on_i[k] = add(ci[k], mul(i.r, g.normal[k]));
    g.on_j[k] = sub(cj[k], mul(j.r, g.normal[k]));
  }
  return g;
}

// The midpoint of the collision volume (section 2.1, stage 7): it lies in one bin only, and in one box only,
// so that the pair is reported once. Where one sphere contains the other it is the centre of the smaller.
struct Midpoint {
  double x, y, z;
};
PADDER_HD Midpoint midpoint(const Sphere& i, const Sphere& j) {
  const Line l = line_of(i, j);
  const double larger_by = mul(sub(i.r, j.r), l.up);
  if (l.length <= magnitude(larger_by)) return i.r <= j.r ? Midpoint{i.x, i.y, i.z} : Midpoint{j.x, j.y, j.z};
  // Halfway between the two deepest points, measured along the line of centres from i.
  const double t = div(mul(0.5, add(l.length, larger_by)), l.length);
  return {add(i.x, mul(t, sub(j.x, i.x))), add(i.y, mul(t, sub(j.y, i.y))), add(i.z, mul(t, sub(j.z, i.z)))};
}

// A box to own: low <= point < high. Boxes that share a face own each contact once.
struct Region {
  double low[3] = {-INFINITY, -INFINITY, -INFINITY}, high[3] = {INFINITY, INFINITY, INFINITY};
  friend bool operator==(const Region&, const Region&) = default;
};
PADDER_HD bool owns(const Region& r, const Midpoint& m) {
  return r.low[0] <= m.x && m.x < r.high[0] && r.low[1] <= m.y && m.y < r.high[1] && r.low[2] <= m.z &&
         m.z < r.high[2];
}

// Order-free hash of a contact set: the sum of this over its pairs, modulo 2^64.
PADDER_HD std::uint64_t pair_hash(std::uint32_t i, std::uint32_t j) {
  return mixed(static_cast<std::uint64_t>(i) << 32 | j);
}

}  // namespace padder::detect
