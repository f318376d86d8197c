// SPDX-License-Identifier: MIT
#include "detect/omp/history.h"

#include <omp.h>

#include <algorithm>
#include <atomic>
#include <bit>

#include "padding/asset/error.h"

namespace padder::detect::omp {
namespace {

// Where the search for a pair begins in a table of a power of two entries, `mask` + 1.
std::uint64_t first_place(const Pair& p, std::uint64_t mask) { return pair_hash(p.i, p.j) & mask; }

// Looks for pairs of a list in another one of about the same order, near the place of the pair before.
class Follower {
 public:
  Follower(const Pair* list, std::uint64_t count, std::uint64_t begin)
      : list_(list), count_(count), next_(begin) {}

  // The index of the pair, or kNoContact if it is not near.
  std::uint32_t find(const Pair& p) {
    if (next_ < count_ && list_[next_] == p) return misses_ = 0, static_cast<std::uint32_t>(next_++);
    // A pair that is new, or was elsewhere, does not move the place. After some of them the lists may have
    // gone apart: then farther away, but seldom, because most of the pairs may be new.
    const bool far = std::has_single_bit(++misses_) && misses_ >= 8;
    const std::uint64_t radius = far ? kFar : kNear, here = next_, first = here - std::min(here, radius),
                        last = std::min(count_, here + radius);
    // Forwards first: a pair that is gone is passed over.
    for (std::uint64_t k = here; k < last; k++)
      if (list_[k] == p) return misses_ = 0, next_ = k + 1, static_cast<std::uint32_t>(k);
    for (std::uint64_t k = first; k < here; k++)
      if (list_[k] == p) return misses_ = 0, next_ = k + 1, static_cast<std::uint32_t>(k);
    return kNoContact;
  }

 private:
  static constexpr std::uint64_t kNear = 16, kFar = 4096;
  const Pair* list_;
  std::uint64_t count_, next_, misses_ = 7;  // the first pair is looked for far away
};

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
  std::uint32_t* found = found_.resize(records.count, "the history of contacts");
  bool* followed = followed_.resize(count_, "the history of contacts");
  const auto n = static_cast<std::int64_t>(records.count), n_before = static_cast<std::int64_t>(count_);
  std::uint64_t matched = 0;
#pragma omp parallel num_threads(threads) reduction(+ : matched)
  {
#pragma omp for schedule(static)
    for (std::int64_t k = 0; k < n_before; k++) followed[k] = false;
    const std::int64_t t = omp_get_thread_num(), all = omp_get_num_threads(), begin = n * t / all,
                       end = n * (t + 1) / all;
    Follower follower(before_.data(), count_, static_cast<std::uint64_t>(n_before * t / all));
    for (std::int64_t k = begin; k < end; k++) {
      found[k] = follower.find(records.pairs[static_cast<std::uint64_t>(k)]);
      if (found[k] != kNoContact) followed[found[k]] = true, matched++;
    }
  }
  if (matched < count_ && matched < records.count)
    find_rest(records, records.count - matched, count_ - matched, threads);
  return found;
}

// The contacts that were not found near the one before them: `left` of them, and `left_before` contacts
// before that none was found to be. The fewer go into a hash table, and the others are looked up.
void History::find_rest(const Records& records, std::uint64_t left, std::uint64_t left_before, int threads) {
  // Whose are in the table, which has indices of 32 bits.
  const bool of_now = left < left_before && records.count < kNoContact;
  const Pair *tabled = of_now ? records.pairs.data() : before_.data(),
             *others = of_now ? before_.data() : records.pairs.data();
  const auto n_tabled = static_cast<std::int64_t>(of_now ? records.count : count_),
             n_others = static_cast<std::int64_t>(of_now ? count_ : records.count);
  std::uint32_t* found = found_.data();
  const auto matched = [&](bool now, std::int64_t k) {
    return now ? found[k] != kNoContact : followed_[static_cast<std::uint64_t>(k)];
  };
  // Half of the places stay empty, so that a search ends after one or two steps.
  const std::uint64_t places = std::bit_ceil(2 * std::min(left, left_before) + 1), mask = places - 1;
  std::uint32_t* table = table_.resize(places, "the table of the contacts before");
#pragma omp parallel num_threads(threads)
  {
#pragma omp for schedule(static)
    for (std::int64_t k = 0; k < static_cast<std::int64_t>(places); k++) table[k] = kNoContact;
      // Which place an index gets depends on the threads; what is found does not, because no pair is in a
      // list twice.
#pragma omp for schedule(static)
    for (std::int64_t k = 0; k < n_tabled; k++) {
      if (matched(of_now, k)) continue;
      std::uint64_t at = first_place(tabled[k], mask);
      for (std::uint32_t empty = kNoContact; !std::atomic_ref(table[at]).compare_exchange_strong(
               empty, static_cast<std::uint32_t>(k), std::memory_order_relaxed);
           empty = kNoContact)
        at = (at + 1) & mask;
    }
#pragma omp for schedule(static)
    for (std::int64_t k = 0; k < n_others; k++) {
      if (matched(!of_now, k)) continue;
      std::uint64_t at = first_place(others[k], mask);
      while (table[at] != kNoContact && tabled[table[at]] != others[k]) at = (at + 1) & mask;
      if (of_now && table[at] != kNoContact)
        found[table[at]] = static_cast<std::uint32_t>(k);
      else if (!of_now)
        found[k] = table[at];
    }
  }
}

}  // namespace padder::detect::omp
