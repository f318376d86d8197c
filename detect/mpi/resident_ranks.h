// SPDX-License-Identifier: MIT
// Lets the ResidentDetectors of MPI's ranks share a scene: each rank has a GPU, on which its part of the
// scene lies and its contacts stay.
#pragma once
#include <mpi.h>

#include <memory>

#include "detect/boxes/resident_ranks.h"

namespace padder::detect {

// For ResidentOptions::ranks. Collective; `ranks` is duplicated. Messages go from the memory of a GPU to that
// of another where the MPI library can (as it says itself: MPIX_Query_cuda_support), and through pinned
// memory where not. MPI must have been initialised, with MPI_THREAD_FUNNELED at least, and the thread that
// did so makes the detector's calls.
std::shared_ptr<ResidentRanks> resident_ranks(MPI_Comm ranks);

}  // namespace padder::detect
