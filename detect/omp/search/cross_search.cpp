// SPDX-License-Identifier: MIT
#include "detect/omp/search/cross_search.h"

#include "detect/core/neighbourhood.h"

namespace padder::detect::omp {
namespace {

// The largest search radius of a coarse sphere, in bins of the finer level. Fixed-point slots know their
// place modulo 256 bins only, and kSearchRadiusFactor must not add more than a bin.
constexpr double kLargestSearchRadius[2] = {800, 100};  // for float slots, for fixed-point slots

// For each sphere that searches a whole level, in nanoseconds; a rough measurement.
double whole_cost(const Level& l) { return 8 + 3.5 * (static_cast<double>(l.spheres) / kLanes + 0.5); }
// A sphere is in 27 lists at most, and a table has 32-bit numbers.
constexpr std::uint64_t kMostInTable = std::uint64_t(1) << 27;

}  // namespace

CrossSearches plan_cross_searches(const Grid& g, const Summary& s, bool fixed_point) {
  CrossSearches plan;
  const ProbedLevels probed(s, g);
  for (int c = 0; c < g.levels; c++)
    for (int f = 0; f < c; f++) {
      const Level &coarse = g.level[c], &fine = g.level[f];
      if (lie_apart(coarse, fine)) continue;
      LevelSearch up{c, coarse.spheres < kMostInTable ? Way::table : Way::rows,
                     fine_to_coarse_cost(fine, coarse, probed.in_bin(c, f))},
          down{f, Way::rows, coarse_to_fine_cost(coarse, fine, probed.in_bin(f, c))};
      if (whole_cost(coarse) < up.cost) up.way = Way::whole, up.cost = whole_cost(coarse);
      const double search_radius = (coarse.radius_max + fine.radius_max) * fine.per_size;
      const bool wide = search_radius > kLargestSearchRadius[fixed_point] ||
                        2.01 * search_radius + 3 > keys_of(fine).side();
      if (!wide &&
          down.cost * static_cast<double>(coarse.spheres) < up.cost * static_cast<double>(fine.spheres)) {
        plan.of_level[c].push_back(down);
        continue;
      }
      plan.of_level[f].push_back(up);
      if (up.way == Way::table) plan.partners[c].add(fine);
    }
  return plan;
}

}  // namespace padder::detect::omp
