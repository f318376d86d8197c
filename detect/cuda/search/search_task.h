// SPDX-License-Identifier: MIT
// What the search kernels are given beside the grid. Only .cu files include this.
#pragma once
#include "detect/cuda/output/output_task.h"

namespace padder::detect::cuda {

// A bit of the number of contacts that a warp found: they are more than its queue holds, and are searched for
// again when their slots are known.
inline constexpr std::uint32_t kQueueOverflow = 1u << 31;

// The list of long_rows.h. Of each part two words, in arrays of their own: its sphere and its first
// candidate, and the rest.
struct LongRows {
  Word *key = nullptr, *value = nullptr;
  std::uint64_t room = 0;  // parts
  int index_bits = 32;     // that the index of a sphere takes
  // For a stable order: the same two arrays, sorted; contacts found by each part, and by those before it.
  Word *sorted = nullptr, *before = nullptr;
  std::uint32_t* found = nullptr;
};

// An OutputTask says what is searched and where contacts go; this adds how candidates are tested.
struct SearchTask : OutputTask {
  // A contact is reported if its midpoint lies in `own`, unless owns_all. What float finds within `inner`
  // lies in `own` for sure, and what it finds outside of `outer` does not (exact_test.h).
  Region own;
  struct FloatBox {
    float low[3], high[3];
    __device__ __forceinline__ bool holds(const float (&at)[3], float reach) const {
      bool within = true;
#pragma unroll
      for (int k = 0; k < 3; k++) within = within && at[k] - reach >= low[k] && at[k] + reach < high[k];
      return within;
    }
  } inner, outer;
  bool exact = true, owns_all = true;
  double margin = 0;     // a pair counts whose gap is at most this
  float margin_f32 = 0;  // the same, where slots are floats; fixed-point slots are of grown spheres
  // Float alone accepts no pair: the filter, the owner or the bin must be asked as well.
  bool test_all = false;
  bool only_owner = false;  // it is the owner alone that must be asked
  // Fixed-point places repeat each 256 bins, and a bucket of a hashed level holds spheres that are as far
  // from each other: what touches by them must be asked in double.
  bool places_repeat = false;
  // What float_test() adds to squares, and how far from that it is not sure, both relative (exact_test.h).
  float wide = 0, near = 0;
  float sum = 0, sum_squared = 0;  // of the radii and the margin together, for SlotKind::equal
  std::int32_t code_limit = 0;     // of codes.h
  // Warps take units, or work of the fused search, from this counter. Zero between searches; null: one unit a
  // warp.
  unsigned int* next = nullptr;
  // Long rows are deferred to a kernel of their own; else they are searched as they come.
  bool defers = false;
  LongRows long_rows;
};

}  // namespace padder::detect::cuda
