// SPDX-License-Identifier: MIT
// Where a sphere belongs: levels by size, bins of a level, keys of bins. Host and device; only choose_grid is
// host code. One sphere is in one bin, that of its centre (the owner bin). Every length is exact: a bin's
// edge has 10 significant bits and a bin number at most 43, so that their product, a bin's corner, is a
// double without rounding.
#pragma once
#include <cstddef>
#include <span>

#include "detect/contact.h"

namespace padder::detect {

inline constexpr int kMaxLevels = 12, kOctaves = 64;
inline constexpr int kUnitBits =
    24;  // fixed-point units of a bin's edge: places are known modulo 2^(32 - 24) bins

// A bin by its place in a level.
struct Bin {
  std::int64_t x, y, z;
};

// Bins of one size. Dense: bins first to first + count - 1 on each axis, numbered x fastest, with an empty
// border of one bin so that a neighbour's number needs no test. Hashed, where that would be too many: a row
// (y, z) begins at a hashed place of a ring of `ring` buckets and runs on along x. Then a bucket holds
// spheres of unrelated bins, and a candidate counts only when its own bin is the one that was meant (in_row).
struct Level {
  double size = 1, per_size = 1, units = 1;  // a bin's edge, about 1 / size, 2^24 / size
  double radius_max = 0;                     // of its spheres, or more; size >= 2 radius_max
  std::uint32_t hashed = 0;
  std::int64_t first[3] = {0, 0, 0};
  std::uint32_t count[3] = {1, 1, 1};
  std::uint32_t ring = 1;                 // a power of two
  std::uint32_t offset = 0, buckets = 1;  // its keys are offset to offset + buckets - 1
  std::uint64_t spheres = 0;              // as many as the summary has
  friend bool operator==(const Level&, const Level&) = default;
};

// Levels from the finest to the coarsest. A sphere looks for partners at its own level and, as the backend
// likes, at the coarser ones (up) or at the finer ones (down).
struct Grid {
  std::int32_t levels = 1;
  std::int32_t top = 0;  // exponent of the largest need
  std::uint8_t level_of_octave[kOctaves] = {};
  double magnitude_share = 0;  // see need_of
  std::uint32_t buckets = 1;   // of all levels; keys need bits_for(buckets) bits
  Level level[kMaxLevels];
  friend bool operator==(const Grid&, const Grid&) = default;
};

// The bin edge a sphere asks for: its diameter and a little, so that two touching spheres of one level are
// never more than one bin apart, and no less than keeps its bin numbers below 2^43 (one sphere at 1e30 does
// not spoil the bins of the others: it moves to a coarser level).
PADDER_HD double need_of(const Sphere& s) {
  const double m = larger(larger(magnitude(s.x), magnitude(s.y)), magnitude(s.z));
  return larger(2 * s.r * (1 + 0x1p-20), m * 0x1p-42);
}

// floor(log2(need)), -1023 for zero and denormals.
PADDER_HD int exponent_of(double need) {
  std::uint64_t bits;
  memcpy(&bits, &need, sizeof bits);
  return static_cast<int>(bits >> 52 & 0x7ff) - 1023;
}
PADDER_HD int octave_of_exponent(int top, int exponent) {
  const int below = top - exponent;
  return below < 0 ? 0 : below < kOctaves ? below : kOctaves - 1;
}
PADDER_HD int octave_of(int top, double need) { return octave_of_exponent(top, exponent_of(need)); }
PADDER_HD int level_of(const Grid& g, const Sphere& s) {
  return g.levels == 1 ? 0 : g.level_of_octave[octave_of(g.top, need_of(s))];
}

// The bin number, floor(x / size) exactly, and what is left, x - bin * size, 0 <= rest <= size. For |x| <=
// 2^43 size. The floor never decreases with x: what lies between two coordinates lies between their bins.
//   Corners b * size are exact. The rounded quotient is off by less than 2^-8, or it underflows to 0, so
//   b is at most one off. A difference has the sign of the exact one even when it is rounded, so rest < 0
//   says that b is one too high, whatever the size of x. If b is one too low then rest >= size, rounded or
//   not. If b is right, the difference is exact for b >= 1 and b <= -2 (Sterbenz: x and b * size are within a
//   factor of two) and for b = 0, and so rest < size; in bin -1 it may be rounded up to size, from -1e-20 for
//   one. But there b is never one too low: the quotient is negative and so is x. A rest of `size` is off by
//   at most 2^-53 of it, as any rest in that bin.
// floor and not a cast: -0.5 is in bin -1.
struct Split {
  std::int64_t bin;
  double rest;
};
PADDER_HD Split split(const Level& l, double x) {
  double b = whole_below(mul(x, l.per_size));
  double rest = sub(x, mul(b, l.size));
  if (rest < 0)
    b -= 1, rest = sub(x, mul(b, l.size));
  else if (rest >= l.size && b != -1)
    b += 1, rest = sub(x, mul(b, l.size));
  return {static_cast<std::int64_t>(b), rest};
}
PADDER_HD Bin bin_of(const Level& l, const Sphere& s) {
  return {split(l, s.x).bin, split(l, s.y).bin, split(l, s.z).bin};
}

// Key of bin (0, y, z), such that key_in_row(l, row, x) is the key of (x, y, z). Unsigned arithmetic wraps on
// purpose.
PADDER_HD std::uint32_t row_of(const Level& l, std::int64_t y, std::int64_t z) {
  if (l.hashed)
    return static_cast<std::uint32_t>(
        mixed(mixed(static_cast<std::uint64_t>(y)) + static_cast<std::uint64_t>(z)));
  const auto row = static_cast<std::uint32_t>(z - l.first[2] + 1) * (l.count[1] + 2) +
                   static_cast<std::uint32_t>(y - l.first[1] + 1);
  return l.offset + row * (l.count[0] + 2) + 1 - static_cast<std::uint32_t>(l.first[0]);
}
PADDER_HD std::uint32_t key_in_row(const Level& l, std::uint32_t row, std::int64_t x) {
  const std::uint32_t key = row + static_cast<std::uint32_t>(x);
  return l.hashed ? l.offset + (key & (l.ring - 1)) : key;
}
PADDER_HD std::uint32_t key_of(const Level& l, const Bin& b) {
  return key_in_row(l, row_of(l, b.y, b.z), b.x);
}

// Cuts the bins x_low to x_high of row (y, z) to those that exist; false when none does. At a sphere's own
// level the border makes this needless; a finer sphere may stand outside the bounds of a coarser level.
PADDER_HD bool cut_row(const Level& l, std::int64_t& x_low, std::int64_t& x_high, std::int64_t y,
                       std::int64_t z) {
  if (l.hashed) return true;
  if (y < l.first[1] || y >= l.first[1] + l.count[1] || z < l.first[2] || z >= l.first[2] + l.count[2])
    return false;
  if (x_low < l.first[0]) x_low = l.first[0];
  if (x_high >= l.first[0] + l.count[0]) x_high = l.first[0] + l.count[0] - 1;
  return x_low <= x_high;
}

// Hashed levels only, asked of a candidate that passed the filter: is its bin one of those that were meant?
// Two rows may share buckets; without this a pair could be found twice, or with a distance that wrapped
// around.
PADDER_HD bool in_row(const Level& l, const Sphere& s, std::int64_t x_low, std::int64_t x_high,
                      std::int64_t y, std::int64_t z) {
  const Bin b = bin_of(l, s);
  return b.y == y && b.z == z && x_low <= b.x && b.x <= x_high;
}

// The bins of level l that a sphere of radius r may find partners in, from the remainders of its coordinate:
// -1 to +1.
struct Reach {
  int low, high;
};
PADDER_HD Reach reach_of(const Level& l, const Split& s, double r) {
  const double reach = (r + l.radius_max) * (1 + 0x1p-20);
  return {s.rest < reach ? -1 : 0, s.rest + reach >= l.size ? 1 : 0};
}

// A sphere as the fixed-point slot of level l: position modulo 256 bins, off by at most half a unit and a
// hair.
PADDER_HD std::int32_t fixed_point_of(const Level& l, const Split& s) {
  const auto q = static_cast<std::uint64_t>(s.bin) << kUnitBits;
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(
      q + static_cast<std::uint64_t>(whole_below(add(mul(s.rest, l.units), 0.5)))));
}
PADDER_HD FixedPointSlot fixed_point_slot(const Level& l, const Sphere& s) {
  return {fixed_point_of(l, split(l, s.x)), fixed_point_of(l, split(l, s.y)),
          fixed_point_of(l, split(l, s.z)), static_cast<float>(mul(s.r, l.units))};
}
PADDER_HD FloatSlot float_slot(const Sphere& s) {
  return {static_cast<float>(s.x), static_cast<float>(s.y), static_cast<float>(s.z), static_cast<float>(s.r)};
}

PADDER_HD int bits_for(std::uint32_t buckets) {
  int bits = 0;
  while (bits < 32 && (buckets - 1) >> bits) bits++;
  return bits;
}

// What a first pass over the spheres finds; each backend fills it in its own way. Bounds may be wider than
// the truth.
struct Summary {
  // The spheres whose sizes share a power of two.
  struct Octave {
    std::uint64_t count = 0;
    double need_max = 0, radius_max = 0;
    double low[3] = {INFINITY, INFINITY, INFINITY},
           high[3] = {-INFINITY, -INFINITY, -INFINITY};  // of centres
  };
  std::uint64_t count = 0;
  double need_max = 0, radius_max = 0, radius_min = INFINITY, radius_sum = 0,
         extent = 0;  // extent: largest |coordinate|
  double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
  std::uint64_t first_fault = ~std::uint64_t(0);  // index of the first sphere with a fault
  // By octave of need below `above` octaves under exponent_of(need_max): octave 0 holds what is larger, too,
  // and the last what is smaller. Octave 0 holds everything when need varies by less than one octave: a
  // backend may then skip the second pass and leave this to choose_grid.
  bool octaves_known = false;
  int above = 0;
  Octave octave[kOctaves];
};

// Host. Where need varies by more than kOctaves octaves: the best Summary::above, given how many spheres
// there are of each exponent_of(need) + 1023. One ball of 1e25 would else put all others, however they
// differ, into the last octave, and so into one level, with bins for the largest of them.
inline constexpr int kExponents = 2047;
int octaves_above(std::span<const std::uint64_t, kExponents> of_exponent);

// Host. Merges octaves into the levels that cost least and lays out their bins: dense up to about
// `bins_per_sphere` bins a sphere, hashed beyond. `bin_size` raises the edge of the finest bins; 0 chooses.
// Never more than 2^32 buckets.
enum class Look { up, down, either };
bool needs_octaves(const Summary& s);
Summary with_octaves(const Summary& s);
Grid choose_grid(const Summary& s, double bin_size, double bins_per_sphere = 8, Look look = Look::up);
// Host. What it costs, on a CPU, that a sphere of `from` looks at level `at`: some nanoseconds, good for
// comparing.
double look_cost(const Level& from, const Level& at);

}  // namespace padder::detect
