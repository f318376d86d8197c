// SPDX-License-Identifier: MIT
// The broad phase where it needs no grid of its own: pairs of few elements, each with each, and pairs of an
// element that moves and a static one, which stands in a table. Only .cu files include this.
#pragma once
#include "detect/cuda/bodies/body_input.h"
#include "detect/cuda/device/counters.h"

namespace padder::detect::cuda {

struct BodyCounters {
  Counters broad;                   // pairs of elements that move
  unsigned long long static_pairs;  // pairs with a static element; they stand behind those
  unsigned long long contacts;
  unsigned long long next;     // the first pair that no warp has taken yet
  unsigned long long sampled;  // pairs of a sample that touch (pair_estimate.h)
};

// Pairs are counted, and then written in an order that follows from the elements alone.
struct ElementPairTask {
  BodyView view;
  StaticView table;  // for pairs with static elements
  Pair* pairs = nullptr;
  std::uint64_t pair_room = 0;
  std::uint32_t* counts = nullptr;  // of each moving element
  const unsigned long long* offsets = nullptr;
  BodyCounters* counters = nullptr;
};
// Of elements that move, each with each. The number of pairs goes to BodyCounters::broad.
void count_all_pairs(const ElementPairTask& task, cudaStream_t stream);
void write_all_pairs(const ElementPairTask& task, cudaStream_t stream);
// Moving elements against the table of static ones; written behind the pairs that are there.
void count_static_pairs(const ElementPairTask& task, const Grid& grid, int processors, cudaStream_t stream);
void write_static_pairs(const ElementPairTask& task, const Grid& grid, int processors, cudaStream_t stream);

}  // namespace padder::detect::cuda
