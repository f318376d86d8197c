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

// What a search costs is estimated. Spheres are assumed to be spread evenly over the box of their octave or
// level, or to be as many in a bin as probes say, if that is more.
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
double cube(double x) { return x * x * x; }

// Nanoseconds of one thread of a CPU, measured on one machine.
struct CpuCosts {
  // For each sphere, if there is but one level: its level and key need not be found.
  static constexpr double kSingle = -8;
  // The finer spheres search where that costs less.
  static constexpr double kMuchCheaper = 1;

  // Testing the candidates of a row of bins. Eight are tested at once, and a row begins and ends anywhere, so
  // half a vector is wasted on average.
  static double row(double candidates) { return 4.5 * std::max(1.0, candidates / 8 + 0.5); }
  // A sphere that searches its own level, with so many spheres in a bin.
  static double own_level(double density) { return 10 + 5 * row(3 * density); }
  // A sphere of `from` that searches the finer level `at`, whose bins have this size, row by row. A radius of
  // 0.7 of the largest one is taken for the usual one, and the ball around the sphere crosses 0.8 of the rows
  // in the box around it.
  static double coarse_to_fine(const Summary::Octave& from, const Summary::Octave& at, double size,
                               double density) {
    if (!(size > 0)) return 0;
    const double search_radius = 0.7 * from.radius_max + at.radius_max, wide = 2 * search_radius / size + 1;
    double rows = 0.8;
    for (int c = 1; c < 3; c++) rows *= std::min(wide, bins_along(at, c, size));
    const double each = 8 + row(density * 0.8 * std::min(wide, bins_along(at, 0, size)));
    return 15 + fraction_near(from, at, search_radius) * (25 + rows * each);
  }
  // A sphere of `from` that searches the coarser level `at`, whose bins have this size. It finds all spheres
  // that reach into its bin in one list. Its part of the cost of the lists counts, too.
  static double fine_to_coarse(const Summary::Octave& from, const Summary::Octave& at, double size,
                               double density) {
    const double wide = (1.4 * at.radius_max + 2 * from.radius_max) / size + 1, listed = cube(wide),
                 reach = from.radius_max + at.radius_max;
    return 6 +
           fraction_near(from, at, reach) *
               (3 + 4 * std::min(listed * density, static_cast<double>(at.count))) +
           static_cast<double>(at.count) / static_cast<double>(from.count) *
               (5 + fraction_near(at, from, reach) * 5 * listed);
  }
};

// On a GPU. The unit is a tenth of what it costs a sphere to search 27 bins that hold one sphere each. Fitted
// to 247 scenes, each with up to 90 divisions into levels that were timed on an H200
// (docs/experiments/levels.md). What a sphere costs in any division is left out. So is what a level costs by
// itself: with it, levels were chosen worse.
struct GpuCosts {
  // For each sphere, if there is but one level: a faster kernel searches it.
  static constexpr double kSingle = -1.8;
  // The finer spheres search where that costs far less (detect/cuda/search/level_pairs.cu).
  static constexpr double kMuchCheaper = 4;

  static double own_level(double density) { return 10 * density; }
  // Row by row, as on a CPU. Finding a row of bins costs as much as many tests.
  static double coarse_to_fine(const Summary::Octave& from, const Summary::Octave& at, double size,
                               double density) {
    if (!(size > 0)) return 0;
    const double search_radius = from.radius_max + at.radius_max, wide = 2 * search_radius / size + 1;
    double rows = 0.8;
    for (int c = 1; c < 3; c++) rows *= std::min(wide, bins_along(at, c, size));
    const double each = 4 + 0.25 * density * 0.8 * std::min(wide, bins_along(at, 0, size));
    return fraction_near(from, at, search_radius) * rows * each;
  }
  // The finer sphere searches up to 27 bins, and what it finds there mostly does not touch it.
  static double fine_to_coarse(const Summary::Octave& from, const Summary::Octave& at, double,
                               double density) {
    return fraction_near(from, at, from.radius_max + at.radius_max) * (6.5 + 25 * density);
  }
};

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
template <class Costs>
CrossCosts cross_costs(const Octaves& octaves, const ProbedDensity& probed) {
  CrossCosts cost;
  const auto near = [&](std::size_t at, std::size_t from) {
    return probed.in_bin(at, at, from).clamped(density_of(octaves[at], octaves[at].need_max));
  };
  for (std::size_t f = 0; f < octaves.size(); f++)
    for (std::size_t c = f + 1; c < octaves.size(); c++) {
      const Summary::Octave &fine = octaves[f], &coarse = octaves[c];
      cost.by_coarse[c][f] =
          static_cast<double>(coarse.count) * Costs::coarse_to_fine(coarse, fine, fine.need_max, near(f, c));
      cost.by_fine[c][f] =
          static_cast<double>(fine.count) * Costs::fine_to_coarse(fine, coarse, coarse.need_max, near(c, f));
    }
  return cost;
}
// The cost of making octaves a to b one level, for one b: octaves are added from b on, the next finer one
// each time.
template <class Costs>
class LevelCost {
 public:
  LevelCost(const Octaves& octaves, std::size_t b, const ProbedDensity& probed, const CrossCosts& alone)
      : octaves_(octaves), probed_(probed), alone_(alone), b_(b), size_(octaves[b].need_max) {}
  void add(std::size_t a) {
    const Summary::Octave& o = octaves_[a];
    a_ = a, join(all_, o);
    if (!(size_ > 0)) return;
    const double density = density_of(o, size_);
    for (std::size_t k = 0; k <= b_; k++) density_[k] += density * fraction_near(octaves_[k], o, size_);
    for (std::size_t k = b_ + 1; k < octaves_.size(); k++) by_fine_[k] += alone_.by_fine[k][a];
    for (std::size_t k = 0; k < a; k++) by_coarse_[k] += alone_.by_coarse[a][k];
  }
  // The search of the level by its own spheres. Grows with each octave.
  double own() const {
    if (!(size_ > 0)) return 0;
    double cost = 0;
    for (std::size_t k = a_; k <= b_; k++)
      cost += static_cast<double>(octaves_[k].count) *
              Costs::own_level(probed_.in_bin(a_, b_, k).clamped(density_[k]));
    return cost;
  }
  // For each other octave, half of the cost of the search between the two. The other half is counted with the
  // level of the other octave. How crowded the bins of this level are is known, but not those of the other:
  // it is taken to be a level of its own.
  double cross() const {
    if (!(size_ > 0)) return 0;
    const double by_bounds = density_of(all_, size_);
    double cost = 0;
    for (std::size_t k = 0; k < octaves_.size(); k++) {
      if (k >= a_ && k <= b_) continue;
      const Summary::Octave& o = octaves_[k];
      const auto count = static_cast<double>(o.count);
      const double density = probed_.in_bin(a_, b_, k).clamped(by_bounds),
                   by_coarse =
                       k < a_ ? by_coarse_[k] : count * Costs::coarse_to_fine(o, all_, size_, density),
                   by_fine = k > b_ ? by_fine_[k] : count * Costs::fine_to_coarse(o, all_, size_, density);
      cost += (Costs::kMuchCheaper * by_fine < by_coarse ? by_fine : by_coarse) / 2;
    }
    return cost;
  }

 private:
  const Octaves& octaves_;
  const ProbedDensity& probed_;
  const CrossCosts& alone_;
  std::size_t a_ = 0, b_;
  double size_;
  Summary::Octave all_;  // octaves a to b as one
  // In bins of this level, near octave k <= b; sums over octaves a to b of the costs with octave k.
  double density_[kMaxLevels] = {}, by_fine_[kMaxLevels] = {}, by_coarse_[kMaxLevels] = {};
};

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
template <class Costs>
std::vector<std::size_t> cheapest(const Octaves& octaves, std::uint64_t count, const ProbedDensity& probed) {
  const std::size_t n = octaves.size();
  const CrossCosts cross = cross_costs<Costs>(octaves, probed);
  const double single = Costs::kSingle * static_cast<double>(count);
  double best[kMaxLevels + 1] = {};
  std::size_t from[kMaxLevels + 1] = {};
  for (std::size_t b = 0; b < n; b++) {
    best[b + 1] = INFINITY;
    LevelCost<Costs> level(octaves, b, probed, cross);
    for (std::size_t a = b + 1; a-- > 0;) {
      level.add(a);
      const double own = level.own();
      if (own + single >= best[b + 1]) break;  // the more so with still finer octaves
      const double cost = best[a] + own + level.cross() + (a == 0 && b + 1 == n ? single : 0);
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

std::vector<LevelRun> divide_into_levels(const Summary& s, Processor processor) {
  const Summary near = gathered(s);
  const std::vector<Run> runs = populated(near);
  Octaves octaves;
  for (const Run& run : runs) octaves.push_back(joined(near, run));
  const ProbedDensity probed(s, groups_of(s, runs));
  const std::vector<std::size_t> begins = processor == Processor::gpu
                                              ? cheapest<GpuCosts>(octaves, s.count, probed)
                                              : cheapest<CpuCosts>(octaves, s.count, probed);
  std::vector<LevelRun> levels;
  for (std::size_t level = 0; level < begins.size(); level++) {
    const std::size_t begin = begins[level],
                      last = (level + 1 < begins.size() ? begins[level + 1] : runs.size()) - 1;
    double sum = 0, count = 0;
    for (std::size_t k = begin; k <= last; k++) {
      const auto of_octave = static_cast<double>(octaves[k].count);
      sum += of_octave * probed.in_bin(begin, last, k).least, count += of_octave;
    }
    levels.push_back({{runs[begin].finest, runs[last].coarsest}, sum / count});
  }
  return levels;
}

SizeGroups size_groups(const Summary& s) { return groups_of(s, populated(gathered(s))); }

double coarse_to_fine_cost(const Level& from, const Level& at, double probed) {
  const TwoOctaves two = as_octaves(from, at);
  return CpuCosts::coarse_to_fine(two.from, two.at, at.size, std::max(density_of(two.at, at.size), probed));
}
double fine_to_coarse_cost(const Level& from, const Level& at, double probed) {
  const TwoOctaves two = as_octaves(from, at);
  return CpuCosts::fine_to_coarse(two.from, two.at, at.size, std::max(density_of(two.at, at.size), probed));
}

}  // namespace padder::detect
