// SPDX-License-Identifier: MIT
// A tree over spheres in which eight boxes are tested at once. Level 0 are the boxes of the spheres. Eight
// consecutive boxes are a group, and the next level has a box around each group. So nodes need no pointers.
// It is good if spheres that follow each other are near each other (place_on_curve()). For host and device.
// Internal.
#pragma once
#include <bit>

#include "detect/core/world_tree.h"

namespace padder::detect {

struct alignas(64) BoxGroup {
  static constexpr std::uint32_t kShift = 3, kBoxes = 1u << kShift;
  float low[3][kBoxes], high[3][kBoxes];

  PADDER_HD void set(std::uint32_t k, const TreeBox& b) {
    for (int c = 0; c < 3; c++) low[c][k] = b.low[c], high[c][k] = b.high[c];
  }
  PADDER_HD TreeBox around() const {
    TreeBox all;
    for (std::uint32_t k = 0; k < kBoxes; k++)
      include(all, {{low[0][k], low[1][k], low[2][k]}, {high[0][k], high[1][k], high[2][k]}});
    return all;
  }
  // A bit for each box that overlaps b.
  PADDER_HD std::uint32_t overlapped_by(const TreeBox& b) const {
    std::uint32_t bits = 0;
#ifdef __CUDA_ARCH__
    for (int half = 0; half < 2; half++) {  // 16 bytes a load
      std::uint32_t four = 15;
      const auto keep = [&](const float4& v, auto within) {
        four &= within(v.x) | within(v.y) << 1 | within(v.z) << 2 | within(v.w) << 3;
      };
      for (int c = 0; c < 3; c++) {
        keep(reinterpret_cast<const float4*>(low[c])[half],
             [&](float v) { return static_cast<std::uint32_t>(v <= b.high[c]); });
        keep(reinterpret_cast<const float4*>(high[c])[half],
             [&](float v) { return static_cast<std::uint32_t>(b.low[c] <= v); });
      }
      bits |= four << 4 * half;
    }
#else
    // Written so that compilers make vectors of it.
    constexpr std::uint32_t kBit[kBoxes] = {1, 2, 4, 8, 16, 32, 64, 128};
    for (std::uint32_t k = 0; k < kBoxes; k++) {
      std::uint32_t bit = kBit[k];
      for (int c = 0; c < 3; c++)
        bit = low[c][k] <= b.high[c] ? bit : 0, bit = b.low[c] <= high[c][k] ? bit : 0;
      bits |= bit;
    }
#endif
    return bits;
  }
};

// Where the levels of a tree begin in an array of groups.
struct WideTreeLevels {
  static constexpr int kMost = 11;  // 8^11 = 2^33
  std::uint32_t first[kMost + 1] = {};
  int count = 0;

  // Of a tree over `spheres`. The array has first[count] groups.
  static WideTreeLevels of(std::uint32_t spheres) {
    WideTreeLevels levels;
    for (std::uint32_t boxes = spheres, groups = 2; groups > 1; boxes = groups) {
      groups = boxes / BoxGroup::kBoxes + (boxes % BoxGroup::kBoxes != 0);
      levels.first[levels.count + 1] = levels.first[levels.count] + groups;
      levels.count++;
    }
    return levels;
  }
};

struct WideTree {
  BoxGroup* groups = nullptr;
  WideTreeLevels levels;

  // The boxes of the groups of a level, those that overlap nothing included.
  PADDER_HD std::uint32_t boxes_of(int level) const {
    return (levels.first[level + 1] - levels.first[level]) * BoxGroup::kBoxes;
  }
  // Sets such a box, if those of the level below are set already. `spheres`: of all `count`.
  PADDER_HD void set(int level, std::uint32_t at, const Sphere* spheres, std::uint32_t count) const {
    TreeBox box;
    if (level == 0 && at < count) box = box_of(spheres[at], 0);
    if (level > 0 && at < levels.first[level] - levels.first[level - 1])
      box = groups[levels.first[level - 1] + at].around();
    groups[levels.first[level] + at / BoxGroup::kBoxes].set(at % BoxGroup::kBoxes, box);
  }

  // Calls found(k) for each sphere k of [first, end) whose box overlaps `box`, in ascending order; false ends
  // the walk. found() may make the box smaller.
  template <class Found>
  PADDER_HD void visit(const TreeBox& box, std::uint32_t first, std::uint32_t end, Found found) const {
    constexpr std::uint32_t kShift = BoxGroup::kShift;
    if (first >= end) return;
    // The smallest group that contains them all.
    std::uint32_t level = 0;
    while (first >> (kShift * (level + 1)) != (end - 1) >> (kShift * (level + 1))) level++;
    const std::uint32_t top = level;
    std::uint32_t group = first >> (kShift * (level + 1));
    // The boxes to be entered yet of the groups above: a byte for each, that of the next level lowest.
    std::uint64_t left = 0, left_above = 0;
    while (true) {
      const std::uint32_t shift = kShift * level, begin = group << kShift, low = first >> shift,
                          high = (end - 1) >> shift, from = low > begin ? low - begin : 0,
                          to = high - begin < BoxGroup::kBoxes ? high - begin : BoxGroup::kBoxes - 1;
      std::uint32_t met =
          groups[levels.first[level] + group].overlapped_by(box) & ((2u << to) - (1u << from));
      if (level == 0)
        for (; met; met &= met - 1)
          if (!found(begin | lowest_bit(met))) return;
      for (; met == 0; level++, group >>= kShift) {
        if (level == top) return;
        met = left & 255;
        left = left >> 8 | left_above << 56, left_above >>= 8;
      }
      left_above = left_above << 8 | left >> 56, left = left << 8 | (met & (met - 1));
      level--, group = group << kShift | lowest_bit(met);
    }
  }

 private:
  static PADDER_HD std::uint32_t lowest_bit(std::uint32_t bits) {
#ifdef __CUDA_ARCH__
    return static_cast<std::uint32_t>(__ffs(static_cast<int>(bits)) - 1);
#else
    return static_cast<std::uint32_t>(std::countr_zero(bits));
#endif
  }
};

}  // namespace padder::detect
