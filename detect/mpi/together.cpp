// SPDX-License-Identifier: MIT
#include "detect/mpi/together.h"

#include <exception>
#include <new>
#include <string>

#include "padding/asset/error.h"

namespace padder::detect {
namespace {

std::string sentence_of(const std::function<void()>& work) {
  try {
    work();
  } catch (const std::bad_alloc&) {
    return "there is not enough memory";
  } catch (const std::exception& e) {
    return *e.what() ? e.what() : "it failed without a reason";
  }
  return "";
}

}  // namespace

void together(MPI_Comm ranks, const std::function<void()>& work) {
  std::string sentence = sentence_of(work);
  int rank = 0, count = 1;
  MPI_Comm_rank(ranks, &rank), MPI_Comm_size(ranks, &count);
  const int mine = sentence.empty() ? count : rank;
  int first = count;
  MPI_Allreduce(&mine, &first, 1, MPI_INT, MPI_MIN, ranks);
  if (first == count) return;
  // The first failure as all ranks know it, and whether all have failed in the same way.
  std::string told = sentence;
  int size = static_cast<int>(told.size());
  MPI_Bcast(&size, 1, MPI_INT, first, ranks);
  told.resize(static_cast<std::size_t>(size));
  MPI_Bcast(told.data(), size, MPI_CHAR, first, ranks);
  int same = sentence == told, all = 0;
  MPI_Allreduce(&same, &all, 1, MPI_INT, MPI_MIN, ranks);
  throw Error(all ? told : "rank " + std::to_string(first) + ": " + told);
}

void mpi_check(int code, const char* doing) {
  if (code == MPI_SUCCESS) return;
  char text[MPI_MAX_ERROR_STRING] = "";
  int size = 0;
  MPI_Error_string(code, text, &size);
  throw Error(std::string("MPI cannot ") + doing + ": " + text);
}

}  // namespace padder::detect
