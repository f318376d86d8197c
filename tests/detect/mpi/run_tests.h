// SPDX-License-Identifier: MIT
// A test program that mpirun starts: its tests run on all ranks, and fail where one of these fails.
#pragma once
#include <gtest/gtest.h>
#include <mpi.h>

#include <vector>

#include "detect/contact.h"

namespace padder::detect {

inline int my_rank = 0, ranks = 1;

inline bool on_any_rank(bool here) {
  int mine = here, any = 0;
  MPI_Allreduce(&mine, &any, 1, MPI_INT, MPI_MAX, MPI_COMM_WORLD);
  return any != 0;
}

inline std::vector<Pair> of_all_ranks(const std::vector<Pair>& mine) {
  std::vector<int> bytes(static_cast<std::size_t>(ranks)), first(bytes.size());
  const int own = static_cast<int>(mine.size() * sizeof(Pair));
  MPI_Allgather(&own, 1, MPI_INT, bytes.data(), 1, MPI_INT, MPI_COMM_WORLD);
  for (std::size_t k = 1; k < bytes.size(); k++) first[k] = first[k - 1] + bytes[k - 1];
  std::vector<Pair> all(static_cast<std::size_t>(first.back() + bytes.back()) / sizeof(Pair));
  MPI_Allgatherv(mine.data(), own, MPI_BYTE, all.data(), bytes.data(), first.data(), MPI_BYTE,
                 MPI_COMM_WORLD);
  return all;
}

inline int run_tests(int argc, char** argv) {
  int given = 0;
  MPI_Init_thread(&argc, &argv, MPI_THREAD_FUNNELED, &given);
  MPI_Comm_rank(MPI_COMM_WORLD, &my_rank), MPI_Comm_size(MPI_COMM_WORLD, &ranks);
  testing::InitGoogleTest(&argc, argv);
  const bool failed = on_any_rank(RUN_ALL_TESTS() != 0);
  MPI_Finalize();
  return failed;
}

}  // namespace padder::detect
