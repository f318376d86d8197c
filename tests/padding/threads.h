// SPDX-License-Identifier: MIT
// For tests that a result is the same for any number of threads.
#pragma once
#include <omp.h>

namespace padder {

// What `work` returns with so many threads.
template <class Work>
auto with_threads(int threads, const Work& work) {
  const int before = omp_get_max_threads();
  omp_set_num_threads(threads);
  auto result = work();
  omp_set_num_threads(before);
  return result;
}

}  // namespace padder
