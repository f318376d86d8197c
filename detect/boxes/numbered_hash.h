// SPDX-License-Identifier: MIT
// The hash of contacts that stay on a GPU. Internal.
#pragma once
#include <span>

#include "detect/detector.h"

namespace padder::detect {

// The sum of wide_pair_hash over `count` pairs in the memory of that GPU. They number `ids`, which lie in
// host memory and are copied for it. Throws Error, also where the GPU has no memory for them.
std::uint64_t hash_of_numbered_pairs(int device, const Pair* pairs, std::uint64_t count,
                                     std::span<const std::uint64_t> ids);

}  // namespace padder::detect
