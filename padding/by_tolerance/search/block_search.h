// SPDX-License-Identifier: MIT
// Local search over a large cover, block by block: a block fits into the cache, and blocks run in parallel.
#pragma once
#include "padding/asset/mesh.h"
#include "padding/by_tolerance/search/set_cover.h"

namespace padder {

// How hard to search.
struct BlockSearch {
  std::size_t block = 200;  // at most so many sets of the cover in a block
  double steps = 100;       // exchanges for each set of the cover
  std::uint64_t seed = 1;   // change it from call to call: then the borders of the blocks lie elsewhere
};

// Runs SetCover::improve on blocks of neighbouring sets and returns a cover that is no larger. `centers` says
// where each set lies. Each element belongs to one of the blocks whose sets contain it, and this block keeps
// it covered; so the covers of the blocks together cover everything. Runs on all threads; the result does not
// depend on their number. What the sets of `kept` contain is covered by them: they stay, and are not
// returned.
std::vector<std::uint32_t> improve_in_blocks(const Sets& sets, std::size_t elements,
                                             const std::vector<Point>& centers,
                                             std::vector<std::uint32_t> cover, const BlockSearch& search,
                                             const std::vector<std::uint32_t>& kept = {});

}  // namespace padder
