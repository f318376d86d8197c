// SPDX-License-Identifier: MIT
// What happens to elements that met, and to moving ones among static ones (meet.cu). Internal; only .cu
// files include this.
#pragma once
#include "detect/cuda/bodies/bodies.h"

namespace padder::detect::cuda {

// A contact that is found and not yet written: the sphere `slot` of Pieces on this body, or a loose one.
struct Hit {
  std::uint32_t a_body, a_slot, b_body, b_slot;
};

// Pairs of elements that a warp takes at a time; batches that are so few that they are summed up on the fly.
constexpr std::uint32_t kBatch = 8, kMostBatches = 12000;

struct MeetTask {
  BodyView view;
  Source loose;
  Region own;
  bool owns_all = true, stable_order = true;
  const Pair* pairs = nullptr;  // of elements
  std::uint64_t pair_room = 0, room = 0;
  uint4* hits = nullptr;  // Hit
  // For a fixed order: of each hit its batch of pairs and number within that; contacts of each batch, and
  // those before it, unless these are null: then kMostBatches is not exceeded.
  uint2* ranks = nullptr;
  std::uint32_t* batch_counts = nullptr;
  const unsigned long long* batch_places = nullptr;
  BodyCounters* counters = nullptr;
};
void meet(const MeetTask& task, cudaStream_t stream);
void write_hits(const MeetTask& task, const Output& output, cudaStream_t stream);

// Moving elements against the table of static ones: counted, then written behind the pairs that are there.
struct StaticTask {
  BodyView view;
  StaticView table;
  Pair* pairs = nullptr;
  std::uint64_t pair_room = 0;
  std::uint32_t* counts = nullptr;  // of each moving element
  const unsigned long long* places = nullptr;
  BodyCounters* counters = nullptr;
};
void count_static(const StaticTask& task, const Grid& grid, cudaStream_t stream);
void write_static(const StaticTask& task, const Grid& grid, cudaStream_t stream);

}  // namespace padder::detect::cuda
