// SPDX-License-Identifier: MIT
#include "detect/scene/sorted_runs.h"

#include <algorithm>

namespace padder::detect {

// Calls use(thread, bucket, key, contact) for what lies in the range; each thread always sees the same part.
template <class Use>
void SortedRuns::scan(const Range& range, const Use& use) const {
  const std::uint64_t width = range.high - range.low, parts = static_cast<std::uint64_t>(threads_);
#pragma omp parallel for schedule(static, 1) num_threads(threads_)
  for (std::uint64_t part = 0; part < parts; part++)
    for (std::uint64_t k = pairs_.size() * part / parts; k < pairs_.size() * (part + 1) / parts; k++) {
      const std::uint64_t key = static_cast<std::uint64_t>(pairs_[k].i) << 32 | pairs_[k].j;
      if (key - range.low <= width) use(part, (key - range.low) >> range.shift, key, k);
    }
}

// The contacts of the range in order: each thread's part of a bucket has its place, then buckets are sorted.
std::span<const KeyedContact> SortedRuns::run(const Range& range, Counts& counts) {
  std::vector<std::uint64_t> ends(kBuckets);
  std::uint64_t total = 0;
  for (std::uint64_t b = 0; b < kBuckets; b++) {
    for (auto& of_thread : counts) {
      const std::uint64_t n = of_thread[b];
      of_thread[b] = total, total += n;
    }
    ends[b] = total;
  }
  entries_.resize(total);
  scan(range, [&](std::uint64_t part, std::uint64_t bucket, std::uint64_t key, std::uint64_t at) {
    entries_[counts[part][bucket]++] = {key, at};
  });
#pragma omp parallel for schedule(dynamic, 256) num_threads(threads_)
  for (std::uint64_t b = 0; b < kBuckets; b++)
    std::sort(entries_.begin() + static_cast<std::ptrdiff_t>(b ? ends[b - 1] : 0),
              entries_.begin() + static_cast<std::ptrdiff_t>(ends[b]),
              [](const KeyedContact& x, const KeyedContact& y) { return x.key < y.key; });
  return entries_;
}

void SortedRuns::range(std::uint64_t low, std::uint64_t high,
                       const std::function<void(std::span<const KeyedContact>)>& use) {
  int shift = 0;  // so that the range has kBuckets at most
  while ((high - low) >> shift >= kBuckets) shift++;
  const Range r{low, high, shift};
  Counts counts(static_cast<std::size_t>(threads_), std::vector<std::uint64_t>(kBuckets));
  scan(r, [&](std::uint64_t part, std::uint64_t bucket, std::uint64_t, std::uint64_t) {
    counts[part][bucket]++;
  });
  std::vector<std::uint64_t> of_bucket(kBuckets);
  std::uint64_t total = 0;
  for (std::uint64_t b = 0; b < kBuckets; b++) {
    for (const auto& of_thread : counts) of_bucket[b] += of_thread[b];
    total += of_bucket[b];
  }
  // A single key cannot be divided further.
  if (total <= longest_ || low == high) {
    if (total > 0) use(run(r, counts));
    return;
  }
  Counts().swap(counts);
  for (std::uint64_t b = 0; b < kBuckets;) {
    const std::uint64_t first = b;
    std::uint64_t n = of_bucket[b++];
    while (b < kBuckets && n + of_bucket[b] <= longest_) n += of_bucket[b++];
    const std::uint64_t last = b == kBuckets ? high - low : std::min(high - low, (b << shift) - 1);
    if (n > 0) range(low + (first << shift), low + last, use);
  }
}

void SortedRuns::each(const std::function<void(std::span<const KeyedContact>)>& use) {
  entries_.reserve(std::min<std::uint64_t>(pairs_.size(), longest_));
  range(0, ~std::uint64_t(0), use);
}

}  // namespace padder::detect
