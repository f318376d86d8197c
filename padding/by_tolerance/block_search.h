// SPDX-License-Identifier: MIT
// Local search over a large cover in blocks: near one another in memory, and in parallel.
#pragma once
#include "padding/asset/mesh.h"
#include "padding/by_tolerance/set_cover.h"

namespace padder {

// How hard to search.
struct BlockSearch {
  std::size_t block = 200;  // sets of the cover in a block, at most
  double steps = 100;       // exchanges for each set of the cover
  std::uint64_t seed = 1;   // another seed cuts the blocks elsewhere, so that seams move from call to call
};

// A cover that is no larger, by SetCover::improve on blocks of neighbouring sets. `places` says where each
// set lies. A row belongs to one block among those whose sets cover it, and that block keeps it covered: the
// blocks' covers together are a cover of all. Runs on all threads; the same result for any number of them.
std::vector<std::uint32_t> improve_in_blocks(const Sets& sets, std::size_t rows,
                                             const std::vector<Point>& places,
                                             std::vector<std::uint32_t> cover, const BlockSearch& search);

}  // namespace padder
