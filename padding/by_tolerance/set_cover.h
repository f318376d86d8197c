// SPDX-License-Identifier: MIT
// The fewest sets that cover all rows (the unicost set cover problem): greedy, then local search. Pure
// combinatorics.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

namespace padder {

// Which rows each set covers: lists behind one another (compressed rows).
struct Sets {
  std::vector<std::uint64_t> begin = {0};  // sets + 1
  std::vector<std::uint32_t> rows;

  std::size_t size() const { return begin.size() - 1; }
  std::span<const std::uint32_t> operator[](std::size_t set) const {
    return {rows.data() + begin[set], rows.data() + begin[set + 1]};
  }
  void add(std::span<const std::uint32_t> set) {
    rows.insert(rows.end(), set.begin(), set.end());
    begin.push_back(rows.size());
  }
};

// A local search over covers. Rows that no set covers are left out and do not count. Fewer than 2^32 - 1 sets
// and rows. Deterministic: depends on the input and the seed only.
class SetCover {
 public:
  SetCover(const Sets& sets, std::size_t rows);  // keeps a reference to `sets`

  // Takes these sets, then the set that covers the most uncovered rows until all are covered (of equals, the
  // lowest index), then drops what the others make needless.
  void greedy(std::span<const std::uint32_t> start = {});

  // Row-weighting local search (Gao, Weise and Li, An efficient local search heuristic with row weighting for
  // the unicost set covering problem, 2015): take one set out too many, repair, and let rows that are hard to
  // cover gain weight. Makes `steps` exchanges; keeps the best cover seen. Call greedy() first.
  void improve(std::uint64_t steps, std::uint64_t seed);

  const std::vector<std::uint32_t>& best() const { return best_; }  // ascending

 private:
  struct Set {
    std::int32_t score;     // weight of the rows gained by adding it; minus the weight lost by removing it
    std::uint32_t may_add;  // configuration checking: something around it changed since its removal
    std::uint32_t stamp;    // step of its last change
    std::uint32_t place;    // in chosen_, or `nowhere`
  };
  struct Row {
    std::int32_t weight;
    std::uint32_t count;  // chosen sets that cover it
    std::uint32_t sum;    // of their indices modulo 2^32: the set itself where count is 1
    std::uint32_t place;  // in uncovered_, or `nowhere`
  };

  std::span<const std::uint32_t> sets_of(std::uint32_t row) const {
    return {row_sets_.data() + row_begin_[row], row_sets_.data() + row_begin_[row + 1]};
  }
  void add(std::uint32_t set);
  void remove(std::uint32_t set);
  void drop_needless();
  void keep();
  std::uint32_t cheapest(std::uint32_t tabu) const;

  const Sets& sets_;
  std::vector<std::uint64_t> row_begin_;  // the transpose
  std::vector<std::uint32_t> row_sets_;
  std::vector<Set> set_;
  std::vector<Row> row_;
  std::vector<std::uint32_t> chosen_, uncovered_, best_;
  std::uint32_t step_ = 0;
};

}  // namespace padder
