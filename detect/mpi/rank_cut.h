// SPDX-License-Identifier: MIT
// Cuts space into a box for each rank by Zoltan's recursive coordinate bisection. Internal.
#pragma once
#include <mpi.h>

#include <vector>

#include "detect/boxes/cut.h"

namespace padder::detect {

// Collective. Each rank gives some of the points, with finite coordinates; box k of the tree is that of rank
// k. Boxes hold nearly equal weights; without any points all but one are empty. All ranks get the same tree.
BoxTree cut_among_ranks(MPI_Comm ranks, const std::vector<WeightedPoint>& points);

}  // namespace padder::detect
