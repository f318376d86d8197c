// SPDX-License-Identifier: MIT
// What every backend asks of an Input. Internal; host code.
#pragma once
#include "detect/detector.h"

namespace padder::detect {

// Spheres of all bodies and the loose ones; 2^64 - 1 if they are more than that.
std::uint64_t sphere_count(const Input& input);
// Body k at its pose, which must lie in host memory.
Body body_at(const Input& input, std::size_t k);

// Are there worlds other than world 0?
bool has_worlds(const Input& input);

}  // namespace padder::detect
