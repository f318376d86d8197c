// SPDX-License-Identifier: MIT
// What trees over the elements of scenes of many worlds are made of, and the one that the GPU walks over
// (the wide one: wide_tree.h). It finds pairs of elements (pieces of bodies and loose spheres) that are near
// each other. Elements are ordered by world, so the partners of an element lie in two ranges: the rest of its
// world, and kEveryWorld. A node is eight consecutive elements or nodes and the box around them. So nodes
// need no pointers, and one tree serves all worlds. For host and device. Internal.
#pragma once
#include "detect/contact.h"
#include "detect/filter.h"

namespace padder::detect {

inline constexpr int kTreeShift = 3;  // log2 of the children of a node
inline constexpr int kTreeLevels =
    10;  // level 0 are the elements; 8^10 = 2^30, so that four are on top at most
// A world of more elements has them sorted along a space-filling curve, so that nodes are small. Smaller ones
// have no nodes.
inline constexpr std::uint32_t kSmallWorld = 64;

// The largest float that is not above v, and the smallest that is not below it.
PADDER_HD float float_below(double v) {
#ifdef __CUDA_ARCH__
  return __double2float_rd(v);
#else
  const auto f = static_cast<float>(v);
  return f > v ? std::nextafterf(f, -INFINITY) : f;
#endif
}
PADDER_HD float float_above(double v) { return -float_below(-v); }

// A box that contains all points of a ball, whatever was rounded.
struct TreeBox {
  float low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
};
PADDER_HD TreeBox box_of(const Sphere& ball, double reach) {
  TreeBox box;
  const double c[3] = {ball.x, ball.y, ball.z}, r = ball.r + reach, size = ball.r + magnitude(reach);
  for (int k = 0; k < 3; k++) {
    // Far more than the roundings of these lines and of the decision in contact.h.
    const double margin = (magnitude(c[k]) + size) * 0x1p-46 + 0x1p-1060;
    box.low[k] = float_below(c[k] - r - margin), box.high[k] = float_above(c[k] + r + margin);
  }
  return box;
}
PADDER_HD bool overlap(const TreeBox& a, const TreeBox& b) {
  return a.low[0] <= b.high[0] && b.low[0] <= a.high[0] && a.low[1] <= b.high[1] && b.low[1] <= a.high[1] &&
         a.low[2] <= b.high[2] && b.low[2] <= a.high[2];
}
PADDER_HD void include(TreeBox& box, const TreeBox& other) {
  for (int k = 0; k < 3; k++) {
    box.low[k] = box.low[k] < other.low[k] ? box.low[k] : other.low[k];
    box.high[k] = box.high[k] > other.high[k] ? box.high[k] : other.high[k];
  }
}

// False only if the gap of the balls, and so of everything in them, is larger than `reach`, which is negative
// where only pairs that overlap deeper are of interest. The margins cover all roundings.
PADDER_HD bool near_each_other(const Sphere& a, const Sphere& b, double reach) {
  const double x = b.x - a.x, y = b.y - a.y, z = b.z - a.z;
  const double s = a.r + b.r + reach + 0x1p-40 * (a.r + b.r + magnitude(reach));
  return s >= 0 && x * x + y * y + z * z <= s * s + 0x1p-1000;
}
// The signed distance of two spheres: -depth of geometry(), which is the same for (a, b) and (b, a).
PADDER_HD double signed_distance(const Sphere& a, const Sphere& b) {
  const Line l = line_of(a, b);
  return sub(mul(l.length, l.per_scale), add(a.r, b.r));
}

// The elements of a scene in their order, and the nodes above those from `base` on.
struct WorldTree {
  const Sphere* balls = nullptr;
  const TreeBox* nodes = nullptr;             // level by level from level 1 on; level 0 are the elements
  std::uint32_t first[kTreeLevels + 2] = {};  // the first node of each level, and the end
  std::uint32_t levels = 0;                   // the highest level
  std::uint32_t count = 0, every_first = 0;   // elements; the first of kEveryWorld
  std::uint32_t base = 0;
  friend bool operator==(const WorldTree&, const WorldTree&) = default;
};
// Where nodes begin to pay. `largest`: the elements of the largest world but kEveryWorld.
inline std::uint32_t base_of(std::uint32_t largest, std::uint32_t every_first) {
  return largest > kSmallWorld ? 0 : every_first;
}
// Lays out the nodes above the elements from `base` to `count`. Returns how many there are.
inline std::uint32_t lay_out(WorldTree& tree, std::uint32_t count, std::uint32_t base) {
  std::uint32_t nodes = 0;
  tree.count = count, tree.base = base, tree.levels = 0;
  for (std::uint64_t below = count - base; below > 1 && tree.levels < kTreeLevels;) {
    below = (below + (1u << kTreeShift) - 1) >> kTreeShift;
    tree.first[++tree.levels] = nodes;
    nodes += static_cast<std::uint32_t>(below);
  }
  tree.first[tree.levels + 1] = nodes;
  return nodes;
}
// The box of node k of a level from 1 on, from its children.
PADDER_HD TreeBox box_of_node(const WorldTree& tree, std::uint32_t level, std::uint32_t k) {
  TreeBox box;
  const std::uint32_t children =
      level == 1 ? tree.count - tree.base : tree.first[level] - tree.first[level - 1];
  for (std::uint32_t c = k << kTreeShift; c < children && c < (k + 1) << kTreeShift; c++)
    include(box, level == 1 ? box_of(tree.balls[tree.base + c], 0) : tree.nodes[tree.first[level - 1] + c]);
  return box;
}

// A walk over the elements from `at` to `end` - 1 that skips nodes which meets(box, first, end) refuses. It
// enters the largest node that begins where it stands and ends in the range, and needs no stack.
struct TreeWalk {
  std::uint32_t at = 0, end = 0, level = 0;
  bool fresh = true;  // nothing that begins at `at` was looked at yet

  // At most eight consecutive elements that are not skipped.
  struct Run {
    std::uint32_t first, end;
    bool in_node;  // of which meets() was asked last
  };
  // The next run. One without elements ends the walk.
  template <class Meets>
  PADDER_HD Run next(const WorldTree& tree, Meets meets) {
    while (at < end) {
      const bool below = at < tree.base;  // there are no nodes
      const std::uint32_t place = at - tree.base;
      if (fresh)
        for (level = 0, fresh = false; !below && level < tree.levels; level++) {
          const std::uint32_t size = 1u << (kTreeShift * (level + 1));
          if ((place & (size - 1)) != 0 || (end - at < size && end != tree.count)) break;
        }
      const std::uint32_t first = at, shift = kTreeShift * (level ? level : 1), size = 1u << shift,
                          to = below ? at + size : at + size - (place & (size - 1)),
                          next = to < at || to > end ? end : to;
      const bool meet = level == 0 || meets(tree.nodes[tree.first[level] + (place >> shift)], at, next);
      if (meet && level > 1) {
        level--;
        continue;
      }
      const bool in_node = level == 1;
      at = next, fresh = true;
      if (meet) return {first, next, in_node};
    }
    return {end, end, false};
  }
};

// Morton's space-filling curve: 21 bits of each coordinate, which are taken in [0, 2^21).
PADDER_HD std::uint64_t spread_bits(double v) {
  std::uint64_t b = !(v > 0) ? 0 : v < 2097151 ? static_cast<std::uint64_t>(v) : 2097151;
  b = (b | b << 32) & 0x1f00000000ffff, b = (b | b << 16) & 0x1f0000ff0000ff;
  b = (b | b << 8) & 0x100f00f00f00f00f, b = (b | b << 4) & 0x10c30c30c30c30c3;
  return (b | b << 2) & 0x1249249249249249;
}
// The part of space that the curve resolves; elements outside lie at its faces.
struct CurveBox {
  double low[3] = {0, 0, 0}, per_step[3] = {1, 1, 1};
};
PADDER_HD std::uint64_t place_on_curve(const CurveBox& c, const Sphere& s) {
  return spread_bits((s.x - c.low[0]) * c.per_step[0]) | spread_bits((s.y - c.low[1]) * c.per_step[1]) << 1 |
         spread_bits((s.z - c.low[2]) * c.per_step[2]) << 2;
}
// From two quantiles of the coordinates along an axis, because one sphere far away must not coarsen the curve
// for all others.
PADDER_HD void set_axis(CurveBox& c, int axis, double low, double high) {
  const double wide = high - low;
  c.low[axis] = low - wide;
  c.per_step[axis] = wide > 0 && wide < 1e300 ? 2097152 / (3 * wide) : 0;
}

}  // namespace padder::detect
