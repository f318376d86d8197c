// SPDX-License-Identifier: MIT
// Keys of spheres on the device: by the grid, as in every backend, or by bins in float where float is exact
// enough. Keys of bins in float are so cheap that each kernel computes them again instead of reading them.
// Only .cu files include this.
#pragma once
#include <algorithm>

#include "detect/cuda/device/counters.h"
#include "detect/cuda/input/bounds.h"
#include "detect/cuda/order/codes.h"
#include "detect/cuda/tuning.h"

namespace padder::detect::cuda {

// The bin in float of one dense level: t = (x - origin) * per_size rounded, bin = floor(t). The difference of
// two floats and the product are rounded once each, so that t is off by less than 2^-23 of itself, and never
// decreases with x. Edges are longer than the level's by the factor 1 / (1 - side * 2^-21), with `side` the
// most bins on an axis: two coordinates no more than level.size apart then differ by at most
//   1 - side * 2^-21 + 2 * (side + 1/4) * 2^-23 < 1 in t, hence by at most one bin,
// and along x, where all is `fine` times as much, by at most `fine` bins. A bin here need not be the bin of
// grid.h. Keys are numbered x fastest, with `fine` empty bins between two rows and a border of rows.
//
// The origin is rounded down. Edges are so much longer that what lies within the level's bounds has t below
// the number of bins all the same: what searches the level looks at no bin behind the last.
//
// The bins of a hashed level are those of grid.h, as far as 2^22 bins from the origin: the product x *
// per_size is off by less than half a bin there, and the rest x - bin * size, which is rounded once, corrects
// the bin. Only a coordinate that is closer to a face than 2^-24 of an edge may count as on its other side.
// Edges exceed the largest diameter by 2^-20, so that touching spheres are still at most one bin apart.
inline FloatBins hashed_bins_of(const Level& l) {
  FloatBins b;
  const auto size = static_cast<float>(l.size);
  for (int k = 0; k < 3; k++)
    if (l.first[k] < -kMostHashedFloatBins || l.first[k] + l.count[k] > kMostHashedFloatBins) return b;
  if (static_cast<double>(size) != l.size || !std::isnormal(size) || !std::isnormal(1 / size)) return b;
  for (float& per_size : b.per_size) per_size = 1 / size;
  b.size = size, b.units = kCodeUnits / size, b.row = l.row, b.plane = l.plane, b.mask = l.ring - 1;
  b.first = l.offset, b.buckets = l.ring, b.grown_by = static_cast<float>(l.grown_by), b.on = true;
  return b;
}
inline FloatBins bins_of(const Level& l) {
  FloatBins b;
  if (l.hashed) return hashed_bins_of(l);
  b.grown_by = static_cast<float>(l.grown_by);
  std::uint32_t side = 0;
  double extent = 0, longer = 1;
  for (int k = 0; k < 3; k++) {
    const double low = static_cast<double>(l.first[k]) * l.size;
    side = std::max(side, l.count[k]), b.count[k] = l.count[k];
    extent = std::max({extent, std::abs(low), std::abs(low + l.count[k] * l.size)});
    b.origin[k] = static_cast<float>(low);
    if (b.origin[k] > low) b.origin[k] = std::nextafter(b.origin[k], -INFINITY);
    longer = std::max(longer, 1 + (low - static_cast<double>(b.origin[k])) / (l.count[k] * l.size));
  }
  // Far from the origin a float cannot tell neighbouring faces of bins apart.
  if (side > kMostFloatBins || extent * 0x1p-23 > l.size * 0x1p-4) return b;
  const double per_size = (1 - side * 0x1p-21) / (l.size * longer);
  auto rounded = static_cast<float>(per_size);
  if (rounded > per_size) rounded = std::nextafter(rounded, 0.0f);
  b.per_size[0] = b.per_size[1] = b.per_size[2] = rounded, b.units = rounded * kCodeUnits;
  b.on = std::isnormal(rounded) && std::isfinite(extent);
  return b;
}
// Bins in float for a scene of one level; FloatBins::on is false where there are none.
inline FloatBins float_bins(const Grid& grid, SlotKind kind, std::uint64_t spheres) {
  if (kind == SlotKind::fixed_point || grid.levels != 1) return {};
  FloatBins b = bins_of(grid.level[0]);
  if (!b.on || grid.level[0].hashed) return b;
  // Where bins hold many spheres, finer bins along x leave fewer candidates. Elsewhere they only make the
  // table longer.
  if (static_cast<double>(spheres) >
          tuning::kFullBin * grid.level[0].filled * b.count[0] * b.count[1] * b.count[2] &&
      grid.buckets < 0x1p29)
    b.fine = tuning::kFineBins;
  b.count[0] *= b.fine, b.per_size[0] *= static_cast<float>(b.fine);
  b.first = b.fine, b.row = b.count[0] + b.fine, b.plane = b.row * (b.count[1] + 2);
  b.buckets = b.plane * (b.count[2] + 2) + b.fine;
  return b;
}
// All keys are below this number.
inline std::uint32_t keys_of(const Grid& grid, const FloatBins& bins) {
  return bins.on ? bins.buckets : grid.buckets;
}
// Ordered::merge: where bins are many and nearly empty, several along x share an entry of the table. But not
// where rows are so short that one entry could hold bins of two rows which both hold partners of one sphere.
// And not in a hashed level: its ring is nearly empty, but the bins that hold spheres may be full. A search
// would then meet spheres three bins away, which look near by their codes, and a warp's queue would overflow.
inline int merge_of(const Grid& grid, const FloatBins& bins, std::uint64_t spheres) {
  const Level& l = grid.level[0];
  int merge = 0;
  if (grid.levels > 1 || l.hashed || bins.fine > 1 || l.count[0] < 32) return merge;
  // Of the bins, those within the spheres' bounds count: a grid that is wide for spheres in motion has the
  // same entries as a tight one.
  const double within = l.filled * static_cast<double>(keys_of(grid, bins));
  while (merge < tuning::kMostMerge &&
         within / (2 << merge) > tuning::kEntriesASphere * static_cast<double>(spheres))
    merge++;
  return merge;
}
// Bins in float for a scene of several levels.
inline LevelBins level_bins(const Grid& grid, SlotKind kind) {
  LevelBins g;
  if (kind != SlotKind::unequal || grid.levels == 1) return g;
  for (int k = 0; k < grid.levels; k++) {
    const Level& l = grid.level[k];
    FloatBins& b = g.level[k] = bins_of(l);
    if (!b.on) return {};
    if (l.hashed) continue;
    b.row = l.count[0] + 2, b.plane = b.row * (l.count[1] + 2);
    b.first = l.offset + 1, b.buckets = l.buckets;
  }
  g.top = grid.top;
  std::copy_n(grid.level_of_octave, kOctaves, g.level_of_octave);
  g.on = true;
  return g;
}

// How far a sphere of radius r of level `from` reaches among those of level `at`, in the bins by which those
// are ordered. Lengths in bins are floats; the factor and the margin of grid.h cover their rounding twice.
//
// Among bins in float, the place of the sphere that searches is found in double. That of its partner is t
// above, which is off by less than side * 2^-23 <= 2^-11 along each axis, and so by less than sqrt(3) * 2^-11
// in all. kFloatBinsMargin is more than that and the margin of grid.h together.
inline constexpr float kFloatBinsMargin = 0x1p-10f;
PADDER_HD float search_radius(const Grid& grid, const LevelBins& bins, int from, int at, double r) {
  const Level& l = grid.level[at];
  const FloatBins& b = bins.level[at];
  const bool in_float = bins.on && b.size == 0;  // those of a hashed level are the bins of grid.h
  r = smaller(r + l.grown_by, grid.level[from].radius_max) + l.radius_max;
  return ::fmaf(static_cast<float>(r * (in_float ? static_cast<double>(b.per_size[0]) : l.per_size)),
                kSearchRadiusFactor, in_float ? kFloatBinsMargin : kSearchRadiusMargin);
}

PADDER_HD bool float_bin(float x, float origin, float per_size, std::uint32_t count, std::uint32_t& bin) {
  const float t = (x - origin) * per_size;
  bin = static_cast<std::uint32_t>(static_cast<int>(t));
  if (bin >= count) bin = count - 1;
  return t >= 0 && t < static_cast<float>(count) + 0.5f;
}
PADDER_HD std::uint32_t hashed_key(const FloatBins& b, float x, float y, float z) {
  const auto bin = [&](float v) {
    return static_cast<std::uint32_t>(float_split(v, b.size, b.per_size[0]).bin);
  };
  return b.first + ((bin(x) + bin(y) * b.row + bin(z) * b.plane) & b.mask);
}
// False for a sphere outside the bins; its key is then that of some bin.
PADDER_HD bool dense_key_of(const FloatBins& b, float x, float y, float z, std::uint32_t& key) {
  std::uint32_t i, j, k;
  const bool in = float_bin(x, b.origin[0], b.per_size[0], b.count[0], i) &
                  float_bin(y, b.origin[1], b.per_size[1], b.count[1], j) &
                  float_bin(z, b.origin[2], b.per_size[2], b.count[2], k);
  key = (k + 1) * b.plane + (j + 1) * b.row + i + b.first;
  return in;
}
PADDER_HD bool key_of(const FloatBins& b, float x, float y, float z, std::uint32_t& key) {
  if (b.size == 0) return dense_key_of(b, x, y, z, key);
  key = hashed_key(b, x, y, z);
  return true;
}
PADDER_HD bool key_of(const FloatBins& b, const float4& s, std::uint32_t& key) {
  return key_of(b, s.x, s.y, s.z, key);
}
__host__ __device__ __forceinline__ int level_of(const LevelBins& g, const float4& s) {
  return g.level_of_octave[octave_of_exponent(g.top, need_exponent(s.x, s.y, s.z, s.w))];
}
__host__ __device__ __forceinline__ bool key_of(const LevelBins& g, const float4& s, std::uint32_t& key) {
  return key_of(g.level[level_of(g, s)], s, key);
}

PADDER_HD int level_of_key(const Grid& g, std::uint32_t key) {
  int level = 0;
  while (level + 1 < g.levels && key >= g.level[level + 1].offset) level++;
  return level;
}

// The bins may be those of the previous call (speculative_call.h): a sphere outside them is reported.
__device__ __forceinline__ std::uint32_t key_of_sphere(const Sphere& s, const Grid& grid,
                                                       Counters* counters) {
  const Level& l = grid.level[level_of(grid, s)];
  const Bin b = bin_of(l, s);
  if (!l.hashed && !(static_cast<std::uint64_t>(b.x - l.first[0]) < l.count[0] &&
                     static_cast<std::uint64_t>(b.y - l.first[1]) < l.count[1] &&
                     static_cast<std::uint64_t>(b.z - l.first[2]) < l.count[2])) {
    atomicOr(&counters->flags, kOutside);
    return 0;
  }
  return key_of(l, b);
}
template <class Bins>
__device__ __forceinline__ std::uint32_t key_of_sphere(const Sphere& s, const Bins& bins,
                                                       Counters* counters) {
  std::uint32_t key;
  if (!key_of(bins,
              make_float4(static_cast<float>(s.x), static_cast<float>(s.y), static_cast<float>(s.z),
                          static_cast<float>(s.r)),
              key))
    atomicOr(&counters->flags, kOutside);
  return key;
}

}  // namespace padder::detect::cuda
