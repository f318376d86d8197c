// SPDX-License-Identifier: MIT
// Refits spheres so that none stands out of the body by more than its cap, and no surface stays uncovered.
#pragma once
#include <cstddef>
#include <functional>
#include <vector>

#include "padding/by_depth/fit.h"
#include "padding/geometry/surface.h"

namespace padder {

// How far spheres may stand out.
struct RefitOptions {
  double gap = 0;  // the largest gap that may be left; 0: the largest cap among the balls
  // Called before each round of new balls with the number of parts of the surface that are still open, at
  // most some 100,000 unless the mesh has more triangles or very thin ones. It may throw, which ends the
  // work.
  std::function<void(std::size_t open)> tell;
};

// The paper refits the spheres along edges that an edge finder gives it. This function tests every sphere
// instead. A sphere stands out somewhere (past an edge, through a thin wall, into a slot) when its centre is
// nearer to the surface than its radius less its cap. It becomes the inner medial ball of the same place,
// dilated by the cap. A ball of radius D + h whose centre lies inside, at the distance D from the surface,
// stands out by at most h; so the bound needs no edge finder. Branch and bound over the surface
// (padding/verify/certify.h) then finds what this uncovers, and smaller balls of the same kind cover it,
// until no surface point lies farther than `gap` outside the union.
//
// `body` is the repaired surface, closed or an open sheet. `remeshed` is the surface that the balls were
// fitted to. New balls stand behind the refitted ones and carry the nearest triangle of `remeshed`. Balls for
// which there is no inner ball are dropped. The result does not depend on the number of threads.
std::vector<FittedBall> refit(const Surface& body, const Mesh& remeshed, std::vector<FittedBall> balls,
                              const RefitOptions& options);

}  // namespace padder
