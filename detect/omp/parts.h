// SPDX-License-Identifier: MIT
// Lists that several threads write at once. Their order does not depend on the number of threads: work is
// divided into parts, and the entries of a part follow those of the parts before it. Internal.
#pragma once
#include <omp.h>

#include <algorithm>
#include <cstring>
#include <span>
#include <vector>

#include "detect/omp/paths.h"

namespace padder::detect::omp {

// The list of one thread. It grows as it must; if it cannot, it only counts from then on.
template <class T>
class List {
 public:
  explicit List(Budget& b) : budget_(&b), buffer_(b) {}
  void add(const T& value) {
    total_++;
    if (size_ == buffer_.capacity()) {
      Buffer<T> wider(*budget_);
      if (!wider.try_resize(std::max<std::uint64_t>(2 * size_, 1024))) return;
      if (size_) std::memcpy(wider.data(), buffer_.data(), size_ * sizeof(T));
      buffer_.swap(wider);
    }
    buffer_[size_++] = value;
  }
  void clear() { size_ = total_ = 0; }
  std::uint64_t size() const { return size_; }
  std::uint64_t total() const { return total_; }
  const T* data() const { return buffer_.data(); }

 private:
  Budget* budget_;
  Buffer<T> buffer_;
  std::uint64_t size_ = 0, total_ = 0;
};

template <class T>
class PartLists {
 public:
  // `what`: what a sentence about missing memory calls the entries.
  PartLists(Budget& b, const char* what) : budget_(&b), what_(what) {}

  // Calls work(part, list) for each of `count` parts, with the list of the thread that does it. Throws Error
  // if there was not enough memory for the lists.
  template <class Work>
  void fill(std::uint64_t count, int threads, Work work) {
    while (lists_.size() < static_cast<std::size_t>(threads)) lists_.emplace_back(*budget_);
    for (List<T>& l : lists_) l.clear();
    parts_.resize(count);
#pragma omp parallel num_threads(threads)
    {
      const int t = omp_get_thread_num();
      List<T>& mine = lists_[static_cast<std::size_t>(t)];
#pragma omp for schedule(dynamic, 1)
      for (std::int64_t p = 0; p < static_cast<std::int64_t>(count); p++) {
        const std::uint64_t before = mine.size();
        work(static_cast<std::uint64_t>(p), mine);
        parts_[static_cast<std::size_t>(p)] = {before, mine.size() - before, 0, t};
      }
    }
    std::uint64_t total = 0;
    for (const List<T>& l : lists_) total += l.total();
    size_ = 0;
    for (Part& p : parts_) p.place = size_, size_ += p.count;
    if (size_ < total) throw_memory(*budget_, total * sizeof(T), total, what_);
  }
  std::uint64_t size() const { return size_; }  // of all parts together

  // Calls use(entries, place) for each part, from several threads. `place`: how many entries lie before.
  template <class Use>
  void each(int threads, Use use) const {
#pragma omp parallel for schedule(dynamic, 8) num_threads(threads)
    for (std::int64_t k = 0; k < static_cast<std::int64_t>(parts_.size()); k++) {
      const Part& p = parts_[static_cast<std::size_t>(k)];
      const T* const list = lists_[static_cast<std::size_t>(p.thread)].data();
      use(std::span<const T>(list + p.first, p.count), p.place);
    }
  }

 private:
  struct Part {
    std::uint64_t first, count;  // in the list of the thread
    std::uint64_t place;
    int thread;
  };
  Budget* budget_;
  const char* what_;
  std::vector<List<T>> lists_;  // of each thread
  std::vector<Part> parts_;
  std::uint64_t size_ = 0;
};

}  // namespace padder::detect::omp
