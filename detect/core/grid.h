// SPDX-License-Identifier: MIT
// Where a sphere belongs: its level by its size, its bin (cell) by its centre, and the key of that bin. A
// sphere is in one bin only, its owner bin. For host and device, except for what is marked as host code.
//
// The corners of the bins are exact: a bin's edge has 10 significant bits and a bin number at most 43, so
// their product is a double without rounding.
#pragma once
#include <cstddef>
#include <memory>
#include <span>

#include "detect/contact.h"

namespace padder::detect {

inline constexpr int kMaxLevels = 12, kOctaves = 64;
// The most bins along an axis of a dense level that bins in float can tell apart (detect/cuda/order/bins.h).
inline constexpr std::uint32_t kMostFloatBins = 4096;
inline constexpr int kUnitBits =
    24;  // a bin's edge is 2^24 fixed-point units, so a 32-bit place is known modulo 2^8 bins

// The numbers of a bin along the axes.
struct Bin {
  std::int64_t x, y, z;
};

// Bins of one size.
//
// A dense level has a bucket for each bin from `first` to `first + count - 1` on each axis. They are numbered
// with x fastest. A border of one empty bin surrounds them, so the number of a neighbour needs no test.
//
// A hashed level has too many bins for that. Its hash is linear: bin (x, y, z) has bucket
// x + y * row + z * plane of a ring of `ring` buckets. So a row of bins lies side by side in the ring, as in
// a dense level, and a neighbouring row lies at the same distance for every bin. A bucket then holds spheres
// of unrelated bins, too. `first` and `count` of a hashed level are wide, so that they seldom change, but not
// along an axis with few bins (bounded()): where spheres lie in a plane, those of other levels would reach
// many rows beside it, and meet unrelated spheres there.
//
// The bins of a cube of `side` bins have buckets of their own. So a search through no more than that meets
// each candidate once, and need not ask for its bin. A wider search counts a candidate only if its own bin is
// the one that is searched (in_row).
struct Level {
  double size = 1, per_size = 1, units = 1;  // a bin's edge; about 1 / size; 2^24 / size
  double radius_max = 0;                     // no sphere of the level is larger; size >= 2 radius_max
  double grown_by = 0;  // Summary::grown_by; `size` and radius_max are of spheres that are so much larger
  std::uint32_t hashed = 0;
  std::int64_t first[3] = {0, 0, 0};
  std::uint32_t count[3] = {1, 1, 1};
  std::uint32_t ring = 1;                      // a power of two
  std::uint32_t row = 0, plane = 0, side = 0;  // of the hash; 0 where the level is dense
  std::uint32_t offset = 0, buckets = 1;       // its keys are offset to offset + buckets - 1
  std::uint64_t spheres = 0;                   // no more than so many, and not many fewer (choose_grid())
  double filled = 1;                           // the part of the bins that lies within the spheres' bounds
  double least_filled = 1;  // the same, if those that lie across a face of the bins all go to one side of it
  friend bool operator==(const Level&, const Level&) = default;
};

// All levels, from the finest to the coarsest. Each sphere searches its own level. Of two levels, the spheres
// of one search the other: the finer ones or the coarser ones, as the backend decides.
struct Grid {
  std::int32_t levels = 1;
  std::int32_t top = 0;  // octave 0 holds the needs of this exponent and larger ones
  std::uint8_t level_of_octave[kOctaves] = {};
  std::uint32_t buckets = 1;  // of all levels together; a key needs bits_for(buckets) bits
  Level level[kMaxLevels];
  friend bool operator==(const Grid&, const Grid&) = default;
};

// The bin edge that a sphere needs. It is a little more than the diameter, so that two touching spheres of
// one level are never more than one bin apart. For a sphere far from the origin it is larger, so that bin
// numbers stay below 2^43: a sphere at 1e30 goes to a coarser level and leaves the bins of the others as they
// are.
PADDER_HD double need_of(const Sphere& s) {
  const double m = larger(larger(magnitude(s.x), magnitude(s.y)), magnitude(s.z));
  return larger(2 * s.r * (1 + 0x1p-20), m * 0x1p-42);
}

// floor(log2(need)); -1023 for zero and denormal numbers.
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

// The bin number of a coordinate, exactly floor(x / size), and the remainder x - bin * size, 0 <= rest <=
// size. Valid for |x| <= 2^43 size. The bin number never decreases when x grows, so what lies between two
// coordinates lies between their bins. (A cast instead of floor would put -0.5 into bin 0 instead of bin -1.)
//
// Proof. Let b be the number computed first. Its corner b * size is exact. The rounded quotient is off by
// less than 2^-8, or it underflows to 0, so b is off by at most one. A rounded difference has the sign of the
// exact one, so rest < 0 says that b is one too high, however large x is. If b is one too low, then rest >=
// size, rounded or not.
//
// If b is right and b >= 1 or b <= -2, the difference is exact (Sterbenz: x and b * size differ by at most a
// factor of two); for b = 0 it is x itself. So rest < size. In bin -1 the difference may be rounded up to
// `size`, for instance for x = -1e-20. But there b is never one too low, because the quotient and x are both
// negative, so the second test leaves that bin alone. A rest of `size` is off by at most 2^-53 size, as any
// rest in that bin.
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

// A number for row (y, z) of bins, such that key_in_row(l, row, x) is the key of bin (x, y, z). Unsigned
// arithmetic wraps on purpose.
PADDER_HD std::uint32_t row_of(const Level& l, std::int64_t y, std::int64_t z) {
  if (l.hashed) return static_cast<std::uint32_t>(y) * l.row + static_cast<std::uint32_t>(z) * l.plane;
  const auto row = static_cast<std::uint32_t>(z - l.first[2] + 1) * (l.count[1] + 2) +
                   static_cast<std::uint32_t>(y - l.first[1] + 1);
  return l.offset + row * (l.count[0] + 2) + 1 - static_cast<std::uint32_t>(l.first[0]);
}
PADDER_HD std::uint32_t key_in_row(const Level& l, std::uint32_t row, std::int64_t x) {
  const std::uint32_t key = row + static_cast<std::uint32_t>(x);
  return l.hashed ? l.offset + (key & (l.ring - 1)) : key;
}
// Is there a last bin along this axis beyond which a search need not look?
inline constexpr std::uint32_t kMostBoundedBins = 64;  // of a hashed level; balls rarely reach farther
PADDER_HD bool bounded(const Level& l, int axis) { return !l.hashed || l.count[axis] <= kMostBoundedBins; }

PADDER_HD std::uint32_t key_of(const Level& l, const Bin& b) {
  return key_in_row(l, row_of(l, b.y, b.z), b.x);
}

// Is the bin of this candidate one of the bins x_low to x_high of row (y, z)? Asked on hashed levels only,
// where two rows of a wide search may share buckets. Without the question a pair could be found twice, or by
// a fixed-point distance that wrapped.
PADDER_HD bool in_row(const Level& l, const Sphere& s, std::int64_t x_low, std::int64_t x_high,
                      std::int64_t y, std::int64_t z) {
  const Bin b = bin_of(l, s);
  return b.y == y && b.z == z && x_low <= b.x && b.x <= x_high;
}

// A sphere that searches a finer level computes its search radius in bins of that level, in float. This
// factor and this margin enlarge the radius by twice what can be rounded away, so that no partner is missed.
inline constexpr float kSearchRadiusFactor = 1 + 0x1p-16f, kSearchRadiusMargin = 0x1p-14f;

// A coordinate and a sphere as fixed-point slots of level l: the position is known modulo 256 bins, and is
// off by at most half a unit and a rounding of double.
PADDER_HD std::int32_t fixed_point_of(const Level& l, const Split& s) {
  const auto q = static_cast<std::uint64_t>(s.bin) << kUnitBits;
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(
      q + static_cast<std::uint64_t>(whole_below(add(mul(s.rest, l.units), 0.5)))));
}
// The slot's radius is that of the grown sphere.
PADDER_HD FixedPointSlot fixed_point_slot(const Level& l, const Sphere& s) {
  return {fixed_point_of(l, split(l, s.x)), fixed_point_of(l, split(l, s.y)),
          fixed_point_of(l, split(l, s.z)), static_cast<float>(mul(add(s.r, l.grown_by), l.units))};
}
PADDER_HD FloatSlot float_slot(const Sphere& s) {
  return {static_cast<float>(s.x), static_cast<float>(s.y), static_cast<float>(s.z), static_cast<float>(s.r)};
}

PADDER_HD int bits_for(std::uint32_t buckets) {
  int bits = 0;
  while (bits < 32 && (buckets - 1) >> bits) bits++;
  return bits;
}

struct Neighbourhood;  // detect/core/neighbourhood.h

// What a first pass over the spheres finds. Each backend fills it in its own way. Bounds may be wider than
// the spheres are, but not narrower.
struct Summary {
  // The spheres whose needs have the same power of two.
  struct Octave {
    std::uint64_t count = 0;
    double need_max = 0, radius_max = 0;
    double low[3] = {INFINITY, INFINITY, INFINITY},
           high[3] = {-INFINITY, -INFINITY, -INFINITY};  // bounds of the centres
  };
  std::uint64_t count = 0;
  double need_max = 0, radius_max = 0, radius_min = INFINITY, radius_sum = 0;
  double extent = 0;  // the largest |coordinate|
  // By how much each sphere counts as larger when partners are looked for: half of CallOptions::margin, and
  // what rounding may have moved it by. The octaves, the needs and the radii here are those of the spheres as
  // they are.
  double grown_by = 0;
  double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
  std::uint64_t first_fault = ~std::uint64_t(0);  // index of the first sphere with a fault
  // Octave 0 begins `above` octaves below exponent_of(need_max). It also holds everything larger, and the
  // last octave everything smaller. If the needs vary by less than one octave, octave 0 holds all spheres; a
  // backend may then skip the second pass, which counts the octaves, and leave this to with_octaves().
  bool octaves_known = false;
  int above = 0;
  Octave octave[kOctaves];
  // How near spheres lie to each other. Only if the octaves are known; a backend may leave it out. Summaries
  // are copied often.
  std::shared_ptr<const Neighbourhood> near;
};
// Host code. The best value of Summary::above if the needs vary by more than kOctaves octaves.
// `of_exponent[e]` is the number of spheres with exponent_of(need) + 1023 == e. Without this, one ball of
// radius 1e25 would put all other spheres into the last octave, and so into one level with bins for the
// largest of them.
inline constexpr int kExponents = 2047;
int octaves_above(std::span<const std::uint64_t, kExponents> of_exponent);

// Host code. Do the sizes vary so much that the octaves must be counted?
bool needs_octaves(const Summary& s);
// Host code. The summary with all spheres in octave 0 if its octaves were not counted.
Summary with_octaves(const Summary& s);

// Which processor searches: levels are chosen by its costs, and a GPU wants bins in float.
enum class Processor { cpu, gpu };
// Host code. The hash of a ring of 2^bits buckets. It spreads boxes, planes and lines of bins evenly.
struct Hash {
  std::uint32_t row, plane, side;
};
inline constexpr int kLeastRingBits = 10, kMostRingBits = 28;
Hash hash_of_ring(int bits);

// How far a dense level's bins go beyond the bounds of its spheres. Tight: not at all. Stepped: to multiples
// of some bins, so that bounds which move a little seldom change the grid. Wide: by some bins on each side,
// so that the grid serves spheres that move (covers()). Level::spheres goes in steps likewise, so that a few
// spheres more or less seldom change the grid; of tight bounds it is the number.
enum class GridBounds { tight, stepped, wide };

// Host code. Merges octaves into the levels that cost least to search on that processor, and lays out their
// bins: dense up to about `bins_per_sphere` bins for each sphere (0: none), hashed beyond. `bin_size` is a
// lower bound for the edge of the finest bins; 0: none. There are never more than 2^32 buckets.
Grid choose_grid(const Summary& s, double bin_size, double bins_per_sphere = 8,
                 Processor processor = Processor::cpu, GridBounds bounds = GridBounds::tight);
// Host code. Does the grid serve these spheres? Each has a level whose bins are wide enough for it, and lies
// within the level's bounds. The grid need not be the one that choose_grid() would choose.
bool covers(const Grid& grid, const Summary& s);
// Host code. Do the grids differ in how many spheres their levels have, at most? Then they have the same
// order.
bool have_same_bins(Grid a, const Grid& b);
// Host code. What the summary may be if there are so many spheres, of the same sizes at the same places.
Summary with_count(const Summary& given, std::uint64_t count);
// Host code. What the summary of the next call may be, if the spheres go on moving as they did from `before`
// to `now`, at up to twice the speed.
Summary expected_next(const Summary& before, const Summary& now);
// Host code. The same at exactly that speed.
Summary going_on(const Summary& before, const Summary& now);
// Host code. The bounds of a level's bins along an axis.
inline double low_of(const Level& l, int axis) { return static_cast<double>(l.first[axis]) * l.size; }
inline double high_of(const Level& l, int axis) {
  return static_cast<double>(l.first[axis] + static_cast<std::int64_t>(l.count[axis])) * l.size;
}
// Host code. Do the bounds of two levels lie so far from each other that none of their spheres touch?
bool lie_apart(const Level& a, const Level& b);
// Host code. What it costs on a CPU that a sphere of level `from` searches level `at`: nanoseconds, good
// enough to compare two ways. `probed`: ProbedLevels::in_bin(at, from).
double coarse_to_fine_cost(const Level& from, const Level& at, double probed = 0);
double fine_to_coarse_cost(const Level& from, const Level& at, double probed = 0);

}  // namespace padder::detect
