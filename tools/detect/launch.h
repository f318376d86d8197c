// SPDX-License-Identifier: GPL-3.0-or-later
// Whether a launcher of MPI (mpirun, srun) has started this process as one of several.
#pragma once
#include <cstdlib>
#include <utility>

namespace padder::tool {

struct Launch {
  int rank = 0, ranks = 0;  // 0 ranks: no launcher
};

// From the environment, so that a program that was started by hand does not have to load and start MPI.
inline Launch launch_of_environment() {
  constexpr std::pair<const char*, const char*> names[] = {{"OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"},
                                                           {"PMI_RANK", "PMI_SIZE"},
                                                           {"PMIX_RANK", "SLURM_NTASKS"}};
  for (const auto& [rank, ranks] : names) {
    const char *const r = std::getenv(rank), *const n = std::getenv(ranks);
    if (r && n) return {std::atoi(r), std::atoi(n)};
  }
  return {};
}

}  // namespace padder::tool
