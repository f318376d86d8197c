// SPDX-License-Identifier: MIT
// Which sizes of spheres share a level of the grid. Host code. Internal.
#pragma once
#include <vector>

#include "detect/core/grid.h"

namespace padder::detect {

// Consecutive octaves that go to one level. Finer octaves have larger numbers.
struct Run {
  int finest, coarsest;
};
Summary::Octave joined(const Summary& s, const Run& run);  // as one octave

// The mean number of spheres in a bin of this size, if they are spread evenly over their bounds.
double density_of(const Summary::Octave& o, double size);

// The levels that cost least, from the finest. `s` holds spheres, and its octaves are known.
struct LevelRun : Run {
  double density;  // spheres in a bin near others of the level, as probes say; 0 where they say nothing
};
std::vector<LevelRun> divide_into_levels(const Summary& s, Processor processor);

}  // namespace padder::detect
