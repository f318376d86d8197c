// SPDX-License-Identifier: MIT
// Compact: the half of the interface between search and output that the host launches after a search of
// stable order. It moves the contacts that spilled (output_slots.h): the n-th one, counted in the order of
// producers, goes to the n-th empty slot or, where there are no more, behind all quotas. It also counts the
// contacts and leaves the sums of groups at zero for the next search. Internal.
#pragma once
#include "detect/cuda/output/output_task.h"

namespace padder::detect::cuda {

// `fused`: the fused search wrote the side list, whose entries it names otherwise. Throws Error.
void compact(const OutputTask& task, bool fused, int processors, cudaStream_t stream);

// The ways to do it, chosen by compact().
void compact_by_octets(const OutputTask& task, bool fused, int processors, cudaStream_t stream);
void compact_by_numbers(const OutputTask& task, bool fused, int processors, cudaStream_t stream);

// Whether the first way serves: it is the faster one where producers are few enough for the shared memory of
// a block.
bool fits_octets(const OutputTask& task, bool fused);

// Producers are taken eight at a time, the last eight perhaps fewer.
__host__ __device__ inline std::uint32_t octets_of(const OutputTask& task) {
  return static_cast<std::uint32_t>((std::uint64_t(task.tiles) + task.units + 7) / 8);
}

}  // namespace padder::detect::cuda
