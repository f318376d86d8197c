// SPDX-License-Identifier: MIT
// A test program that mpirun starts: its tests run on all ranks, and fail where one of these fails.
#pragma once
#include <gtest/gtest.h>
#include <mpi.h>

namespace padder::detect {

inline int my_rank = 0, ranks = 1;

inline int run_tests(int argc, char** argv) {
  int given = 0;
  MPI_Init_thread(&argc, &argv, MPI_THREAD_FUNNELED, &given);
  MPI_Comm_rank(MPI_COMM_WORLD, &my_rank), MPI_Comm_size(MPI_COMM_WORLD, &ranks);
  testing::InitGoogleTest(&argc, argv);
  int failed = RUN_ALL_TESTS(), any = 0;
  MPI_Allreduce(&failed, &any, 1, MPI_INT, MPI_MAX, MPI_COMM_WORLD);
  MPI_Finalize();
  return any;
}

}  // namespace padder::detect
