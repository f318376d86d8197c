// SPDX-License-Identifier: MIT
// The batches in which warps take pairs of elements: each pair is in one of them, and no more come than there
// is room for.
#include <gtest/gtest.h>

#include "detect/cuda/bodies/narrow_phase.h"
#include "tests/detect/random.h"

namespace padder::detect::cuda {
namespace {

TEST(BatchesTest, EveryPairIsInOneBatch) {
  std::mt19937_64 random = random_of_new_seed();
  for (int k = 0; k < 2000; k++) {
    const auto warps = static_cast<std::uint32_t>(1 + random() % 4000);
    const std::uint64_t pairs = random() % (1u << (random() % 22));
    const Batches batches(pairs, warps);
    std::uint64_t next = 0;
    for (std::uint64_t b = 0; b < batches.count(); b++) {
      ASSERT_EQ(batches.first(b), next) << pairs << " pairs, " << warps << " warps";
      ASSERT_LE(batches.size(b), kBatch);
      next += batches.size(b);
    }
    ASSERT_GE(next, pairs);
    ASSERT_GE(batches.first(batches.count()), pairs);
    ASSERT_LE(batches.count(), most_batches(pairs, warps)) << pairs << " pairs, " << warps << " warps";
  }
}

// A list that has room for more pairs has room for the batches of fewer, too.
TEST(BatchesTest, FewerPairsAreNoMoreBatchesThanThereIsRoomFor) {
  for (std::uint32_t warps : {1u, 7u, 3168u})
    for (std::uint64_t pairs = 0; pairs < 200'000; pairs += 37)
      ASSERT_LE(Batches(pairs, warps).count(), most_batches(200'000, warps));
}

}  // namespace
}  // namespace padder::detect::cuda
