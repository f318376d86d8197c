// SPDX-License-Identifier: MIT
// The set cover problem with equal costs: find the fewest sets that together contain all elements. A greedy
// choice comes first, then a local search. Nothing here knows of geometry.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

namespace padder {

// The elements of each set, one list after the other (compressed sparse rows).
struct Sets {
  // begin[k] is where the list of set k begins in `elements`; the last entry is the end of all lists.
  std::vector<std::uint64_t> begin = {0};
  std::vector<std::uint32_t> elements;

  std::size_t size() const { return begin.size() - 1; }
  std::span<const std::uint32_t> operator[](std::size_t set) const {
    return {elements.data() + begin[set], elements.data() + begin[set + 1]};
  }
  void add(std::span<const std::uint32_t> set) {
    elements.insert(elements.end(), set.begin(), set.end());
    begin.push_back(elements.size());
  }
};

// For each element the sets that contain it, ascending.
Sets transposed(const Sets& sets, std::size_t elements);

// A search over covers. Elements that no set contains are ignored. There may be at most 2^32 - 2 sets and as
// many elements. The result depends on the input and the seed only.
class SetCover {
 public:
  SetCover(const Sets& sets, std::size_t elements);  // keeps a reference to `sets`

  // Takes the sets of `start`. Then takes the set with the most uncovered elements, again and again, until
  // all are covered; of equal sets the one with the lowest index. At last drops the sets whose elements all
  // lie in others.
  void greedy(std::span<const std::uint32_t> start = {});

  // Local search with weights (Gao, Weise and Li, An efficient local search heuristic with row weighting for
  // the unicost set covering problem, 2015): take out one set too many, repair the cover, and raise the
  // weight of the elements that are hard to cover. Makes `steps` exchanges and keeps the best cover seen.
  // Call greedy() first.
  void improve(std::uint64_t steps, std::uint64_t seed);

  const std::vector<std::uint32_t>& best() const { return best_; }  // ascending

 private:
  // Twice the score of a set, and 1 more where it may be added: nearly all time goes into changing both, and
  // one number for both stays in the cache. The score is, outside the cover, the weight that adding the set
  // gains; inside, minus the weight that removing it loses. A set may not be added while nothing around it
  // has changed since its removal (configuration checking).
  struct Gain {
    std::int32_t twice_and_may_add;

    std::int32_t score() const { return twice_and_may_add >> 1; }
    bool may_add() const { return twice_and_may_add & 1; }
    void change(std::int32_t by) { twice_and_may_add += 2 * by; }
    void change_and_allow(std::int32_t by) { twice_and_may_add = (twice_and_may_add + 2 * by) | 1; }
    void forbid() { twice_and_may_add &= ~1; }
    void negate() { twice_and_may_add = -2 * score() + may_add(); }
  };
  struct Set {
    std::uint32_t stamp;  // step at which it was added or removed last
    std::uint32_t place;  // in chosen_, or `nowhere`
  };
  struct Element {
    std::int32_t weight;
    std::uint32_t count;  // chosen sets that cover it
    std::uint32_t sum;    // of their indices modulo 2^32; where count is 1, this is the index of the only one
    std::uint32_t place;  // in uncovered_, or `nowhere`
  };

  void add(std::uint32_t set);
  void remove(std::uint32_t set);
  void drop_needless();
  void keep_as_best();
  std::uint32_t cheapest(std::uint32_t tabu) const;

  const Sets& sets_;
  const Sets sets_of_;      // for each element, the sets that contain it
  std::vector<Gain> gain_;  // of each set
  std::vector<Set> set_;
  std::vector<Element> element_;
  std::vector<std::uint32_t> chosen_, uncovered_, best_;
  std::uint32_t step_ = 0;
};

// What SetCover::greedy(start) chooses, up to ties. It looks closely only at the elements that `start` leaves
// open, so it costs little where they are few.
std::vector<std::uint32_t> complete(const Sets& sets, std::size_t elements,
                                    const std::vector<std::uint32_t>& start);

}  // namespace padder
