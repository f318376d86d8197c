// SPDX-License-Identifier: MIT
// Finds each pair of a list in the list of the call before: Contacts::history. Only .cu files include this.
//
// While spheres move a little, a pair stands in both lists at nearly the same place, if contacts have slots
// of their own. A block takes a window of the list and compares each pair with the one that had its index.
// Pairs that differ go to a hash table in shared memory, in which the block looks up the pairs of the list
// before that stood near. Where the window stood it learns from samples, a few pairs chosen by their hash,
// whose indices each call leaves for the next. What is left of both lists, usually a small part, meets in a
// hash table in global memory. What is found does not depend on where it was found: no pair is in a list
// twice.
//
// The kernels read the lengths of both lists on the device. So they follow the search in its recording, and
// the host waits once.
#pragma once
#include "detect/cuda/device/memory.h"
#include "detect/detector.h"

namespace padder::detect::cuda {

// Pairs in device memory.
struct PairList {
  const Pair* pairs = nullptr;
  std::uint64_t count = 0;
};

// What the kernels are given.
struct HistoryTask {
  const Pair *now = nullptr, *before = nullptr;
  std::uint32_t* found = nullptr;
  std::uint64_t capacity = 0;                 // pairs that `now` and `found` have room for
  const unsigned long long* count = nullptr;  // pairs of `now`, in device memory; above the capacity: so many
  // The same is kept for the next call, and was kept by the call before.
  unsigned long long *count_kept = nullptr, *count_before = nullptr;
  void* table = nullptr;  // a power of two of places
  std::uint64_t mask = 0;
  std::uint32_t index_bits = 0;   // of an entry; 32: it has 64 bits, else 32
  std::uint8_t* marks = nullptr;  // of each pair of `before`: the pass in which a window found it
  std::uint32_t* pass = nullptr;  // the number of the pass, and what goes with it
  // Indices of samples, by their hash: hints, of which any may be wrong.
  std::uint32_t* samples_now = nullptr;
  const std::uint32_t* samples_before = nullptr;
  std::uint32_t sample_mask = 0;
  friend bool operator==(const HistoryTask&, const HistoryTask&) = default;
};

class History {
 public:
  explicit History(MemoryBook& book);

  // The call before found `before`. Throws Error if that is longer than indices of 32 bits can tell.
  void begin(const PairList& before, cudaStream_t stream);

  // To match a list that is not there yet: what to enqueue behind the search that writes it. It stays the
  // same from call to call while nothing is allocated, but for the two memories of lists that take turns.
  // Takes 4 bytes for each pair of the capacity, and 6 to 12 for each of the list before. Throws Error if
  // there is not enough memory.
  HistoryTask task(const Pair* now, std::uint64_t capacity, const unsigned long long* count);
  void begin_pass(const HistoryTask& task, cudaStream_t stream);  // before anything of the pass is enqueued
  static void enqueue(const HistoryTask& task, int processors, cudaStream_t stream);

  // The same at once, for a list whose length the host knows. Waits for the device.
  void match(const PairList& now, int processors, cudaStream_t stream);

  // Of each of the `count` pairs its index in the list before, or kNoContact; in device memory, valid until
  // the next call.
  const std::uint32_t* end(std::uint64_t count);

 private:
  void reserve(std::uint64_t capacity);

  Buffer<std::uint32_t> found_;
  // Entries and marks of another pass count for nothing. So they are cleared only when the numbers of passes
  // that they have room for come to their end.
  Buffer<unsigned char> table_;
  std::uint64_t places_ = 0;
  Buffer<std::uint8_t> marks_;
  Buffer<std::uint32_t> pass_, samples_;
  std::uint32_t pass_number_ = 0, last_pass_ = 0;  // 0: what was allocated holds anything
  // The lengths of the list and of the one before, which take turns, and what is known of them.
  Buffer<unsigned long long> counts_;
  std::uint64_t known_[2];
  int now_ = 0;
  PairList before_;
};

}  // namespace padder::detect::cuda
