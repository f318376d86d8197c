// SPDX-License-Identifier: MIT
// Carries loads between ranks: each rank has made a load for every box, and gets all of its own box.
// Internal.
#pragma once
#include <mpi.h>

#include <vector>

#include "detect/boxes/assignment.h"

namespace padder::detect {

// What the loads of a scene have in common on all ranks.
struct LoadForm {
  Scalar scalar = Scalar::f32;
  bool has_family = false, has_mask = false, has_static = false;
};

// What an exchange took.
struct Traffic {
  std::uint64_t bytes = 0, messages = 0;  // sent by this rank to others
};

// Collective. loads[k] goes to rank k, and what the others made for this rank is joined in `joined`, in the
// order of the ranks; so the order of the scene is kept. Sizes travel first, all ranks to all. Then only
// ranks that have something for each other send messages, without waiting for one another: one for each
// array, from where it lies to its place in `joined`. The rank's own part is copied meanwhile, by `threads`.
// Throws the same Error on all ranks when one of them has no memory for what comes.
void exchange(MPI_Comm ranks, const LoadForm& form, std::vector<BoxLoad>& loads, BoxLoad& joined, int threads,
              Traffic& traffic);

}  // namespace padder::detect
