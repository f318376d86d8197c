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

// Pairs of elements that a warp takes at a time: a batch. The last ones are small, so that all warps end at
// about the same time; where pairs are few, all are, so that every warp has work. The counts of up to
// kMostSummedBatches batches fit the shared memory of a block: then each block that writes sums them up for
// itself.
constexpr std::uint32_t kBatch = 32, kSmallBatch = 8, kMostSummedBatches = 12000;
struct Batches {
  std::uint64_t pairs, full;  // full: batches of kBatch pairs, which come first
  std::uint32_t small;        // pairs of a later one

  PADDER_HD Batches(std::uint64_t pairs, std::uint32_t warps) : pairs(pairs) {
    const std::uint64_t each = pairs / warps;
    full = 2 * (pairs / kBatch) > warps ? pairs / kBatch - warps / 2 : 0;
    small = each >= kSmallBatch ? kSmallBatch : each > 1 ? static_cast<std::uint32_t>(each) : 1;
  }
  PADDER_HD std::uint32_t size(std::uint64_t batch) const { return batch < full ? kBatch : small; }
  PADDER_HD std::uint64_t first(std::uint64_t batch) const {
    return batch < full ? batch * kBatch : full * kBatch + (batch - full) * small;
  }
  PADDER_HD std::uint64_t count() const { return full + (pairs - full * kBatch + small - 1) / small; }
};
// No fewer than there are batches of up to so many pairs.
inline std::uint64_t most_batches(std::uint64_t pairs, std::uint32_t warps) {
  return pairs / kBatch + 2 * std::uint64_t(warps) + 2 * kBatch / kSmallBatch;
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
