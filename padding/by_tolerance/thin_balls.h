// SPDX-License-Identifier: MIT
// From many balls to the fewest of them that still cover the surface.
#pragma once
#include <cstdint>
#include <vector>

#include "padding/geometry/balls.h"
#include "padding/geometry/surface.h"

namespace padder {

// Chooses the fewest of the given balls such that no surface point lies farther than `gap` outside their
// union, unless it does so with all balls. Returns their indices in ascending order. Lengths are in the
// surface's unit; `effort` is that of CoverOptions. Runs on all threads; the result does not depend on their
// number.
std::vector<std::uint32_t> thin_balls(const Surface& surface, const std::vector<Ball>& balls, double gap,
                                      int effort = 1);

}  // namespace padder
