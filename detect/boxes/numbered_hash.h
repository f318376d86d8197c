// SPDX-License-Identifier: MIT
// The hash of contacts that stay on a GPU. Internal.
#pragma once
#include <memory>
#include <span>

#include "detect/detector.h"

namespace padder::detect {

// Keeps its memory on the GPU for the next call.
class NumberedHash {
 public:
  NumberedHash();
  ~NumberedHash();

  // The sum of wide_pair_hash over `count` pairs in the memory of that GPU. They number `ids`, which lie in
  // host memory and are copied for it. Throws Error, also where the GPU has no memory for them.
  std::uint64_t of(int device, const Pair* pairs, std::uint64_t count, std::span<const std::uint64_t> ids);
  // Gives the memory back.
  void release();

 private:
  struct Memory;
  std::unique_ptr<Memory> memory_;
};

}  // namespace padder::detect
