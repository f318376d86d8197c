// SPDX-License-Identifier: MIT
// Lays out the bins of the levels on the host, from the summary of the spheres that a backend has made.
#include "detect/core/grid.h"

#include <algorithm>
#include <bit>
#include <vector>

#include "detect/core/levels.h"

namespace padder::detect {
namespace {

// The smallest number with 10 significant bits that is not below x. Its products with bin numbers up to 2^43
// are exact.
double rounded_up(double x) {
  int exponent;
  const double fraction = std::frexp(std::max(x, 0x1p-900), &exponent);
  return std::ldexp(std::ceil(fraction * 1024) / 1024, exponent);
}

// With the octaves of the grown spheres.
Summary grown(const Summary& given) {
  Summary s = with_octaves(given);
  for (Summary::Octave& o : s.octave) {
    if (o.count == 0) continue;
    o.need_max += 2 * s.grown_by * (1 + 0x1p-20), o.radius_max += s.grown_by;
  }
  return s;
}

void set_ring(Level& l, int bits) {
  bits = std::clamp(bits, kLeastRingBits, kMostRingBits);
  const Hash hash = hash_of_ring(bits);
  l.ring = l.buckets = 1u << bits, l.row = hash.row, l.plane = hash.plane, l.side = hash.side;
}
// The rings of hashed levels grow until coarser spheres can search them by the cube, where that is possible
// within some bounds.
void widen_rings(Grid& g, std::uint64_t spheres) {
  const int most = std::min(static_cast<int>(std::bit_width(8 * spheres)) + 1, kMostRingBits);
  for (int fine = 0; fine < g.levels; fine++) {
    Level& l = g.level[fine];
    if (!l.hashed) continue;
    const double reach = (g.level[g.levels - 1].radius_max + l.radius_max) * l.per_size;
    int bits = static_cast<int>(std::bit_width(l.ring)) - 1;
    while (bits <= most && 2 * reach + 4 > hash_of_ring(bits).side) bits++;
    if (bits <= most) set_ring(l, bits);
  }
}

// The edge of the bins of one of several levels, which needs `size`. Where there are 3.3 to 8 bins for each
// sphere, the table of bins is longer than the list of spheres, and coarser spheres visit empty rows. Then
// the edge is up to 1.26 times as long, in steps, so that it seldom changes while spheres move. No longer:
// spheres may lie in a small part of their bounds, and bins in float (bins.h) rely on spheres that reach a
// bin far. Where probes say that they do, it stays: with 1.26 times the edge bins hold twice as many.
double size_of_sparse(const Summary::Octave& all, double size, double probed) {
  const double density = density_of(all, size), emptier = 0.3 / density;
  if (emptier < 1 || emptier > 0.3 * 8 || probed > 2 * density) return size;
  return rounded_up(size * std::exp2(std::floor(2 * std::log2(emptier)) / 6));
}

// Level::spheres of so many. Steps of one of several levels are coarser: how many spheres it will have in the
// next call is known for all levels together.
std::uint64_t most_spheres(std::uint64_t count, bool alone, GridBounds bounds) {
  if (bounds == GridBounds::tight) return count;
  const std::uint64_t step = std::max<std::uint64_t>(std::bit_floor(count) / (alone ? 64 : 16), 4),
                      more = bounds == GridBounds::wide ? step / 2 : 0;
  return (count + more + step - 1) / step * step;
}

// What Level::count of a hashed level says of more bins, too. They then have no bounds.
constexpr std::uint32_t kMostHashedBins = 0x7fffffff;

// The last bin of a sphere that lies no higher. On a hashed level, bins in float may count what is just below
// a face as above it (detect/cuda/order/bins.h).
std::int64_t last_bin(const Level& l, double high) {
  const Split s = split(l, high);
  return s.bin + (l.hashed && s.rest > l.size * (1 - 0x1p-20));
}

// The bounds and buckets of a level. It is hashed if it would have more than `most` bins, or more than
// `most_along` along an axis. least_step: of stepped bounds, in bins.
void lay_out(Level& l, const Summary::Octave& all, double most, std::int64_t most_along, GridBounds bounds,
             std::uint64_t least_step) {
  double bins = 1, within = 1;
  std::int64_t longest = 0;
  l.filled = l.least_filled = 1;
  for (int k = 0; k < 3; k++) {
    std::int64_t low = split(l, all.low[k]).bin, high = split(l, all.high[k]).bin;
    const std::int64_t wide = high - low + 1;
    std::int64_t filled = wide;
    double least_filled = std::min(std::floor((all.high[k] - all.low[k]) / l.size) + 1.0, double(wide));
    within *= static_cast<double>(wide + 2), longest = std::max(longest, wide);
    if (bounds == GridBounds::stepped) {
      const auto step = static_cast<std::int64_t>(
          std::max(std::bit_floor(static_cast<std::uint64_t>(wide / 32 + 1)), least_step));
      // Steps do not begin at 0, where the walls of many scenes stand.
      low = ((low + step / 2) & -step) - step / 2, high = ((high + step / 2) | (step - 1)) - step / 2;
      // The middle of what it may be: it must not change more often than the bounds.
      filled = high - low + 1 - (step - 1);
      least_filled = static_cast<double>(filled);
    } else if (bounds == GridBounds::wide) {
      // By half a bin where there are few: beside spheres that lie in a plane, each bin is a row more for
      // those of other levels.
      const std::int64_t more = std::min<std::int64_t>(wide / 4, 2) + wide / 32;
      low = split(l, all.low[k] - l.size / 2).bin - more,
      high = split(l, all.high[k] + l.size / 2).bin + more;
    }
    l.first[k] = low;
    l.count[k] = static_cast<std::uint32_t>(std::min<std::int64_t>(high - low + 1, 0x7fffffff));
    bins *= static_cast<double>(high - low + 3);
    l.filled *= static_cast<double>(filled) / static_cast<double>(high - low + 1);
    l.least_filled *= least_filled / static_cast<double>(high - low + 1);
  }
  if (within <= most && longest <= most_along && bins <= 0x1p31) {
    l.buckets = static_cast<std::uint32_t>(bins);
    return;
  }
  l.filled = l.least_filled = 1;
  l.hashed = 1;
  set_ring(l, static_cast<int>(std::bit_width(2 * all.count - 1)));
  std::int64_t far = 1;
  for (int k = 0; k < 3; k++)
    far = std::max({far, std::abs(split(l, all.low[k]).bin), std::abs(last_bin(l, all.high[k]))});
  const auto wide = static_cast<std::int64_t>(std::bit_ceil(static_cast<std::uint64_t>(far) + 1));
  for (int k = 0; k < 3; k++) {
    const std::int64_t count = std::max<std::int64_t>(l.count[k], last_bin(l, all.high[k]) + 1 - l.first[k]);
    if (count <= kMostBoundedBins) {
      l.count[k] = static_cast<std::uint32_t>(count);
    } else {
      // These bounds matter little. They are wide, so that they stay the same while spheres move.
      l.first[k] = -wide;
      l.count[k] = static_cast<std::uint32_t>(
          std::clamp<std::int64_t>(2 * wide, kMostBoundedBins + 1, kMostHashedBins));
    }
  }
}

}  // namespace

// Found by trying random factors, up to a minute for each ring. The bins that share a bucket are a lattice,
// whose points should not be near each other, however that is measured:
//
// The cubes whose bins have buckets of their own are within a fifth of the largest that were found.
//
// The product of the distances along the axes, with 1 for a distance of 0, is large (Zaremba's index; S. K.
// Zaremba, "Good lattice points, discrepancy, and numerical integration", 1966). So boxes, planes and lines
// of bins fill the ring evenly. With factors that were chosen by cubes alone, a square layer of 2^22 bins
// filled an 18th of a ring of 2^23, not two fifths.
//
// From 2^21 buckets on, neighbouring rows are near each other in the ring: `row` is between 2^14 and 2^15
// times the root of ring / 2^21, and `plane` between 3 and 4 times `row`. A search through the spheres in the
// order of the ring reads each row five times within a short while, and the caches still have it. A smaller
// ring fits in them as a whole.
Hash hash_of_ring(int bits) {
  static constexpr Hash kHash[] = {
      {445, 389, 8},         {711, 1239, 11},       {1661, 1803, 14},     {7343, 1115, 18},
      {7623, 3131, 22},      {12719, 23777, 28},    {17437, 6727, 37},    {16173, 110781, 46},
      {220155, 140819, 56},  {361641, 278681, 69},  {885573, 124769, 88}, {22137, 79389, 104},
      {32693, 116313, 127},  {46893, 167191, 167},  {65009, 232611, 207}, {93227, 331845, 248},
      {129119, 461905, 323}, {181165, 647683, 429}, {266691, 953071, 523}};
  return kHash[bits - kLeastRingBits];
}

Summary with_octaves(const Summary& given) {
  Summary s = given;
  if (s.octaves_known) return s;
  Summary::Octave& o = s.octave[0];
  o.count = s.count, o.need_max = s.need_max, o.radius_max = s.radius_max;
  std::copy_n(s.low, 3, o.low), std::copy_n(s.high, 3, o.high);
  return s;
}

bool needs_octaves(const Summary& s) { return s.count > 0 && s.need_max > 4 * s.radius_min; }

int octaves_above(std::span<const std::uint64_t, kExponents> of_exponent) {
  // below[e]: spheres of smaller exponents than e. And the smallest and the largest exponent that occur.
  std::vector<std::uint64_t> below(kExponents + 1, 0);
  int smallest = kExponents, largest = -1;
  for (int e = 0; e < kExponents; e++) {
    below[static_cast<std::size_t>(e + 1)] =
        below[static_cast<std::size_t>(e)] + of_exponent[static_cast<std::size_t>(e)];
    if (of_exponent[static_cast<std::size_t>(e)]) smallest = std::min(smallest, e), largest = e;
  }
  // The number of spheres that share an octave with spheres of another exponent, if octave 0 begins at `top`.
  const auto lumped = [&](int top) {
    const int last = top - (kOctaves - 1);
    return (largest > top ? below[kExponents] - below[static_cast<std::size_t>(top)] : 0) +
           (smallest < last ? below[static_cast<std::size_t>(last + 1)] : 0);
  };
  int best = largest;
  for (int top = largest; top >= std::max(smallest, 0) && lumped(best) > 0; top--)
    if (lumped(top) < lumped(best)) best = top;
  return largest - best;
}

Grid choose_grid(const Summary& given, double bin_size, double bins_per_sphere, Processor processor,
                 GridBounds bounds) {
  Grid g;
  if (given.count == 0) return g;
  const bool gpu = processor == Processor::gpu;
  const Summary s = grown(given);
  const std::vector<LevelRun> runs = divide_into_levels(s, processor);
  g.levels = static_cast<std::int32_t>(runs.size());
  g.top = exponent_of(s.need_max) - s.above;
  g.buckets = 0;
  for (std::size_t level = 0; level < runs.size(); level++) {
    const LevelRun& run = runs[level];
    const Summary::Octave all = joined(s, run);
    for (int k = run.coarsest; k <= run.finest; k++)
      if (s.octave[k].count) g.level_of_octave[k] = static_cast<std::uint8_t>(level);
    Level& l = g.level[level];
    // Where coordinates and not radii ask for the edge (need_of), it is no round number: the steps of a
    // lattice of points would be a multiple of so many bins that all of them shared a bucket of the ring.
    const double need = all.need_max > 2.1 * all.radius_max ? 1.07 * all.need_max : all.need_max;
    l.size =
        all.need_max > 0 ? rounded_up(std::max(need, bin_size)) : rounded_up(bin_size > 0 ? bin_size : 1);
    if (gpu && runs.size() > 1) l.size = size_of_sparse(all, l.size, run.density);
    l.per_size = 1 / l.size, l.units = std::ldexp(l.per_size, kUnitBits), l.radius_max = all.radius_max,
    l.grown_by = s.grown_by;
    l.spheres = most_spheres(all.count, runs.size() == 1, bounds);
    // A level with few spheres may have as many bins as the finer levels: as its bins are coarser, it has
    // fewer.
    const double many =
        std::max(bins_per_sphere * static_cast<double>(all.count), 2 * static_cast<double>(s.count));
    const double most = runs.size() == 1 ? 0x1p31 : 0x1p28;
    // Coarse levels have few bins, and a step of one would be passed often: all levels share one grid, which
    // any of them changes.
    // A GPU wants bins in float, also when bounds are wider than the spheres are.
    const std::int64_t most_along = gpu ? kMostFloatBins * 15 / 16 - 8 : INT64_MAX;
    lay_out(l, all, bins_per_sphere > 0 ? std::min(many + 4096, most) : 0, most_along, bounds,
            level > 0 ? 4 : 1);
  }
  if (gpu) widen_rings(g, s.count);
  for (int k = 0; k < g.levels; k++) g.level[k].offset = g.buckets, g.buckets += g.level[k].buckets;
  return g;
}

bool covers(const Grid& g, const Summary& given) {
  if (given.count == 0) return true;
  const Summary s = grown(given);
  if (g.top != exponent_of(s.need_max) - s.above) return false;
  std::uint64_t count[kMaxLevels] = {};
  for (int o = 0; o < kOctaves; o++) {
    const Summary::Octave& octave = s.octave[o];
    if (octave.count == 0) continue;
    const int level = g.levels == 1 ? 0 : g.level_of_octave[o];
    const Level& l = g.level[level];
    count[level] += octave.count;
    if (octave.need_max > l.size || octave.radius_max > l.radius_max || l.grown_by < s.grown_by) return false;
    for (int k = 0; k < 3; k++)
      if (!(l.hashed && l.count[k] == kMostHashedBins) &&
          (split(l, octave.low[k]).bin < l.first[k] ||
           last_bin(l, octave.high[k]) >= l.first[k] + static_cast<std::int64_t>(l.count[k])))
        return false;
  }
  for (int k = 0; k < g.levels; k++) {
    const std::uint64_t most = g.level[k].spheres;
    if (count[k] > most || count[k] + most / 8 + 8 < most) return false;
  }
  return true;
}

bool have_same_bins(Grid a, const Grid& b) {
  for (int k = 0; k < a.levels; k++) a.level[k].spheres = b.level[k].spheres;
  return a == b;
}

Summary with_count(const Summary& given, std::uint64_t count) {
  Summary s = given;
  const double times = static_cast<double>(count) / static_cast<double>(std::max<std::uint64_t>(s.count, 1));
  for (Summary::Octave& o : s.octave)
    if (o.count)
      o.count =
          std::max<std::uint64_t>(static_cast<std::uint64_t>(static_cast<double>(o.count) * times + 0.5), 1);
  s.count = count;
  return s;
}

Summary expected_next(const Summary& before, const Summary& now) {
  Summary s = with_octaves(now);
  const Summary old = with_octaves(before);
  s.octaves_known = true;
  for (int o = 0; o < kOctaves; o++) {
    if (s.octave[o].count == 0 || old.octave[o].count == 0) continue;
    for (int k = 0; k < 3; k++) {
      s.octave[o].low[k] += 2 * std::min(s.octave[o].low[k] - old.octave[o].low[k], 0.0);
      s.octave[o].high[k] += 2 * std::max(s.octave[o].high[k] - old.octave[o].high[k], 0.0);
    }
  }
  return s;
}

Summary going_on(const Summary& before, const Summary& now) {
  Summary s = now;
  const auto move = [](auto& to, const auto& from) {
    for (int k = 0; k < 3; k++) {
      const double low = 2 * to.low[k] - from.low[k], high = 2 * to.high[k] - from.high[k];
      if (low <= high) to.low[k] = low, to.high[k] = high;
    }
  };
  move(s, before);
  for (int o = 0; o < kOctaves; o++)
    if (s.octave[o].count > 0 && before.octave[o].count > 0) move(s.octave[o], before.octave[o]);
  return s;
}

bool lie_apart(const Level& a, const Level& b) {
  if (a.hashed || b.hashed) return false;
  // By a bin more, since a sphere's bin in float may be the next one (detect/cuda/order/bins.h).
  const double apart = 1.01 * (a.radius_max + b.radius_max) + a.size + b.size;
  for (int c = 0; c < 3; c++)
    if (low_of(a, c) > high_of(b, c) + apart || low_of(b, c) > high_of(a, c) + apart) return true;
  return false;
}

}  // namespace padder::detect
