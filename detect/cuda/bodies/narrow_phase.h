// SPDX-License-Identifier: MIT
// The narrow phase of bodies: the spheres of elements whose balls touch. Only .cu files include this.
#pragma once
#include "detect/cuda/bodies/element_pairs.h"
#include "detect/cuda/device/stage_clock.h"
#include "detect/cuda/output/output.h"

namespace padder::detect::cuda {

// A contact that is found and not yet written: the sphere `slot` of Pieces on this body, or a loose one.
struct Hit {
  std::uint32_t a_body, a_slot, b_body, b_slot;
};

// Pairs of elements that a warp takes at a time: a batch. Where pairs are few, batches are smaller, so that
// every warp has work. The counts of up to kMostSummedBatches batches fit the shared memory of a block: then
// each block that writes sums them up for itself.
constexpr std::uint32_t kBatch = 32, kMostSummedBatches = 12000;
PADDER_HD std::uint32_t batch_size(std::uint64_t pairs, std::uint32_t warps) {
  const std::uint64_t each = pairs / warps;
  return each >= kBatch ? kBatch : each > 1 ? static_cast<std::uint32_t>(each) : 1;
}
// No fewer than there are batches of up to so many pairs.
inline std::uint64_t most_batches(std::uint64_t pairs, std::uint32_t warps) {
  return pairs / kBatch + 2 * std::uint64_t(warps) + 1;
}

struct NarrowPhaseTask {
  BodyView view;
  DeviceSpheres loose;
  Region own;
  double margin = 0;
  bool owns_all = true, stable_order = true;
  const Pair* pairs = nullptr;  // of elements
  std::uint64_t pair_room = 0, room = 0;
  std::uint32_t finder_warps = 0;  // that find contacts; their blocks are full
  // For a stable order: the contacts; of each its batch and its number within the batch; the contacts of each
  // batch; the contacts before each batch, or null where no more than kMostSummedBatches are possible.
  uint4* hits = nullptr;  // Hit
  uint2* ranks = nullptr;
  std::uint32_t* batch_counts = nullptr;
  const unsigned long long* batch_offsets = nullptr;
  BodyCounters* counters = nullptr;
};

// What the narrow phase needs beside its task.
struct NarrowPhaseMemory {
  explicit NarrowPhaseMemory(MemoryBook& book);
  Buffer<uint2> ranks;
  Buffer<std::uint32_t> batch_counts;
  Buffer<unsigned long long> batch_offsets;
  Buffer<unsigned char> scratch;
};
// Counts the contacts and writes as many as there is room for. The task says everything but what lies in the
// memory.
void narrow_phase(NarrowPhaseTask task, const Output& output, NarrowPhaseMemory& memory, int processors,
                  cudaStream_t stream, StageClock& clock);
std::uint32_t finder_warps(int processors);

}  // namespace padder::detect::cuda
