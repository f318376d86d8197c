// SPDX-License-Identifier: MIT
// The bins of a dense level in float: the description that kernels are given, and the formats of a slot.
// bins.h makes them and computes keys. Internal; only .cu files include this.
#pragma once
#include <type_traits>

#include "detect/core/grid.h"

namespace padder::detect::cuda {

// What a slot holds: the 16 bytes that the search reads of a sphere. Equal: x, y, z in float and the sphere's
// number, where all radii are one. Unequal: x, y, z, r in float. Fixed point: x, y, z as integers in units of
// the level (grid.h) and r in float, for input in double and for bodies.
enum class SlotKind : std::uint8_t { equal, unequal, fixed_point };
// Calls f with the kind as a constant.
template <class F>
void with_kind(SlotKind kind, F f) {
  if (kind == SlotKind::equal) f(std::integral_constant<SlotKind, SlotKind::equal>{});
  if (kind == SlotKind::unequal) f(std::integral_constant<SlotKind, SlotKind::unequal>{});
  if (kind == SlotKind::fixed_point) f(std::integral_constant<SlotKind, SlotKind::fixed_point>{});
}

// The bins of one level, computed in float (bins.h) where float is exact enough. Keys then follow from the
// slots and are never stored.
inline constexpr std::int64_t kMostHashedFloatBins = 1 << 22;  // from the origin, of a hashed level
struct FloatBins {
  float origin[3] = {0, 0, 0}, per_size[3] = {0, 0, 0};
  std::uint32_t count[3] = {1, 1, 1}, row = 0, plane = 0, buckets = 0;  // keys of a row, a plane and in all
  std::uint32_t first = 1;                                              // key of bin (0, -1, -1)
  std::uint32_t fine = 1;    // bins along x that make up one of the level's: a row of candidates is shorter
  float units = 0;           // of codes.h, a length
  float grown_by = 0;        // Level::grown_by
  float size = 0;            // a bin's edge, of a hashed level; 0: the level is dense
  std::uint32_t mask = ~0u;  // buckets of the ring less one, of a hashed level
  bool on = false;
};
// The same for several levels. Keys are numbered as in grid.h, but a sphere's bin need not be that of
// grid.h.
struct LevelBins {
  FloatBins level[kMaxLevels];
  std::int32_t top = 0;
  std::uint8_t level_of_octave[kOctaves] = {};
  bool on = false;
};

}  // namespace padder::detect::cuda
