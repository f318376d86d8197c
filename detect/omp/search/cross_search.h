// SPDX-License-Identifier: MIT
// The search between levels on the CPU: who searches whom, and how. Internal.
#pragma once
#include <vector>

#include "detect/omp/search/reach_table.h"

namespace padder::detect::omp {

// Which other levels the spheres of each level search. Of two levels, one searches the other, in the
// direction that costs less. A large sphere touches most of the finer spheres that it tests, but it searches
// many bins.
struct LevelSearch {
  int at;
  Way way;
  double cost;  // for each sphere that searches, in nanoseconds
};
struct CrossSearches {
  Partners partners[kMaxLevels];  // of each level, those that search it by its table
  std::vector<LevelSearch> of_level[kMaxLevels];
};
// `summary`: that of which the grid was chosen. fixed_point: of the slots.
CrossSearches plan_cross_searches(const Grid& grid, const Summary& summary, bool fixed_point);

}  // namespace padder::detect::omp
