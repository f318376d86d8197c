// SPDX-License-Identifier: MIT
// How many balls of elements touch each other, from a sample of them. To count them all may take longer than
// to search all spheres: for hollow bodies, or for small ones in a pile. Only .cu files include this.
#pragma once
#include "detect/cuda/bodies/body_arrays.h"

namespace padder::detect::cuda {

// Adds to `touching` how many balls of the sample touch each other. The sample follows from the elements that
// move, where their balls stand, and from nothing else.
void sample_pairs(const BodyView& view, unsigned long long* touching, cudaStream_t stream);
// How many of all elements then touch, about.
double estimated_pairs(std::uint32_t moving, unsigned long long touching);

}  // namespace padder::detect::cuda
