// SPDX-License-Identifier: MIT
// Refitting: no sphere stands out of the body by more than its cap height, and nothing stays uncovered.
#pragma once
#include <vector>

#include "padding/by_depth/fit.h"
#include "padding/geometry/surface.h"

namespace padder {

// How far spheres may stand out.
struct RefitOptions {
  double margin = 0;  // caps are lowered by it: how far the body lies outside the part (a wrap's offset)
  double gap = 0;     // largest gap left; 0: the largest cap height among the balls
};

// The paper refits spheres along edges that an edge finder gives it. Here every sphere is asked: one whose
// centre is nearer to the body's surface than its radius less its cap stands out somewhere (past an edge,
// through a thin wall, into a slot), and becomes the inner medial ball of the same place, dilated by the cap.
// A ball of radius D + h whose centre lies inside at the distance D from the surface stands out by at most h,
// so the bound needs no edge finder. What this uncovers is found by branch and bound over the surface
// (padding/verify/certify.h) and covered again by smaller balls of the same kind, until no surface point lies
// farther than `gap` outside the union.
//
// `body` is the repaired surface, closed or an open sheet; `remeshed` the surface the balls were fitted to.
// New balls carry the triangle of `remeshed` nearest to them and come after the refitted ones. Balls for
// which no inner ball exists are dropped. Same result for any number of threads.
std::vector<FittedBall> refit(const Surface& body, const Mesh& remeshed, std::vector<FittedBall> balls,
                              const RefitOptions& options);

}  // namespace padder
