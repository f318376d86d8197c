// SPDX-License-Identifier: MIT
#include "detect/scene/sorted_runs.h"

#include <array>
#include <bit>
#include <utility>

namespace padder::detect {
namespace {

std::uint64_t key_of(const Pair& pair) { return static_cast<std::uint64_t>(pair.i) << 32 | pair.j; }

// Sorts buckets whose keys are spread about evenly, which is what a thousand contacts of some scene are: a
// counting sort to about two contacts a place, then comparisons within each place.
class BucketSort {
 public:
  // The keys lie from `low` to low + 2^bits - 1.
  void operator()(std::span<std::uint64_t> bucket, std::uint64_t low, int bits) {
    if (bucket.size() <= kFew || bucket.size() > copy_.size()) {
      std::sort(bucket.begin(), bucket.end());
      return;
    }
    const int place_bits = std::min(bits, static_cast<int>(std::bit_width(bucket.size() / 2)));
    const int shift = bits - place_bits;
    const std::span<std::uint32_t> ends(ends_.data(), std::size_t(1) << place_bits);
    std::fill(ends.begin(), ends.end(), 0);
    for (const std::uint64_t key : bucket) ends[(key - low) >> shift]++;
    std::uint32_t total = 0;
    for (std::uint32_t& end : ends) total += std::exchange(end, total);
    std::copy(bucket.begin(), bucket.end(), copy_.begin());
    for (std::size_t k = 0; k < bucket.size(); k++) bucket[ends[(copy_[k] - low) >> shift]++] = copy_[k];
    std::uint32_t begin = 0;
    for (const std::uint32_t end : ends) {
      if (end - begin > 1) std::sort(bucket.begin() + begin, bucket.begin() + end);
      begin = end;
    }
  }

 private:
  static constexpr std::size_t kFew = 32, kMany = 4096;
  std::array<std::uint64_t, kMany> copy_;
  std::array<std::uint32_t, kMany>
      ends_;  // of each place; first how many contacts it has, then its beginning
};

}  // namespace

SortedRuns::Range SortedRuns::Buckets::keys(std::uint64_t first, std::uint64_t end) const {
  const std::uint64_t last = range.high - range.low;  // the last bucket may be cut off by the range
  return {range.low + (first << shift),
          range.low + (of(range.high) < end ? last : std::min(last, (end << shift) - 1))};
}

std::uint64_t SortedRuns::Buckets::total(std::uint64_t bucket) const {
  std::uint64_t sum = 0;
  for (const auto& of_thread : counts) sum += of_thread[bucket];
  return sum;
}

// Calls use(thread, key) for what lies in the range; each thread always sees the same part.
template <class Use>
void SortedRuns::scan(const Range& range, const Use& use) const {
  constexpr std::uint64_t block = 512;
  const std::uint64_t width = range.high - range.low, parts = static_cast<std::uint64_t>(threads_);
#pragma omp parallel for schedule(static, 1) num_threads(threads_)
  for (std::uint64_t part = 0; part < parts; part++) {
    const std::uint64_t end = pairs_.size() * (part + 1) / parts;
    std::uint32_t chosen[block];  // collected without a branch, which the processor would guess wrong
    for (std::uint64_t at = pairs_.size() * part / parts; at < end; at += block) {
      const Pair* const from = &pairs_[at];
      const auto size = static_cast<std::uint32_t>(std::min(block, end - at));
      std::uint32_t count = 0;
      for (std::uint32_t k = 0; k < size; k++) {
        chosen[count] = k;
        count += key_of(from[k]) - range.low <= width;
      }
      for (std::uint32_t c = 0; c < count; c++) use(part, key_of(from[chosen[c]]));
    }
  }
}

SortedRuns::Range SortedRuns::all_keys() const {
  std::uint64_t low = ~std::uint64_t(0), high = 0;
#pragma omp parallel for schedule(static) num_threads(threads_) reduction(min : low) reduction(max : high)
  for (const Pair& pair : pairs_) low = std::min(low, key_of(pair)), high = std::max(high, key_of(pair));
  return {low, high};
}

SortedRuns::Buckets SortedRuns::count(const Range& range) const {
  Buckets b{range, 0, {}};
  while (b.of(range.high) >= kBuckets) b.shift++;
  b.counts.assign(static_cast<std::size_t>(threads_), std::vector<std::uint64_t>(kBuckets));
  scan(range, [&](std::uint64_t part, std::uint64_t key) { b.counts[part][b.of(key)]++; });
  return b;
}

// The contacts of some buckets in order: each thread's part of a bucket has its place, then buckets are
// sorted.
std::span<const std::uint64_t> SortedRuns::run(Buckets& buckets, std::uint64_t first, std::uint64_t end) {
  std::vector<std::uint64_t> ends(end - first);
  std::uint64_t total = 0;
  for (std::uint64_t b = first; b < end; b++) {
    for (auto& of_thread : buckets.counts) total += std::exchange(of_thread[b], total);
    ends[b - first] = total;
  }
  if (keys_.size() < total) keys_.resize(total);
  scan(buckets.keys(first, end),
       [&](std::uint64_t part, std::uint64_t key) { keys_[buckets.counts[part][buckets.of(key)]++] = key; });
#pragma omp parallel num_threads(threads_)
  {
    BucketSort sort;
#pragma omp for schedule(dynamic, 64)
    for (std::uint64_t b = first; b < end; b++) {
      const std::uint64_t begin = b > first ? ends[b - first - 1] : 0;
      sort({keys_.data() + begin, ends[b - first] - begin}, buckets.keys(b, b + 1).low, buckets.shift);
    }
  }
  return {keys_.data(), total};
}

void SortedRuns::range(const Range& keys, const std::function<void(std::span<const std::uint64_t>)>& use) {
  Buckets buckets = count(keys);
  const std::uint64_t size = buckets.of(keys.high) + 1;
  for (std::uint64_t b = 0; b < size;) {
    const std::uint64_t first = b;
    std::uint64_t n = buckets.total(b++);
    if (n > longest_ && buckets.shift > 0) {
      range(buckets.keys(first, b), use);
      continue;
    }
    for (std::uint64_t more; b < size && n + (more = buckets.total(b)) <= longest_; b++) n += more;
    if (n > 0) use(run(buckets, first, b));
  }
}

void SortedRuns::each(const std::function<void(std::span<const std::uint64_t>)>& use) {
  if (pairs_.empty()) return;
  keys_.resize(std::min<std::uint64_t>(pairs_.size(), longest_));
  range(all_keys(), use);
}

}  // namespace padder::detect
