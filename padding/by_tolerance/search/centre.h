// SPDX-License-Identifier: MIT
// Moves the balls of a cover so that they cover the surface between the points, too.
#pragma once
#include "padding/by_tolerance/search/attempt.h"

namespace padder {

// Moves each ball to the middle of what it alone covers: of the places that are tried, to that where the
// point nearest to slipping out lies deepest inside. An open point counts as the nearest ball's own, so that
// ball moves over it. `always` tells of each chosen ball whether it moves in any case: the others move only
// while they have such a point. Returns how many points stay open. Runs on all threads; the result does not
// depend on their number.
std::size_t centre(Attempt& attempt, const BallGrower& grower, const std::vector<char>& always);

}  // namespace padder
