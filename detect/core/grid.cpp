// SPDX-License-Identifier: MIT
// Chooses levels and bins on the host, from the summary of the spheres that a backend has made.
#include "detect/core/neighbourhood.h"

#include <algorithm>
#include <bit>
#include <vector>

namespace padder::detect {
namespace {

// The smallest number with 10 significant bits that is not below x. Its products with bin numbers up to 2^43
// are exact.
double rounded_up(double x) {
  int exponent;
  const double fraction = std::frexp(std::max(x, 0x1p-900), &exponent);
  return std::ldexp(std::ceil(fraction * 1024) / 1024, exponent);
}

void join(Summary::Octave& all, const Summary::Octave& o) {
  all.count += o.count, all.need_max = std::max(all.need_max, o.need_max);
  all.radius_max = std::max(all.radius_max, o.radius_max);
  for (int c = 0; c < 3; c++)
    all.low[c] = std::min(all.low[c], o.low[c]), all.high[c] = std::max(all.high[c], o.high[c]);
}

// Consecutive octaves that go to one level. Finer octaves have larger numbers.
struct Run {
  int finest, coarsest;
};

// The octaves of a run as one.
Summary::Octave merged(const Summary& s, const Run& run) {
  Summary::Octave all;
  for (int k = run.finest; k >= run.coarsest; k--) join(all, s.octave[k]);
  return all;
}

using Octaves = std::vector<Summary::Octave>;  // from the finest to the coarsest; at most kMaxLevels

// The mean number of spheres in a bin of a level with bins for octave b. The mean is taken over the bins in
// which the spheres of an octave search: a lone large sphere fills its own bin, but few spheres are near it.
// It is that of spheres which are spread evenly over the bounds of their octave, or what probes say, if that
// is more.
class BinDensity {
 public:
  BinDensity(const Octaves& octaves, std::size_t b, const ProbedDensity& probed)
      : probed_(probed), octaves_(octaves), b_(b), size_(octaves[b].need_max) {
    for (std::size_t k = 0; k < octaves.size(); k++)
      for (int c = 0; c < 3; c++)
        wide_[k][c] = octaves[k].high[c] - octaves[k].low[c] + size_, per_wide_[k][c] = 1 / wide_[k][c];
  }
  // Adds an octave to the level: first b, and then always the next finer one.
  void add(std::size_t a) {
    const Summary::Octave& o = octaves_[a];
    double in_bin = static_cast<double>(o.count);
    for (int c = 0; c < 3; c++) in_bin *= std::min(1.0, size_ / (o.high[c] - o.low[c] + o.need_max));
    for (std::size_t k = 0; k < octaves_.size(); k++) {
      double part = in_bin;
      for (int c = 0; c < 3; c++) part *= std::min(1.0, wide_[a][c] * per_wide_[k][c]);
      sum_[k] += part;
    }
    a_ = a;
  }
  double seen_by(std::size_t k) const { return std::max(sum_[k], probed_.in_bin(a_, b_, k)); }

 private:
  const ProbedDensity& probed_;
  const Octaves& octaves_;
  std::size_t a_ = 0, b_;
  double size_, wide_[kMaxLevels][3], per_wide_[kMaxLevels][3], sum_[kMaxLevels] = {};
};

// The functions below estimate what the search costs on a CPU, in nanoseconds. The constants were measured on
// one machine. Spheres are assumed to be spread evenly over the box of their octave or level.
double bins_along(const Summary::Octave& o, int axis, double size) {
  return (o.high[axis] - o.low[axis]) / size + 1;
}
double density_of(const Summary::Octave& o, double size) {
  return static_cast<double>(o.count) / bins_along(o, 0, size) / bins_along(o, 1, size) /
         bins_along(o, 2, size);
}
// The fraction of the spheres of `from` whose centres are within `distance` of the box of `at`.
double fraction_near(const Summary::Octave& from, const Summary::Octave& at, double distance) {
  double near = 1, all = 1;
  for (int c = 0; c < 3; c++) {
    const double common = std::min(from.high[c], at.high[c] + distance) -
                          std::max(from.low[c], at.low[c] - distance),
                 wide = from.high[c] - from.low[c] + distance;
    near *= common < 0 ? 0 : std::min(wide, common + distance), all *= wide;
  }
  return all > 0 ? near / all : 1;
}
// The cost of testing the candidates of a row of bins. Eight are tested at once, and a row begins and ends
// anywhere, so half a vector is wasted on average.
double row_cost(double candidates) { return 4.5 * std::max(1.0, candidates / 8 + 0.5); }
// The cost of a sphere of `from` that searches the finer level `at`, whose bins have this size, row by row. A
// radius of 0.7 of the largest one is taken for the usual one, and the ball around the sphere crosses 0.8 of
// the rows in the box around it.
double coarse_to_fine_cost(const Summary::Octave& from, const Summary::Octave& at, double size) {
  if (!(size > 0)) return 0;
  const double search_radius = 0.7 * from.radius_max + at.radius_max, wide = 2 * search_radius / size + 1;
  double rows = 0.8;
  for (int c = 1; c < 3; c++) rows *= std::min(wide, bins_along(at, c, size));
  const double row = 8 + row_cost(density_of(at, size) * 0.8 * std::min(wide, bins_along(at, 0, size)));
  return 15 + fraction_near(from, at, search_radius) * (25 + rows * row);
}
// The cost of a sphere of `from` that searches the coarser level `at`, whose bins have this size. It finds
// all spheres that reach into its bin in one list. Its part of the cost of the lists counts, too.
double fine_to_coarse_cost(const Summary::Octave& from, const Summary::Octave& at, double size) {
  const double wide = (1.4 * at.radius_max + 2 * from.radius_max) / size + 1, listed = wide * wide * wide,
               reach = from.radius_max + at.radius_max;
  return 6 +
         fraction_near(from, at, reach) *
             (3 + 4 * std::min(listed * density_of(at, size), static_cast<double>(at.count))) +
         static_cast<double>(at.count) / static_cast<double>(from.count) *
             (5 + fraction_near(at, from, reach) * 5 * listed);
}
// Two levels as if each were an octave. The bounds of a hashed one tell nothing: where it has spheres it has
// about one in a bin, and they are taken to be near those of the other level.
struct TwoOctaves {
  Summary::Octave from, at;
};
TwoOctaves as_octaves(const Level& from, const Level& at) {
  const auto octave = [](const Level& l) {
    Summary::Octave o{l.spheres, l.size, l.radius_max};
    for (int k = 0; k < 3; k++) {
      const double bins = l.hashed ? std::cbrt(static_cast<double>(l.spheres)) : l.count[k];
      o.low[k] = low_of(l, k), o.high[k] = o.low[k] + (bins - 1) * l.size;
    }
    return o;
  };
  TwoOctaves two{octave(from), octave(at)};
  if (from.hashed || at.hashed)
    std::copy_n(two.at.low, 3, two.from.low), std::copy_n(two.at.high, 3, two.from.high);
  return two;
}
// The cost of making octaves a to b one level, for CrossSearch::cheaper: of the search of this level by its
// own spheres, and, for each coarser octave, of the search between the two in the direction that costs less.
// `all`: those octaves as one.
double cheaper_cost(const Octaves& octaves, std::size_t a, std::size_t b, const Summary::Octave& all,
                    const ProbedDensity& probed) {
  const double size = all.need_max, own = 10;
  const double several = 8;  // for finding a sphere's level and key, where there is more than one level
  if (!(size > 0)) return 0;
  double cost = b + 1 - a < octaves.size() ? several * static_cast<double>(all.count) : 0;
  for (std::size_t k = a; k <= b; k++) {
    const Summary::Octave& o = octaves[k];
    double density = 0;
    for (std::size_t q = a; q <= b; q++) {
      const Summary::Octave& other = octaves[q];
      density += density_of(other, size) * fraction_near(o, other, size);
    }
    density = std::max(density, probed.in_bin(a, b, k));
    cost += static_cast<double>(o.count) * (own + 5 * row_cost(3 * density));
  }
  for (std::size_t k = b + 1; k < octaves.size(); k++) {
    const Summary::Octave& o = octaves[k];
    cost += std::min(static_cast<double>(o.count) * coarse_to_fine_cost(o, all, size),
                     static_cast<double>(all.count) * fine_to_coarse_cost(all, o, o.need_max));
  }
  return cost;
}

// The cost of making octaves a to b one level, in pair tests on a GPU, for the two fixed directions: of the
// search within the level, and of the search between it and others. Finding a row of bins costs as much as
// some pair tests. `density`: in bins of the size that the level needs.

// The bins along each axis that a sphere searches in a level with bins of this size. It is of the level, or
// of a finer one.
double bins_searched(const Summary::Octave& o, double size) { return 2 + (size > 0 ? o.need_max / size : 1); }
double cube(double x) { return x * x * x; }
// The spheres of the level search half of their neighbourhood. Each finer octave in the level makes it
// dearer.
double own_cost(const Octaves& octaves, std::size_t a, std::size_t b, const BinDensity& density, bool up) {
  const double rows = up ? 12 : 25;
  double cost = 0;
  for (std::size_t k = a; k <= b; k++) {
    const double wide = up ? bins_searched(octaves[k], octaves[b].need_max) : 3;
    cost += static_cast<double>(octaves[k].count) * (rows + density.seen_by(k) * cube(wide) / 2);
  }
  return cost;
}
// fine_to_coarse (up): each finer sphere also searches 2 to 3 bins of this level along each axis.
// coarse_to_fine: each coarser sphere that is near the level searches every row of bins near it. There a row
// costs 4 tests, and a test 4 times as much as elsewhere. The finer ones search where that costs less than
// half (detect/cuda/search/level_pairs.cu). `all`: the level's octaves as one; `alone`: the density of each
// octave in bins of its own.
double cross_cost(const Octaves& octaves, std::size_t a, std::size_t b, const Summary::Octave& all,
                  const BinDensity& density, const double (&alone)[kMaxLevels], bool up) {
  const double finer_rows = 18, coarser_row = 4, coarser_test = 4, size = all.need_max,
               per_size = size > 0 ? 1 / size : 0;
  double cost = 0;
  for (std::size_t k = 0; k < a && up; k++)
    cost += static_cast<double>(octaves[k].count) *
            (finer_rows + density.seen_by(k) * cube(bins_searched(octaves[k], size)));
  for (std::size_t k = b + 1; k < octaves.size() && !up; k++) {
    const Summary::Octave& o = octaves[k];
    double wide[3];  // bins along each axis within the search radius, of those that exist
    for (int c = 0; c < 3; c++)
      wide[c] = size > 0 ? 2 + per_size * std::min(0.75 * o.need_max, all.high[c] - all.low[c] + size) : 3;
    const double reach = o.radius_max + all.radius_max,
                 by_coarse = static_cast<double>(o.count) * fraction_near(o, all, reach) * wide[1] * wide[2] *
                             (coarser_row + coarser_test * density.seen_by(k) * wide[0] / 2),
                 by_fine = static_cast<double>(all.count) * fraction_near(all, o, reach) *
                           (finer_rows + 27 * alone[k]);
    cost += std::min(by_coarse, 2 * by_fine);
  }
  return cost;
}

// Would a level of this octave, with so many spheres, have more than 8 bins for each of them?
bool is_sparse(const Summary::Octave& o, std::uint64_t count) {
  double bins = 1;
  for (int c = 0; c < 3; c++) bins *= bins_along(o, c, o.need_max);
  return bins > 8 * static_cast<double>(count);
}
// Leaves of the octave's bounds what lies within those of another, if that is anything.
void clip(Summary::Octave& o, const Summary::Octave& to) {
  for (int c = 0; c < 3; c++)
    if (o.high[c] < to.low[c] || o.low[c] > to.high[c]) return;
  for (int c = 0; c < 3; c++)
    o.low[c] = std::max(o.low[c], to.low[c]), o.high[c] = std::min(o.high[c], to.high[c]);
}
// Cuts the longest sides of the octave's bounds, so that its spheres have no more room than a cube of this
// edge, and puts them about the origin.
void gather(Summary::Octave& o, double edge) {
  double wide[3];
  for (int c = 0; c < 3; c++) wide[c] = o.high[c] - o.low[c] + o.need_max;
  double sorted[3] = {wide[0], wide[1], wide[2]};
  std::sort(sorted, sorted + 3);
  // The longest side that is left if one side is cut, or two, or all.
  double most = (edge + o.need_max) * (edge + o.need_max) * (edge + o.need_max) / (sorted[0] * sorted[1]);
  if (most < sorted[1]) most = std::sqrt(most * sorted[1]);
  if (most < sorted[0]) most = edge + o.need_max;
  for (int c = 0; c < 3; c++) {
    const double half = (o.high[c] - o.low[c]) * std::min(1.0, most / wide[c]) / 2;
    o.low[c] = -half, o.high[c] = half;
  }
}

// The summary by which levels are chosen. Bounds say little where a few spheres are far away: they make all
// others look as if nothing were near them, and one level enough. So the spheres of a sparse octave are taken
// to be among the most frequent ones. If these are sparse themselves, all spheres are taken to be about one
// point and to fill half of the box that they lie in.
Summary gathered(Summary s) {
  double volume = 0;
  const Summary::Octave* usual = &s.octave[0];
  for (const Summary::Octave& o : s.octave) {
    if (o.count) volume += static_cast<double>(o.count) * std::pow(1.4 * o.radius_max, 3) * 0.52;
    if (o.count > usual->count) usual = &o;
  }
  const bool about_a_point = is_sparse(*usual, s.count);
  for (Summary::Octave& o : s.octave) {
    if (o.count == 0) continue;
    if (about_a_point)
      gather(o, std::cbrt(volume / 0.5));
    else if (is_sparse(o, o.count))
      clip(o, *usual);
  }
  return s;
}

// The octaves that hold spheres, from the finest to the coarsest. While there are more than there can be
// levels, those two neighbours become one run that together would test the fewest pairs of their own.
std::vector<Run> populated(const Summary& s) {
  std::vector<Run> runs;
  for (int o = kOctaves - 1; o >= 0; o--)
    if (s.octave[o].count) runs.push_back({o, o});
  const auto tests = [&](std::size_t k) {
    const double size = merged(s, runs[k + 1]).need_max;
    double sum = 0;
    for (std::size_t r = k; r <= k + 1; r++) {
      const Summary::Octave o = merged(s, runs[r]);
      sum += static_cast<double>(o.count) * density_of(o, size);
    }
    return sum;
  };
  while (runs.size() > kMaxLevels) {
    std::size_t fewest = 0;
    for (std::size_t k = 1; k + 1 < runs.size(); k++)
      if (tests(k) < tests(fewest)) fewest = k;
    runs[fewest].coarsest = runs[fewest + 1].coarsest;
    runs.erase(runs.begin() + static_cast<std::ptrdiff_t>(fewest) + 1);
  }
  return runs;
}

SizeGroups groups_of(const Summary& s, const std::vector<Run>& runs) {
  SizeGroups g;
  g.count = static_cast<std::int32_t>(runs.size()), g.top = exponent_of(s.need_max) - s.above;
  for (std::size_t k = 0; k < runs.size(); k++) {
    for (int o = runs[k].coarsest; o <= runs[k].finest; o++) g.of_octave[o] = static_cast<std::uint8_t>(k);
    g.within[k] = 1.5 * merged(s, runs[k]).need_max;
  }
  return g;
}

// The partition of the octaves into levels that costs least. Dynamic programming over the octaves taken.
// Returns the first octave of each level.
std::vector<std::size_t> choose_levels(const Octaves& octaves, std::uint64_t count, CrossSearch cross_search,
                                       const ProbedDensity& probed) {
  const bool down = cross_search == CrossSearch::coarse_to_fine;
  const std::size_t n = octaves.size();
  // Each level costs something, even if it has only a few spheres. A faster kernel searches a single level,
  // so a few larger spheres are not worth a second one.
  const double level = down ? 0.02 * static_cast<double>(count) : 0,
               single = down ? -4 * static_cast<double>(count) : 0;
  double best[kMaxLevels + 1] = {};
  std::size_t from[kMaxLevels + 1] = {};
  double alone[kMaxLevels];
  for (std::size_t k = 0; k < n; k++) alone[k] = density_of(octaves[k], octaves[k].need_max);
  for (std::size_t b = 0; b < n; b++) {
    best[b + 1] = INFINITY;
    BinDensity density(octaves, b, probed);
    Summary::Octave all;
    for (std::size_t a = b + 1; a-- > 0;) {
      join(all, octaves[a]);
      double cost;
      if (cross_search == CrossSearch::cheaper) {
        cost = cheaper_cost(octaves, a, b, all, probed);
      } else {
        density.add(a);
        cost = own_cost(octaves, a, b, density, !down);
        if (cost + single >= best[b + 1]) break;  // the more so with still finer octaves
        cost += cross_cost(octaves, a, b, all, density, alone, !down);
      }
      cost += best[a] + level + (a == 0 && b + 1 == n ? single : 0);
      if (cost < best[b + 1]) best[b + 1] = cost, from[b + 1] = a;
    }
  }
  std::vector<std::size_t> begins;
  for (std::size_t end = n; end > 0; end = from[end]) begins.insert(begins.begin(), from[end]);
  return begins;
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
// bin far.
double size_of_sparse(const Summary::Octave& all, double size) {
  const double emptier = 0.3 / density_of(all, size);
  if (emptier < 1 || emptier > 0.3 * 8) return size;
  return rounded_up(size * std::exp2(std::floor(2 * std::log2(emptier)) / 6));
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

SizeGroups size_groups(const Summary& s) { return groups_of(s, populated(gathered(s))); }

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

Grid choose_grid(const Summary& given, double bin_size, double bins_per_sphere, CrossSearch cross_search,
                 GridBounds bounds) {
  Grid g;
  if (given.count == 0) return g;
  const Summary s = grown(given);
  const Summary near = gathered(s);
  const std::vector<Run> runs = populated(near);
  Octaves octaves;
  for (const Run& run : runs) octaves.push_back(merged(near, run));
  const std::vector<std::size_t> begins =
      choose_levels(octaves, s.count, cross_search, ProbedDensity(s, groups_of(s, runs)));
  g.levels = static_cast<std::int32_t>(begins.size());
  g.top = exponent_of(s.need_max) - s.above;
  g.buckets = 0;
  for (std::size_t level = 0; level < begins.size(); level++) {
    const std::size_t end = level + 1 < begins.size() ? begins[level + 1] : runs.size();
    const Run run{runs[begins[level]].finest, runs[end - 1].coarsest};
    const Summary::Octave all = merged(s, run);
    for (int k = run.coarsest; k <= run.finest; k++)
      if (s.octave[k].count) g.level_of_octave[k] = static_cast<std::uint8_t>(level);
    Level& l = g.level[level];
    // Where coordinates and not radii ask for the edge (need_of), it is no round number: the steps of a
    // lattice of points would be a multiple of so many bins that all of them shared a bucket of the ring.
    const double need = all.need_max > 2.1 * all.radius_max ? 1.07 * all.need_max : all.need_max;
    l.size =
        all.need_max > 0 ? rounded_up(std::max(need, bin_size)) : rounded_up(bin_size > 0 ? bin_size : 1);
    if (cross_search == CrossSearch::coarse_to_fine && begins.size() > 1)
      l.size = size_of_sparse(all, l.size);
    l.per_size = 1 / l.size, l.units = std::ldexp(l.per_size, kUnitBits), l.radius_max = all.radius_max,
    l.grown_by = s.grown_by;
    l.spheres = all.count;
    // A level with few spheres may have as many bins as the finer levels: as its bins are coarser, it has
    // fewer.
    const double many =
        std::max(bins_per_sphere * static_cast<double>(all.count),
                 cross_search != CrossSearch::fine_to_coarse ? 2 * static_cast<double>(s.count) : 0);
    const double most = begins.size() == 1 ? 0x1p31 : 0x1p28;
    // Coarse levels have few bins, and a step of one would be passed often: all levels share one grid, which
    // any of them changes.
    // A GPU wants bins in float, also when bounds are wider than the spheres are.
    const std::int64_t most_along =
        cross_search == CrossSearch::coarse_to_fine ? kMostFloatBins * 15 / 16 - 8 : INT64_MAX;
    lay_out(l, all, bins_per_sphere > 0 ? std::min(many + 4096, most) : 0, most_along, bounds,
            level > 0 ? 4 : 1);
  }
  if (cross_search == CrossSearch::coarse_to_fine) widen_rings(g, s.count);
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
  for (int k = 0; k < g.levels; k++)
    if (count[k] != g.level[k].spheres) return false;
  return true;
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

bool lie_apart(const Level& a, const Level& b) {
  if (a.hashed || b.hashed) return false;
  // By a bin more, since a sphere's bin in float may be the next one (detect/cuda/order/bins.h).
  const double apart = 1.01 * (a.radius_max + b.radius_max) + a.size + b.size;
  for (int c = 0; c < 3; c++)
    if (low_of(a, c) > high_of(b, c) + apart || low_of(b, c) > high_of(a, c) + apart) return true;
  return false;
}

double coarse_to_fine_cost(const Level& from, const Level& at) {
  const TwoOctaves two = as_octaves(from, at);
  return coarse_to_fine_cost(two.from, two.at, at.size);
}
double fine_to_coarse_cost(const Level& from, const Level& at) {
  const TwoOctaves two = as_octaves(from, at);
  return fine_to_coarse_cost(two.from, two.at, at.size);
}

}  // namespace padder::detect
