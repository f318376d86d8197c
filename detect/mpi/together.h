// SPDX-License-Identifier: MIT
// Failures among the ranks of MPI: what fails on one rank fails on all, with the same sentence. A rank that
// left alone would let the others wait for it forever.
#pragma once
#include <mpi.h>

#include <functional>

namespace padder::detect {

// Collective. Does `work` on every rank, which must not be collective itself. If it throws on some ranks, all
// ranks throw the Error of the first of them: "rank 2: " and its sentence. If all ranks fail with the same
// sentence, it is theirs without a name. Cost: one message of all ranks to all, of 4 bytes.
void together(MPI_Comm ranks, const std::function<void()>& work);

// Throws Error with MPI's own words unless `code` is MPI_SUCCESS.
void mpi_check(int code, const char* doing);

}  // namespace padder::detect
