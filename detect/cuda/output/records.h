// SPDX-License-Identifier: MIT
// Small passes over the list of contacts. Internal; only .cu files include this.
#pragma once
#include "detect/cuda/device/memory.h"
#include "detect/cuda/input/device_spheres.h"
#include "detect/cuda/output/output.h"

namespace padder::detect::cuda {

// Adds normals, penetrations and points to pairs that are written already: computed in double, rounded once.
void write_geometry(const DeviceSpheres& source, const Output& output, std::uint64_t count,
                    cudaStream_t stream);

bool has_kernels();  // does this build have code for the current device?

std::uint64_t hash_of_pairs(const Pair* pairs, std::uint64_t count, Buffer<unsigned long long>& sum,
                            cudaStream_t stream);

}  // namespace padder::detect::cuda
