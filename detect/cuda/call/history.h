// SPDX-License-Identifier: MIT
// Finds each pair of a list in the list of the call before: Contacts::history. Only .cu files include this.
//
// While spheres move a little, a pair stands in both lists at nearly the same place, if contacts have slots
// of their own. So a block takes a window of the list, puts its pairs into a hash table in shared memory, and
// looks up the pairs of the list before that stand near. What is left of both lists, usually a small part,
// meets in a hash table in global memory. What is found does not depend on where it was found: no pair is in
// a list twice.
#pragma once
#include "detect/cuda/device/memory.h"
#include "detect/detector.h"

namespace padder::detect::cuda {

// Pairs in device memory.
struct PairList {
  const Pair* pairs = nullptr;
  std::uint64_t count = 0;
};

class History {
 public:
  explicit History(MemoryBook& book);

  // For each pair of `now` its index in `before`, or kNoContact; in device memory, valid until the next call.
  // Takes a byte for each pair of `before`, and 16 to 28 for each of `now`. Waits for the device. Throws
  // Error if there is not enough memory, or if `before` is longer than indices of 32 bits can tell.
  const std::uint32_t* match(const PairList& now, const PairList& before, cudaStream_t stream);

 private:
  void begin(std::uint64_t places, std::uint64_t before, cudaStream_t stream);

  // Marks and entries of another call count for nothing: so neither is cleared, unless the number of the call
  // comes to its end or the memory is new.
  std::uint32_t call_ = 0;
  Buffer<std::uint32_t> found_;
  Buffer<std::uint8_t> marks_;          // of each pair of the list before: the call in which it was found
  Buffer<unsigned long long> entries_;  // of the table: the call in the highest byte, below it an index
  Buffer<std::uint32_t> open_;          // the call in which some pair was not found near its place
};

}  // namespace padder::detect::cuda
