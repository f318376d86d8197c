// SPDX-License-Identifier: MIT
// The ranks of MPI that work together. Internal.
#pragma once
#include <mpi.h>

namespace padder::detect {

// A communicator of our own, so that no message of the caller is taken for one of ours.
class Ranks {
 public:
  explicit Ranks(MPI_Comm from);
  ~Ranks();
  Ranks(const Ranks&) = delete;
  Ranks& operator=(const Ranks&) = delete;
  operator MPI_Comm() const { return all_; }  // NOLINT(google-explicit-constructor)

  int rank = 0, count = 1, rank_on_host = 0, count_on_host = 1;

 private:
  MPI_Comm all_ = MPI_COMM_NULL;
};

}  // namespace padder::detect
