// SPDX-License-Identifier: MIT
#include "detect/mpi/ranks.h"

#include "detect/mpi/together.h"

namespace padder::detect {

Ranks::Ranks(MPI_Comm from) {
  mpi_check(MPI_Comm_dup(from, &all_), "begin");
  MPI_Comm_rank(all_, &rank), MPI_Comm_size(all_, &count);
  MPI_Comm host;
  MPI_Comm_split_type(all_, MPI_COMM_TYPE_SHARED, rank, MPI_INFO_NULL, &host);
  MPI_Comm_rank(host, &rank_on_host), MPI_Comm_size(host, &count_on_host);
  MPI_Comm_free(&host);
}

Ranks::~Ranks() {
  int over = 0;
  MPI_Finalized(&over);
  if (!over) MPI_Comm_free(&all_);
}

}  // namespace padder::detect
