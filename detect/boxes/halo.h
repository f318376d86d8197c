// SPDX-License-Identifier: MIT
// Which boxes need a sphere or a body: those that can own one of its contacts. A box finds its contacts from
// the spheres that it was given, so both partners of every contact that it owns must be among them.
//
// THEOREM. Let two spheres touch (`touching` in contact.h) and let m be their midpoint as `midpoint` computes
// it. Let R be the largest radius of the scene. Then m lies in halo_of(s, R) of both spheres.
// So a box that owns the contact meets both halos, and both spheres are sent to it. Nothing else is needed:
// the halo of a sphere depends on its own size, and a huge sphere goes to the many boxes that its own ball
// meets, but makes no other sphere travel.
//
// PROOF. Write u = 2^-53, ci, ri, cj, rj for the spheres, D = |cj - ci|, L and t for `length` and t as
// computed, both brought back to the caller's unit.
//  1. A difference of coordinates is rounded once, and squares that could underflow are scaled up first. So
//     L = D (1 + e) with |e| <= 6 u. As the spheres touch, D <= (ri + rj)(1 + 9 u) (contact.h: the decision
//     is right up to 5 u of the squared sum of the radii).
//  2. One contains the other by L <= |ri - rj|: m is the centre of the smaller, which lies at distance 0 of
//     its own centre and at D <= rj (1 + 9 u) of the centre of the larger, whose radius is rj.
//  3. Otherwise |ri - rj| < L, and t = (L + ri - rj) / (2 L) up to 4 u of itself. So 0 <= t <= 1 + 4 u, and
//     t D <= (ri + rj + ri - rj) / 2 + 20 u (ri + rj) = ri + 20 u (ri + rj). In the same way
//     (1 - t) D <= rj + 20 u (ri + rj).
//  4. A coordinate ci + t (cj - ci) is computed with a rounded difference, a product and a sum. This adds at
//     most 3 u t D + u (|ci| + t D) when it is seen from ci, and as much with cj when it is seen from cj, as
//     |ci| <= |cj| + D.
//  Together: every coordinate of m is within r + 30 u (|c| + r + R) of that of either centre c, where r is
//  its radius, plus 2^-1070 for products that underflow. The halo below adds 128 u and 2^-1060, which also
//  covers the rounding of its own faces.
//
// With a margin m, pairs count whose gap is at most m (contact.h). In the proof ri + rj + m takes the place
// of ri + rj: then t D <= ri + m / 2 + 20 u (ri + rj + m), so the halos are wider by m / 2.
//
// The term with R is 2^-46 of the largest radius. It matters only for spheres 1e13 times as large as a box.
#pragma once

#include "detect/boxes/cut.h"
#include "detect/detector.h"

namespace padder::detect {

inline constexpr double kHaloRounding = 0x1p-46, kHaloUnderflow = 0x1p-1060;

// Where the midpoints of a sphere's contacts can lie. The sphere must be one that fault_of() accepts.
PADDER_HD Bounds halo_of(const Sphere& s, double largest_radius, double margin = 0) {
  const double extent = larger(larger(magnitude(s.x), magnitude(s.y)), magnitude(s.z));
  const double reach =
      s.r + margin / 2 + (kHaloRounding * (extent + s.r + largest_radius + margin) + kHaloUnderflow);
  return {{s.x - reach, s.y - reach, s.z - reach}, {s.x + reach, s.y + reach, s.z + reach}};
}

// A shape as far as the cut needs it.
struct ShapeExtent {
  std::uint64_t count = 0;
  double low[3] = {INFINITY, INFINITY, INFINITY};  // of the centres, in the shape's own frame
  double high[3] = {-INFINITY, -INFINITY, -INFINITY};
  double largest_radius = 0;
  bool faulty = false;  // one of its spheres is refused by fault_of()
};
ShapeExtent extent_of(const Shape& shape);

// The middle of a placed body: the point that the cut counts it at.
void middle_of(const Body& body, const ShapeExtent& shape, double (&at)[3]);

// Where the midpoints of the contacts of a body's spheres can lie: bounds of all of their halos, for a
// rotation that may be any matrix. A body is never divided: each box that these bounds meet gets all of it.
// Faces that cannot be computed are infinite. Cost: the same for a shape of any size.
//
// Interval arithmetic. Every product and sum, here and in placed(), is off by at most u of `size`, the sum of
// the magnitudes: 6 u there, 6 u here, and the 30 u of the theorem. kHaloRounding is 128 u.
PADDER_HD Bounds halo_of(const Body& body, const ShapeExtent& shape, double largest_radius,
                         double margin = 0) {
  Bounds b{{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
  if (shape.count == 0) return b;
  double low[3], high[3], extent = 0;
  for (int a = 0; a < 3; a++) {
    low[a] = high[a] = body.position[a];
    double size = magnitude(body.position[a]);
    for (int k = 0; k < 3; k++) {
      const double m = body.rotation[3 * a + k], p = m * shape.low[k], q = m * shape.high[k];
      low[a] += smaller(p, q), high[a] += larger(p, q);
      size += larger(magnitude(p), magnitude(q));
    }
    extent = larger(extent, size);
  }
  const double r = shape.largest_radius;
  const double reach =
      r + margin / 2 + (kHaloRounding * (extent + r + largest_radius + margin) + kHaloUnderflow);
  for (int a = 0; a < 3; a++) {
    b.low[a] = low[a] - reach, b.high[a] = high[a] + reach;
    if (!(b.low[a] <= b.high[a])) b.low[a] = -INFINITY, b.high[a] = INFINITY;  // not a number
  }
  return b;
}

}  // namespace padder::detect
