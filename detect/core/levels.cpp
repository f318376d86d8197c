// SPDX-License-Identifier: MIT
#include "detect/core/levels.h"

#include <algorithm>
#include <cmath>

#include "detect/core/neighbourhood.h"

namespace padder::detect {
namespace {

void join(Summary::Octave& all, const Summary::Octave& o) {
  all.count += o.count, all.need_max = std::max(all.need_max, o.need_max);
  all.radius_max = std::max(all.radius_max, o.radius_max);
  for (int c = 0; c < 3; c++)
    all.low[c] = std::min(all.low[c], o.low[c]), all.high[c] = std::max(all.high[c], o.high[c]);
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
// one machine. Spheres are assumed to be spread evenly over the box of their octave or level, or to be as
// many in a bin as probes say, if that is more.
double bins_along(const Summary::Octave& o, int axis, double size) {
  return (o.high[axis] - o.low[axis]) / size + 1;
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
double coarse_to_fine_cost(const Summary::Octave& from, const Summary::Octave& at, double size,
                           double probed) {
  if (!(size > 0)) return 0;
  const double search_radius = 0.7 * from.radius_max + at.radius_max, wide = 2 * search_radius / size + 1,
               density = std::max(density_of(at, size), probed);
  double rows = 0.8;
  for (int c = 1; c < 3; c++) rows *= std::min(wide, bins_along(at, c, size));
  const double row = 8 + row_cost(density * 0.8 * std::min(wide, bins_along(at, 0, size)));
  return 15 + fraction_near(from, at, search_radius) * (25 + rows * row);
}
// The cost of a sphere of `from` that searches the coarser level `at`, whose bins have this size. It finds
// all spheres that reach into its bin in one list. Its part of the cost of the lists counts, too.
double fine_to_coarse_cost(const Summary::Octave& from, const Summary::Octave& at, double size,
                           double probed) {
  const double density = std::max(density_of(at, size), probed),
               wide = (1.4 * at.radius_max + 2 * from.radius_max) / size + 1, listed = wide * wide * wide,
               reach = from.radius_max + at.radius_max;
  return 6 +
         fraction_near(from, at, reach) *
             (3 + 4 * std::min(listed * density, static_cast<double>(at.count))) +
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
// The cost of the search between two octaves, if each is a level of its own.
struct CrossCosts {
  double by_coarse[kMaxLevels][kMaxLevels] = {}, by_fine[kMaxLevels][kMaxLevels] = {};  // [coarser][finer]
};
CrossCosts cross_costs(const Octaves& octaves, const ProbedDensity& probed) {
  CrossCosts cost;
  for (std::size_t f = 0; f < octaves.size(); f++)
    for (std::size_t c = f + 1; c < octaves.size(); c++) {
      const Summary::Octave &fine = octaves[f], &coarse = octaves[c];
      cost.by_coarse[c][f] = static_cast<double>(coarse.count) *
                             coarse_to_fine_cost(coarse, fine, fine.need_max, probed.in_bin(f, f, c));
      cost.by_fine[c][f] = static_cast<double>(fine.count) *
                           fine_to_coarse_cost(fine, coarse, coarse.need_max, probed.in_bin(c, c, f));
    }
  return cost;
}
// The cost of making octaves a to b one level, for CrossSearch::cheaper: of the search of this level by its
// own spheres, and, for each other octave, half of the cost of the search between the two, in the direction
// that costs less. The other half is counted with the level of the other octave. How crowded the bins of this
// level are is known then, but not those of the other: it is taken to be a level of its own. `all`: octaves a
// to b as one.
double cheaper_cost(const Octaves& octaves, std::size_t a, std::size_t b, const Summary::Octave& all,
                    const ProbedDensity& probed, const CrossCosts& alone) {
  const double size = all.need_max, own = 10;
  const double several = 8;  // for finding a sphere's level and key, where there is more than one level
  if (!(size > 0)) return 0;
  double cost = b + 1 - a < octaves.size() ? several * static_cast<double>(all.count) : 0;
  for (std::size_t k = 0; k < octaves.size(); k++) {
    const Summary::Octave& o = octaves[k];
    const auto count = static_cast<double>(o.count);
    if (k >= a && k <= b) {
      double density = 0;
      for (std::size_t q = a; q <= b; q++)
        density += density_of(octaves[q], size) * fraction_near(o, octaves[q], size);
      density = std::max(density, probed.in_bin(a, b, k));
      cost += count * (own + 5 * row_cost(3 * density));
      continue;
    }
    double other_way = 0;
    for (std::size_t q = a; q <= b; q++) other_way += k > b ? alone.by_fine[k][q] : alone.by_coarse[q][k];
    const double each =
        (k > b ? coarse_to_fine_cost : fine_to_coarse_cost)(o, all, size, probed.in_bin(a, b, k));
    cost += std::min(count * each, other_way) / 2;
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
// Leaves of the octave's bounds what lies within those of another, if that is anything, and if the spheres
// would not be more crowded there than those of the other are: then they lie around these.
void clip(Summary::Octave& o, const Summary::Octave& to) {
  Summary::Octave within = o;
  for (int c = 0; c < 3; c++) {
    if (o.high[c] < to.low[c] || o.low[c] > to.high[c]) return;
    within.low[c] = std::max(o.low[c], to.low[c]), within.high[c] = std::min(o.high[c], to.high[c]);
  }
  if (density_of(within, o.need_max) <= density_of(to, to.need_max)) o = within;
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
// levels, those two neighbours become one run that together would test the fewest pairs of their own: if the
// spheres of each octave were spread evenly over its bounds, but for a millionth of them that lie as close
// as they can. A heap among lone spheres of its size looks thin by the bounds.
std::vector<Run> populated(const Summary& s) {
  constexpr double close = 1e-6;
  std::vector<Run> runs;
  for (int o = kOctaves - 1; o >= 0; o--)
    if (s.octave[o].count) runs.push_back({o, o});
  const auto tests = [&](std::size_t k) {
    const double size = joined(s, runs[k + 1]).need_max;
    double sum = 0;
    for (int r = runs[k + 1].coarsest; r <= runs[k].finest; r++) {
      const Summary::Octave& o = s.octave[r];
      const auto count = static_cast<double>(o.count);
      if (o.count) sum += count * (density_of(o, size) + close * std::min(count, cube(size / o.need_max)));
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
    g.within[k] = 1.5 * joined(s, runs[k]).need_max;
  }
  return g;
}

// The partition of the octaves into levels that costs least. Dynamic programming over the octaves taken.
// Returns the first octave of each level.
std::vector<std::size_t> cheapest(const Octaves& octaves, std::uint64_t count, CrossSearch cross_search,
                                  const ProbedDensity& probed) {
  const bool down = cross_search == CrossSearch::coarse_to_fine;
  const std::size_t n = octaves.size();
  // Each level costs something, even if it has only a few spheres. A faster kernel searches a single level,
  // so a few larger spheres are not worth a second one.
  const double level = down ? 0.02 * static_cast<double>(count) : 0,
               single = down ? -4 * static_cast<double>(count) : 0;
  double best[kMaxLevels + 1] = {};
  std::size_t from[kMaxLevels + 1] = {};
  const bool cheaper = cross_search == CrossSearch::cheaper;
  const CrossCosts cross = cheaper ? cross_costs(octaves, probed) : CrossCosts();
  double alone[kMaxLevels];
  for (std::size_t k = 0; k < n; k++) alone[k] = density_of(octaves[k], octaves[k].need_max);
  for (std::size_t b = 0; b < n; b++) {
    best[b + 1] = INFINITY;
    BinDensity density(octaves, b, probed);
    Summary::Octave all;
    for (std::size_t a = b + 1; a-- > 0;) {
      join(all, octaves[a]);
      double cost;
      if (cheaper) {
        cost = cheaper_cost(octaves, a, b, all, probed, cross);
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

}  // namespace

double density_of(const Summary::Octave& o, double size) {
  return static_cast<double>(o.count) / bins_along(o, 0, size) / bins_along(o, 1, size) /
         bins_along(o, 2, size);
}

Summary::Octave joined(const Summary& s, const Run& run) {
  Summary::Octave all;
  for (int k = run.finest; k >= run.coarsest; k--) join(all, s.octave[k]);
  return all;
}

std::vector<Run> divide_into_levels(const Summary& s, CrossSearch cross_search) {
  const Summary near = gathered(s);
  const std::vector<Run> runs = populated(near);
  Octaves octaves;
  for (const Run& run : runs) octaves.push_back(joined(near, run));
  const std::vector<std::size_t> begins =
      cheapest(octaves, s.count, cross_search, ProbedDensity(s, groups_of(s, runs)));
  std::vector<Run> levels;
  for (std::size_t level = 0; level < begins.size(); level++) {
    const std::size_t end = level + 1 < begins.size() ? begins[level + 1] : runs.size();
    levels.push_back({runs[begins[level]].finest, runs[end - 1].coarsest});
  }
  return levels;
}

SizeGroups size_groups(const Summary& s) { return groups_of(s, populated(gathered(s))); }

double coarse_to_fine_cost(const Level& from, const Level& at, double probed) {
  const TwoOctaves two = as_octaves(from, at);
  return coarse_to_fine_cost(two.from, two.at, at.size, probed);
}
double fine_to_coarse_cost(const Level& from, const Level& at, double probed) {
  const TwoOctaves two = as_octaves(from, at);
  return fine_to_coarse_cost(two.from, two.at, at.size, probed);
}

}  // namespace padder::detect
