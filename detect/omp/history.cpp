// SPDX-License-Identifier: MIT
#include "detect/omp/history.h"

#include <atomic>
#include <bit>

#include "padding/asset/error.h"

namespace padder::detect::omp {
namespace {

// Where the search for a pair begins in a table of a power of two entries, `mask` + 1.
std::uint64_t first_place(const Pair& p, std::uint64_t mask) { return pair_hash(p.i, p.j) & mask; }

}  // namespace

void History::keep(Records& records) {
  before_.swap(records.pairs);
  count_ = records.count;
  records.count = 0;
}

const std::uint32_t* History::match(const Records& records, int threads) {
  if (count_ >= kNoContact)
    throw Error("the list of the call before has " + std::to_string(count_) +
                " contacts, and a history can number 2^32 - 2: ask for it box by box (CallOptions::own)");
  // Half of the places stay empty, so that a search ends after one or two steps.
  const std::uint64_t places = std::bit_ceil(2 * count_ + 1), mask = places - 1;
  std::uint32_t* table = table_.resize(places, "the table of the contacts before");
  std::uint32_t* found = found_.resize(records.count, "the history of contacts");
  const auto n = static_cast<std::int64_t>(records.count), n_before = static_cast<std::int64_t>(count_);
#pragma omp parallel num_threads(threads)
  {
#pragma omp for schedule(static)
    for (std::int64_t k = 0; k < static_cast<std::int64_t>(places); k++) table[k] = kNoContact;
      // Which place an index gets depends on the threads; what is found does not, because no pair is in a
      // list twice.
#pragma omp for schedule(static)
    for (std::int64_t k = 0; k < n_before; k++) {
      std::uint64_t at = first_place(before_[static_cast<std::uint64_t>(k)], mask);
      for (std::uint32_t empty = kNoContact; !std::atomic_ref(table[at]).compare_exchange_strong(
               empty, static_cast<std::uint32_t>(k), std::memory_order_relaxed);
           empty = kNoContact)
        at = (at + 1) & mask;
    }
#pragma omp for schedule(static)
    for (std::int64_t k = 0; k < n; k++) {
      const Pair p = records.pairs[static_cast<std::uint64_t>(k)];
      std::uint64_t at = first_place(p, mask);
      while (table[at] != kNoContact && before_[table[at]] != p) at = (at + 1) & mask;
      found[k] = table[at];
    }
  }
  return found;
}

}  // namespace padder::detect::omp
