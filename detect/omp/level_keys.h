// SPDX-License-Identifier: MIT
// The keys of bins on the grid path of the CPU. Internal.
//
// On every level the key of bin (x, y, z) is linear: x + y * row + z * plane and a constant. On a dense level
// each bin has a key of its own. On a level with too many bins for a table (Level::hashed), the keys are
// taken modulo `ring`, a power of two of some two buckets for each sphere. The level is then a dense one that
// is laid over itself again and again, each time shifted. Neighbouring bins stay neighbours in memory as they
// do on a dense level. Far bins share buckets, and so a search meets spheres that are far away; their
// distance refuses them.
#pragma once
#include <algorithm>

#include "detect/core/grid.h"

namespace padder::detect::omp {

struct LevelKeys {
  std::uint32_t row = 0, plane = 0;  // steps of the key from a bin to the next in y, and in z
  std::uint32_t base = 0;            // the key of bin (0, 0, 0), before it is taken modulo the ring
  std::uint32_t mask = ~0u;          // ring - 1; all bits on a dense level
  std::uint32_t offset = 0;          // of the level's keys

  // Bin numbers count modulo 2^32: what is cut off is a multiple of the ring.
  std::uint32_t key(std::uint32_t x, std::uint32_t y, std::uint32_t z) const {
    return offset + ((base + x + y * row + z * plane) & mask);
  }
  std::uint32_t key(const Bin& b) const {
    return key(static_cast<std::uint32_t>(b.x), static_cast<std::uint32_t>(b.y),
               static_cast<std::uint32_t>(b.z));
  }
  bool periodic() const { return mask != ~0u; }
  // Any two bins of a box that is at most so many bins wide along each axis have different keys.
  //
  // Proof for a periodic level. Two bins of the box differ by (x, y, z), each less than `side` in magnitude.
  // Their keys differ by x + y row + z plane, which is less than the ring in magnitude, so it is a multiple
  // of the ring only if it is 0. Then row divides x, and |x| < row gives x = 0. As plane = row * k with k
  // odd, k divides y, and |y| < k gives y = 0, and so z = 0.
  std::uint32_t side() const {
    if (!periodic()) return ~0u;
    return std::min({row, plane / row, mask / (1 + row + plane) + 1});
  }
};

inline constexpr std::uint32_t kLeastRing = 1024;  // side() is at least 7, see tests/detect/omp

// The keys of a level. A hashed one must have a ring of at least kLeastRing buckets, and set_spread().
inline LevelKeys keys_of(const Level& l) {
  LevelKeys k;
  k.offset = l.offset;
  if (!l.hashed) {
    k.row = l.count[0] + 2, k.plane = k.row * (l.count[1] + 2);
    const auto first = [&](int axis) { return static_cast<std::uint32_t>(l.first[axis]) - 1; };
    k.base = 0u - first(0) - first(1) * k.row - first(2) * k.plane;
    return k;
  }
  k.mask = l.ring - 1, k.row = l.row, k.plane = l.plane;
  return k;
}

// How the bins of a periodic level spread over its ring. The last bits are such that a line of bins along an
// axis or a diagonal spreads over at least an eighth of the ring before it meets itself. With row = 5 modulo
// 8 and plane / row = 9 modulo 16, none of row, plane, 1 +- row, 1 +- plane, row +- plane and 1 +- row +-
// plane is divisible by 16.
//
// cubes: about the cube root of the ring, so that the spheres around one are not far from it in memory. But
// a plane of bins then lies on itself: (x, y) and (x + row, y - 1) share a bucket, and so do (y, z) and
// (y + plane / row, z - 1). xy and yz: one of them about the square root, for spheres that lie in a plane.
enum class Spread { cubes, xy, yz };
inline constexpr int kLeastPlaneBits =
    17;  // of a ring for planes; side() of a smaller one may be less than 7
inline void set_spread(Level& l, Spread spread) {
  const double ring = l.ring, cube = std::cbrt(ring), plane = std::sqrt(ring);
  const auto row = static_cast<std::uint32_t>(spread == Spread::cubes ? cube
                                              : spread == Spread::xy  ? plane
                                                                      : 8),
             rows = static_cast<std::uint32_t>(spread == Spread::cubes ? cube
                                               : spread == Spread::xy  ? plane / 8
                                                                       : plane);
  l.row = (row & ~7u) | 5u, l.plane = l.row * ((rows & ~15u) | 9u);
}

// The grid with rings of at least kLeastRing buckets, spread as cubes.
inline Grid with_rings(Grid g) {
  g.buckets = 0;
  for (int k = 0; k < g.levels; k++) {
    Level& l = g.level[k];
    if (l.hashed) l.ring = l.buckets = std::max(l.ring, kLeastRing), set_spread(l, Spread::cubes);
    l.offset = g.buckets, g.buckets += l.buckets;
  }
  return g;
}

}  // namespace padder::detect::omp
