// SPDX-License-Identifier: MIT
// Sphere against sphere, for host and device: the exact test, the float test in front of it, what a contact
// record holds, and which region owns a contact. Lengths are in the caller's unit. Proofs and drawings:
// docs/detector/exactness.md.
#pragma once
#include "detect/host_device.h"

namespace padder::detect {

// A sphere in double, to which float input is converted without loss. With radius 0 it is a point.
struct Sphere {
  double x = 0, y = 0, z = 0, r = 0;
};

// Why a sphere is refused.
enum class Fault : std::uint32_t { none, not_finite, negative_radius, too_large };
// The largest coordinate or radius that is accepted, so that squares and their sums stay finite.
inline constexpr double kLargest = 1e100;

PADDER_HD Fault fault_of(const Sphere& s) {
  const double m = larger(larger(magnitude(s.x), magnitude(s.y)), magnitude(s.z));
  if (!(magnitude(s.x) <= 1.7976931348623157e308 && magnitude(s.y) <= 1.7976931348623157e308 &&
        magnitude(s.z) <= 1.7976931348623157e308 && magnitude(s.r) <= 1.7976931348623157e308))
    return Fault::not_finite;
  if (s.r < 0) return Fault::negative_radius;
  return m > kLargest || s.r > kLargest ? Fault::too_large : Fault::none;
}

// The exact test: do two spheres touch? It is written in IEEE double arithmetic, and each operation is
// rounded once, in this order. Every backend and path, with any number of threads, reports exactly the pairs
// for which it is true. It is symmetric in a and b. Spheres that touch in one point count.
PADDER_HD double length_squared(double x, double y, double z) {
  return add(add(mul(x, x), mul(y, y)), mul(z, z));
}
// Squares of small lengths underflow, so pairs with a small sum of radii s are scaled up first, which is
// exact.
//
// For s >= 2^-500, s s >= 2^-1000. The squares of the differences lose at most 3 * 2^-1075, which is below
// 2^-73 s s.
//
// For s < 2^-500, the scaled s is below 2^100. A scaled length that is not 0 is at least 2^(600 - 1074), and
// its square 2^-948, so nothing underflows. A scaled difference may overflow; then it is infinite, and the
// spheres are indeed apart.
//
// So at any size the test decides by the rounded differences and the rounded sum, up to 5 * 2^-53 s s, and a
// scene times a power of two has the same contacts.
inline constexpr double kSmallSum = 0x1p-500, kScaleUp = 0x1p600;
PADDER_HD bool touching(const Sphere& a, const Sphere& b) {
  double x = sub(b.x, a.x), y = sub(b.y, a.y), z = sub(b.z, a.z), s = add(a.r, b.r);
  if (s < kSmallSum) x = mul(x, kScaleUp), y = mul(y, kScaleUp), z = mul(z, kScaleUp), s = mul(s, kScaleUp);
  return length_squared(x, y, z) <= mul(s, s);
}
// The same test if a.r + b.r is known not to be small. It has no branch, for loops over many b.
PADDER_HD bool touching_unscaled(const Sphere& a, const Sphere& b) {
  const double s = add(a.r, b.r);
  return length_squared(sub(b.x, a.x), sub(b.y, a.y), sub(b.z, a.z)) <= mul(s, s);
}

// The same test with a margin of 0 or more: is the gap at most `margin`? The sum of the radii and the margin
// takes the place of the sum of the radii, and is rounded once more. A margin of 0 gives touching(a, b).
PADDER_HD bool touching(const Sphere& a, const Sphere& b, double margin) {
  double x = sub(b.x, a.x), y = sub(b.y, a.y), z = sub(b.z, a.z), s = add(add(a.r, b.r), margin);
  if (s < kSmallSum) x = mul(x, kScaleUp), y = mul(y, kScaleUp), z = mul(z, kScaleUp), s = mul(s, kScaleUp);
  return length_squared(x, y, z) <= mul(s, s);
}

// What the search reads of a sphere: 16 bytes. Float input is kept as it is.
struct alignas(16) FloatSlot {
  float x, y, z, r;
};
// Double input becomes fixed point: positions in units of 2^-24 of a bin's edge, modulo 256 bins (grid.h).
// The difference of two neighbours is then exact in integers, however far from the origin they are, so the
// float band below does not grow with the domain.
struct alignas(16) FixedPointSlot {
  std::int32_t x, y, z;
  float r;  // in the same units
};

// The float test: what float arithmetic says about a pair, and the float band, in which it cannot decide.
//
// Let u = 2^-24. For float input, |d2 - true| <= 5.01 u d2 and |s2 - true| <= 3.01 u s2, plus 2^-147 where a
// square underflows. In fixed point, each difference is off by at most 1.001 units and u of itself, and |s2 -
// true| <= 5.01 u s2. The band 16 u s2 + kAbsoluteBand covers both (docs/detector/exactness.md), even if the
// compiler fuses operations.
enum class Verdict : std::uint32_t { apart, touch, doubt };
inline constexpr float kRelativeBand = 0x1p-20f;

template <class Slot>
inline constexpr float kAbsoluteBand = 0x1p-100f;
template <>
inline constexpr float kAbsoluteBand<FixedPointSlot> = 0x1p26f;

// The squares of the distance and of the sum of the radii, in float.
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

// Can float input be searched as it is? Only where no square can overflow and few can underflow; elsewhere it
// is treated like double input. `extent` is the largest magnitude of a coordinate, `radius` the largest
// radius.
PADDER_HD bool float_range(double extent, double radius) {
  return extent < 0x1p55 && radius < 0x1p55 && radius > 0x1p-40;
}

// What a contact record holds, in double. i is the sphere with the smaller number.
struct Geometry {
  double normal[3];  // unit vector from i to j; (1, 0, 0) for equal centres
  double depth;      // the penetration ri + rj - distance; up to rounding 0 or more without a margin, and at
                     // least -margin with one
  double on_i[3], on_j[3];  // the deepest point of each sphere inside the other: ci + ri n, cj - rj n
};
// The vector from one centre to another and its length, all multiplied by `scale`. That is 1, or a power of
// two where squares would lose digits. per_scale = 1 / scale.
struct Line {
  double x, y, z, length, scale, per_scale;
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
  g.depth = sub(add(i.r, j.r), mul(l.length, l.per_scale));
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

// The midpoint of the collision volume (section 2.1, stage 7). It lies in one bin and one region only, so the
// pair is reported once. If one sphere contains the other, it is the centre of the smaller one.
struct Midpoint {
  double x, y, z;
};
PADDER_HD Midpoint midpoint(const Sphere& i, const Sphere& j) {
  const Line l = line_of(i, j);
  const double larger_by = mul(sub(i.r, j.r), l.scale);
  if (l.length <= magnitude(larger_by)) return i.r <= j.r ? Midpoint{i.x, i.y, i.z} : Midpoint{j.x, j.y, j.z};
  // Half way between the two deepest points, measured from i along the line of centres.
  const double t = div(mul(0.5, add(l.length, larger_by)), l.length);
  return {add(i.x, mul(t, sub(j.x, i.x))), add(i.y, mul(t, sub(j.y, i.y))), add(i.z, mul(t, sub(j.z, i.z)))};
}

// A box that owns the contacts whose midpoints m are inside: low <= m < high. Of boxes that share a face, one
// owns each contact.
struct Region {
  double low[3] = {-INFINITY, -INFINITY, -INFINITY}, high[3] = {INFINITY, INFINITY, INFINITY};
  friend bool operator==(const Region&, const Region&) = default;
};
PADDER_HD bool owns(const Region& r, const Midpoint& m) {
  return r.low[0] <= m.x && m.x < r.high[0] && r.low[1] <= m.y && m.y < r.high[1] && r.low[2] <= m.z &&
         m.z < r.high[2];
}

// The sum of this over all pairs, modulo 2^64, is a hash of a set of contacts that does not depend on their
// order.
PADDER_HD std::uint64_t pair_hash(std::uint32_t i, std::uint32_t j) {
  return mixed(static_cast<std::uint64_t>(i) << 32 | j);
}

}  // namespace padder::detect
