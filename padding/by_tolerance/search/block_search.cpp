// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/search/block_search.h"

#include <algorithm>
#include <numeric>
#include <span>

#include "padding/geometry/random.h"

namespace padder {
namespace {

constexpr std::uint32_t no_owner = 0xffffffffu;

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

// For each element, the sets that contain it.
struct Transpose {
  std::vector<std::uint64_t> begin;
  std::vector<std::uint32_t> sets;

  Transpose(const Sets& of, std::size_t elements) : begin(elements + 1, 0), sets(of.elements.size()) {
    for (auto r : of.elements) begin[r + 1]++;
    std::partial_sum(begin.begin(), begin.end(), begin.begin());
    std::vector<std::uint64_t> at(begin.begin(), begin.end() - 1);
    for (std::uint32_t s = 0; s < of.size(); s++)
      for (auto r : of[s]) sets[at[r]++] = s;
  }

  std::span<const std::uint32_t> operator[](std::uint32_t element) const {
    return {sets.data() + begin[element], sets.data() + begin[element + 1]};
  }
};

// A set cover problem with its own numbers.
struct LocalProblem {
  Sets sets;
  std::vector<std::uint32_t> global;  // for each set, its number outside; ascending
};

// The problem of the elements `own`, which are numbered as they come, and of the sets that have any of them.
// `count` is scratch: zero for each set, before and after. Counting takes a pass more than sorting the pairs
// of a set and an element would, and less time.
LocalProblem problem_of(const std::vector<std::uint32_t>& own, const Transpose& transpose,
                        std::vector<std::uint32_t>& count) {
  LocalProblem local;
  for (const auto r : own)
    for (const auto s : transpose[r])
      if (count[s]++ == 0) local.global.push_back(s);
  std::sort(local.global.begin(), local.global.end());
  for (const auto s : local.global) local.sets.begin.push_back(local.sets.begin.back() + count[s]);
  for (std::uint32_t k = 0; k < local.global.size(); k++) count[local.global[k]] = k;
  std::vector<std::uint64_t> next(local.sets.begin);
  local.sets.elements.resize(local.sets.begin.back());
  for (std::uint32_t k = 0; k < own.size(); k++)
    for (const auto s : transpose[own[k]]) local.sets.elements[next[count[s]]++] = k;
  for (const auto s : local.global) count[s] = 0;
  return local;
}

}  // namespace

std::vector<std::uint32_t> improve_in_blocks(const Sets& sets, std::size_t elements,
                                             const std::vector<Point>& centers,
                                             std::vector<std::uint32_t> cover, const BlockSearch& search) {
  const Transpose transpose(sets, elements);
  Random random(search.seed);
  std::vector<std::vector<std::uint32_t>> blocks;
  cut(cover.begin(), cover.end(), centers, search.block, random, blocks);
  std::vector<std::uint32_t> owner(elements, no_owner);
  for (std::uint32_t b = 0; b < blocks.size(); b++)
    for (auto s : blocks[b])
      for (auto r : sets[s])
        if (owner[r] == no_owner) owner[r] = b;

  std::vector<std::uint32_t> count(sets.size(), 0);
#pragma omp parallel for schedule(dynamic, 1) if (blocks.size() > 1) firstprivate(count)
  for (std::uint32_t b = 0; b < blocks.size(); b++) {
    std::vector<std::uint32_t> own;  // elements of this block
    for (auto s : blocks[b])
      for (auto r : sets[s])
        if (owner[r] == b) own.push_back(r);
    std::sort(own.begin(), own.end());
    own.erase(std::unique(own.begin(), own.end()), own.end());
    const auto [local, global] = problem_of(own, transpose, count);
    std::vector<std::uint32_t> start;
    for (auto s : blocks[b]) {
      const auto at = std::lower_bound(global.begin(), global.end(), s);
      if (at != global.end() && *at == s) start.push_back(static_cast<std::uint32_t>(at - global.begin()));
    }
    SetCover block(local, own.size());
    block.greedy(start);
    block.improve(static_cast<std::uint64_t>(search.steps * static_cast<double>(block.best().size())),
                  (search.seed << 32) + b);
    blocks[b].clear();
    for (auto s : block.best()) blocks[b].push_back(global[s]);
  }
  cover.clear();
  for (const auto& block : blocks) cover.insert(cover.end(), block.begin(), block.end());
  std::sort(cover.begin(), cover.end());
  cover.erase(std::unique(cover.begin(), cover.end()), cover.end());
  return cover;
}

}  // namespace padder
