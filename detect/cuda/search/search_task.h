// SPDX-License-Identifier: MIT
// What the search kernels are given beside the grid. Only .cu files include this.
#pragma once
#include "detect/cuda/output/output_task.h"

namespace padder::detect::cuda {

struct SearchTask : OutputTask {
  Region own;  // the midpoint of a contact must lie inside, unless owns_all
  bool exact = true, owns_all = true;
  bool test_all = false;  // float alone accepts no pair: a filter, an owner or a cell must be asked as well
  float sum_squared = 0;  // of the radii, for SlotKind::equal
  std::int32_t code_limit = 0;  // of codes.h
  unsigned int* next =
      nullptr;  // warps take units from this counter; zero between searches. Null: one unit a warp
};

}  // namespace padder::detect::cuda
