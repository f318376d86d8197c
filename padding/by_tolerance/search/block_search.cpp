// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/search/block_search.h"

#include <algorithm>

#include "padding/geometry/indices.h"
#include "padding/geometry/random.h"

namespace padder {
namespace {

constexpr std::uint32_t kNoOwner = 0xffffffffu;

// Cuts the cover into blocks: across the longest side of the box of its centres, near the middle, again and
// again.
void cut(std::vector<std::uint32_t>::iterator begin, std::vector<std::uint32_t>::iterator end,
         const std::vector<Point>& centers, std::size_t largest, Random& random,
         std::vector<std::vector<std::uint32_t>>& blocks) {
  const auto n = static_cast<std::size_t>(end - begin);
  if (n <= largest) {
    blocks.emplace_back(begin, end);
    return;
  }
  Box box;
  for (auto k = begin; k != end; ++k) box.add(centers[*k]);
  int axis;
  (box.high - box.low).maxCoeff(&axis);
  const auto middle =
      begin + static_cast<std::ptrdiff_t>(static_cast<double>(n) * (0.35 + 0.3 * random.uniform()));
  std::nth_element(begin, middle, end, [&](auto s, auto t) {
    const double x = centers[s][axis], y = centers[t][axis];
    return x != y ? x < y : s < t;
  });
  cut(begin, middle, centers, largest, random, blocks);
  cut(middle, end, centers, largest, random, blocks);
}

// A set cover problem with its own numbers.
struct LocalProblem {
  Sets sets;
  std::vector<std::uint32_t> global;  // for each set, its number outside; ascending
  std::uint32_t elements = 0;
};

// For each block the problem of the elements that it owns, and of the sets that have any of them. The
// elements of a block are numbered as they come.
std::vector<LocalProblem> problems_of(const Sets& sets, const std::vector<std::uint32_t>& owner,
                                      std::size_t blocks) {
  std::vector<LocalProblem> problems(blocks);
  std::vector<std::uint32_t> number(owner.size());
  for (std::size_t r = 0; r < owner.size(); r++)
    if (owner[r] != kNoOwner) number[r] = problems[owner[r]].elements++;
  std::vector<std::uint32_t> touched;
  for (std::uint32_t s = 0; s < sets.size(); s++) {
    touched.clear();
    for (const auto r : sets[s]) {
      if (owner[r] == kNoOwner) continue;
      LocalProblem& local = problems[owner[r]];
      if (local.global.empty() || local.global.back() != s)
        local.global.push_back(s), touched.push_back(owner[r]);
      local.sets.elements.push_back(number[r]);
    }
    for (const auto b : touched) problems[b].sets.begin.push_back(problems[b].sets.elements.size());
  }
  return problems;
}

}  // namespace

std::vector<std::uint32_t> improve_in_blocks(const Sets& sets, std::size_t elements,
                                             const std::vector<Point>& centers,
                                             std::vector<std::uint32_t> cover, const BlockSearch& search,
                                             const std::vector<std::uint32_t>& kept) {
  Random random(search.seed);
  std::vector<std::vector<std::uint32_t>> blocks;
  cut(cover.begin(), cover.end(), centers, search.block, random, blocks);
  std::vector<std::uint32_t> owner(elements, kNoOwner);
  for (std::uint32_t b = 0; b < blocks.size(); b++)
    for (auto s : blocks[b])
      for (auto r : sets[s])
        if (owner[r] == kNoOwner) owner[r] = b;
  for (auto s : kept)
    for (auto r : sets[s]) owner[r] = kNoOwner;

  const std::vector<LocalProblem> problems = problems_of(sets, owner, blocks.size());
#pragma omp parallel for schedule(dynamic, 1) if (blocks.size() > 1)
  for (std::uint32_t b = 0; b < blocks.size(); b++) {
    const auto& [local, global, size] = problems[b];
    std::vector<std::uint32_t> start;
    for (auto s : blocks[b]) {
      const auto at = std::lower_bound(global.begin(), global.end(), s);
      if (at != global.end() && *at == s) start.push_back(static_cast<std::uint32_t>(at - global.begin()));
    }
    SetCover block(local, size);
    block.greedy(start);
    block.improve(static_cast<std::uint64_t>(search.steps * static_cast<double>(block.best().size())),
                  (search.seed << 32) + b);
    blocks[b].clear();
    for (auto s : block.best()) blocks[b].push_back(global[s]);
  }
  cover.clear();
  for (const auto& block : blocks) cover.insert(cover.end(), block.begin(), block.end());
  sort_unique(cover);
  return cover;
}

}  // namespace padder
