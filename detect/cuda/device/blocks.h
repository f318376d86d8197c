// SPDX-License-Identifier: MIT
// How many blocks a kernel is launched with. Only .cu files include this.
#pragma once
#include <algorithm>
#include <cstdint>

namespace padder::detect::cuda {

// A thread for each of n, and at least one block.
inline unsigned blocks_for(std::uint64_t n, unsigned threads) {
  return static_cast<unsigned>(std::max<std::uint64_t>((n + threads - 1) / threads, 1));
}
// For a kernel whose threads take one of n after the other: no more blocks than fill any GPU several times.
inline unsigned blocks_of_loop(std::uint64_t n, unsigned threads) {
  return blocks_for(std::min(n, std::uint64_t(4224) * threads), threads);
}

}  // namespace padder::detect::cuda
