// SPDX-License-Identifier: MIT
// A list of contacts in the order of its pairs, a run at a time, on memory that does not grow with the list.
#pragma once
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "detect/detector.h"

namespace padder::detect {

// Contact `at` of a list; `key` is i << 32 | j of its pair.
struct KeyedContact {
  std::uint64_t key, at;
};

// Runs of at most `longest` contacts, each sorted, one behind the other the whole list in order; no pair may
// be there twice. Each run takes two passes over the pairs, shared by the threads, and 16 bytes a contact of
// one run are held: for all contacts at once they would be twice the size of the pairs.
class SortedRuns {
 public:
  SortedRuns(std::span<const Pair> pairs, int threads, std::uint64_t longest = 1 << 21)
      : pairs_(pairs), threads_(threads), longest_(longest) {}
  void each(const std::function<void(std::span<const KeyedContact>)>& use);

 private:
  static constexpr std::uint64_t kBuckets = 1 << 15;
  // Keys from low to high, in buckets: (key - low) >> shift is the bucket of one.
  struct Range {
    std::uint64_t low, high;
    int shift;
  };
  using Counts = std::vector<std::vector<std::uint64_t>>;  // of each thread, of each bucket

  template <class Use>
  void scan(const Range& range, const Use& use) const;
  void range(std::uint64_t low, std::uint64_t high,
             const std::function<void(std::span<const KeyedContact>)>& use);
  std::span<const KeyedContact> run(const Range& range, Counts& counts);

  std::span<const Pair> pairs_;
  int threads_;
  std::uint64_t longest_;
  std::vector<KeyedContact> entries_;
};

}  // namespace padder::detect
