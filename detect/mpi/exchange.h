// SPDX-License-Identifier: MIT
// Carries loads between ranks: each rank has made a load for every box, and gets all of its own box.
// Internal.
#pragma once
#include <mpi.h>

#include <vector>

#include "detect/boxes/assignment.h"
#include "detect/mpi/messages.h"

namespace padder::detect {

// What the loads of a scene have in common on all ranks.
struct LoadForm {
  Scalar scalar = Scalar::f32;
  bool has_family = false, has_mask = false, has_static = false, has_world = false;
  std::uint32_t world_of_all = 0;  // unless `has_world`
};

// How much of each kind a load has.
struct LoadSizes {
  unsigned long long loose = 0, bodies = 0, body_spheres = 0;
};

// Carries loads between ranks: sizes first, all ranks to all. Then only ranks that have something for each
// other send messages, without waiting for one another: one for each array, from where it lies to its place
// in the load of the rank that gets it. What a rank has for its own box is filled in there, and is not moved.
class Exchange {
 public:
  // Collective. sending[k]: of this rank's load for rank k.
  Exchange(MPI_Comm ranks, const LoadForm& form, std::vector<LoadSizes> sending);

  // The room that this rank's own load needs when it is filled.
  LoadRoom room() const;

  // Collective. loads[k] goes to rank k, and what the others made for this rank comes into its own load, in
  // the order of the ranks; so the order of the scene is kept. Throws the same Error on all ranks when one of
  // them has no memory for it.
  Traffic run(std::vector<BoxLoad>& loads) const;

 private:
  void complete(BoxLoad& load) const;

  MPI_Comm ranks_;
  LoadForm form_;
  std::size_t me_ = 0;
  std::vector<LoadSizes> sending_, coming_,
      begin_;      // for each rank; `begin_`: where it begins in our own load
  LoadSizes all_;  // of our own load in the end
};

}  // namespace padder::detect
