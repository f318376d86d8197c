// SPDX-License-Identifier: MIT
// The pairs that a thread finds. Internal.
#pragma once
#include <cstring>

#include "detect/omp/paths.h"
#include "detect/omp/search/kernels.h"

namespace padder::detect::omp {

// The most candidates that are tested before the room for hits is checked again.
inline constexpr std::uint32_t kMostCandidates = 8192;

// The hits of one thread. The lists grow as they must. If there is not enough memory, hits are only counted
// from then on, so that the sentence about it can say how much would be needed.
class Hits {
 public:
  static constexpr std::uint64_t kLeast = 4 * (kMostCandidates + kLanes);
  // The buffer must have room for kLeast slots.
  Hits(Buffer<std::uint32_t>& buffer, Budget& budget) : buffer_(buffer), budget_(budget) {}

  // Room for kMostCandidates hits after those that are kept.
  HitLists room() {
    if (size_ + kMostCandidates + kLanes > buffer_.capacity() / 2) grow();
    return {buffer_.data() + size_, buffer_.data() + buffer_.capacity() / 2 + size_};
  }
  void keep(std::uint64_t n) {
    total_ += n;
    if (!counting_) size_ += n;
  }
  std::uint64_t size() const { return size_; }
  std::uint64_t total() const { return total_; }
  bool counting() const { return counting_; }

 private:
  void grow() {
    Buffer<std::uint32_t> wider(budget_);
    if (!wider.try_resize(2 * buffer_.capacity())) {
      counting_ = true, size_ = 0;
      return;
    }
    for (std::uint64_t list = 0; list < 2; list++)
      std::memcpy(wider.data() + list * wider.capacity() / 2, buffer_.data() + list * buffer_.capacity() / 2,
                  size_ * sizeof(std::uint32_t));
    buffer_.swap(wider);
  }
  Buffer<std::uint32_t>& buffer_;
  Budget& budget_;
  std::uint64_t size_ = 0, total_ = 0;
  bool counting_ = false;
};

}  // namespace padder::detect::omp
