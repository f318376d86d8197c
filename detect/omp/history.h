// SPDX-License-Identifier: MIT
// Finds each pair of a list in the list of the call before: Contacts::history. Internal.
//
// Where spheres move little between calls, both lists have about the same order. So a pair is first looked
// for beside the place of the pair before it; only what is not there goes through a hash table.
#pragma once
#include "detect/omp/paths.h"

namespace padder::detect::omp {

class History {
 public:
  explicit History(Budget& b) : before_(b), followed_(b), table_(b), found_(b) {}

  // Takes the pairs of the last call out of `records`, before a call overwrites them.
  void keep(Records& records);

  // For each pair of `records` its index in the list that was kept, or kNoContact. The array stays valid
  // until the next call. Takes time and memory in proportion to both lists. Throws Error if there is not
  // enough memory, or if the list before is longer than indices of 32 bits can tell.
  const std::uint32_t* match(const Records& records, int threads);

 private:
  void find_rest(const Records& records, std::uint64_t left, std::uint64_t left_before, int threads);

  Buffer<Pair> before_;
  std::uint64_t count_ = 0;      // of the pairs in before_
  Buffer<bool> followed_;        // of each: is it one of the contacts now
  Buffer<std::uint32_t> table_;  // with open addressing: indices in one of the lists, or kNoContact
  Buffer<std::uint32_t> found_;
};

}  // namespace padder::detect::omp
