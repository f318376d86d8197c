// SPDX-License-Identifier: MIT
// A list of contacts in the order of its pairs, a run at a time, on memory that does not grow with the list.
#pragma once
#include <algorithm>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "detect/detector.h"

namespace padder::detect {

// Cuts the list into runs of at most `longest` contacts. Each run is sorted, and the runs one after the other
// are the whole list in order, each pair as its key i << 32 | j. No pair may be in the list twice.
//
// By default a run has at most 48 MiB of keys, or a third of the list's if that is more: with the same length
// for every list, twice the contacts would take four times as long.
//
// Only one run is held, at 8 bytes a contact, and is read from the list again: the threads share one pass
// over the pairs for each run, one more that counts, and one that finds the smallest and the largest pair.
class SortedRuns {
 public:
  SortedRuns(std::span<const Pair> pairs, int threads, std::uint64_t longest)
      : pairs_(pairs), threads_(threads), longest_(longest) {}
  SortedRuns(std::span<const Pair> pairs, int threads)
      : SortedRuns(pairs, threads, std::max<std::uint64_t>(kLongest, pairs.size() / 3)) {}
  void each(const std::function<void(std::span<const std::uint64_t>)>& use);

 private:
  static constexpr std::uint64_t kLongest = 3 << 21;
  static constexpr std::uint64_t kBuckets = 1 << 15;
  // Keys from low to high.
  struct Range {
    std::uint64_t low, high;
  };
  // A range in kBuckets parts at most: (key - low) >> shift is the bucket of a key. counts[t][b] is how many
  // contacts of bucket b lie in thread t's part of the list.
  struct Buckets {
    Range range;
    int shift = 0;
    std::vector<std::vector<std::uint64_t>> counts;
    std::uint64_t of(std::uint64_t key) const { return (key - range.low) >> shift; }
    Range keys(std::uint64_t first, std::uint64_t end) const;  // of the buckets from first to end - 1
    std::uint64_t total(std::uint64_t bucket) const;
  };

  template <class Use>
  void scan(const Range& range, const Use& use) const;
  Range all_keys() const;
  Buckets count(const Range& range) const;
  void range(const Range& range, const std::function<void(std::span<const std::uint64_t>)>& use);
  std::span<const std::uint64_t> run(Buckets& buckets, std::uint64_t first, std::uint64_t end);

  std::span<const Pair> pairs_;
  int threads_;
  std::uint64_t longest_;
  std::vector<std::uint64_t> keys_;
};

}  // namespace padder::detect
