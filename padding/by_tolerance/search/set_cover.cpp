// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/search/set_cover.h"

#include <algorithm>
#include <numeric>
#include <queue>

#include "padding/geometry/random.h"

namespace padder {
namespace {

constexpr std::uint32_t kNowhere = 0xffffffffu;

void smallest_first(const Sets& sets, std::vector<std::uint32_t>& order) {
  std::sort(order.begin(), order.end(), [&](auto s, auto t) {
    return sets[s].size() != sets[t].size() ? sets[s].size() < sets[t].size() : s < t;
  });
}

}  // namespace

Sets transposed(const Sets& sets, std::size_t elements) {
  Sets out;
  out.begin.assign(elements + 1, 0);
  for (auto r : sets.elements) out.begin[r + 1]++;
  std::partial_sum(out.begin.begin(), out.begin.end(), out.begin.begin());
  out.elements.resize(sets.elements.size());
  std::vector<std::uint64_t> at(out.begin.begin(), out.begin.end() - 1);
  for (std::uint32_t s = 0; s < sets.size(); s++)
    for (auto r : sets[s]) out.elements[at[r]++] = s;
  return out;
}

SetCover::SetCover(const Sets& sets, std::size_t elements)
    : sets_(sets), sets_of_(transposed(sets, elements)) {
  set_.assign(sets.size(), {0, kNowhere});
  gain_.resize(sets.size());
  for (std::size_t s = 0; s < sets.size(); s++)
    gain_[s] = {2 * static_cast<std::int32_t>(sets[s].size()) + 1};
  element_.assign(elements, {1, 0, 0, kNowhere});
  for (std::uint32_t r = 0; r < elements; r++)
    if (!sets_of_[r].empty())
      element_[r].place = static_cast<std::uint32_t>(uncovered_.size()), uncovered_.push_back(r);
}

void SetCover::add(std::uint32_t set) {
  gain_[set].negate();
  set_[set].place = static_cast<std::uint32_t>(chosen_.size());
  chosen_.push_back(set);
  for (auto r : sets_[set]) {
    Element& element = element_[r];
    if (element.count == 0) {
      for (auto other : sets_of_[r]) gain_[other].change_and_allow(-element.weight);
      gain_[set].change(element.weight);
      const auto last = uncovered_.back();
      uncovered_[element.place] = last, element_[last].place = element.place;
      uncovered_.pop_back(), element.place = kNowhere;
    } else if (element.count == 1) {
      gain_[element.sum].change(element.weight);  // no longer lost with the one set that covered it
    }
    element.count++, element.sum += set;
  }
}

void SetCover::remove(std::uint32_t set) {
  gain_[set].negate();
  const auto last = chosen_.back();
  chosen_[set_[set].place] = last, set_[last].place = set_[set].place;
  chosen_.pop_back(), set_[set].place = kNowhere;
  for (auto r : sets_[set]) {
    Element& element = element_[r];
    element.count--, element.sum -= set;
    if (element.count == 0) {
      for (auto other : sets_of_[r]) gain_[other].change_and_allow(element.weight);
      gain_[set].change(-element.weight);
      element.place = static_cast<std::uint32_t>(uncovered_.size());
      uncovered_.push_back(r);
    } else if (element.count == 1) {
      gain_[element.sum].change(-element.weight);
    }
  }
  gain_[set].forbid(), set_[set].stamp = step_;
}

// Lazy greedy: scores only fall while sets are added. So an outdated entry at the top of the heap is put back
// with its new score, and the first entry that is up to date is the best of all.
void SetCover::greedy(std::span<const std::uint32_t> start) {
  for (auto s : start)
    if (set_[s].place == kNowhere) add(s);
  using Entry = std::pair<std::int32_t, std::uint32_t>;
  const auto worse = [](const Entry& a, const Entry& b) {
    return a.first != b.first ? a.first < b.first : a.second > b.second;
  };
  std::vector<Entry> entries;
  for (std::uint32_t s = 0; s < sets_.size(); s++)
    if (set_[s].place == kNowhere && gain_[s].score() > 0) entries.push_back({gain_[s].score(), s});
  std::priority_queue<Entry, std::vector<Entry>, decltype(worse)> heap(worse, std::move(entries));
  while (!uncovered_.empty()) {
    const auto [score, s] = heap.top();
    heap.pop();
    if (gain_[s].score() < score)
      heap.push({gain_[s].score(), s});
    else
      add(s);
  }
  drop_needless();
  keep_as_best();
}

// Removes sets that lose nothing when they go, the smallest first.
void SetCover::drop_needless() {
  std::vector<std::uint32_t> order = chosen_;
  smallest_first(sets_, order);
  for (auto s : order)
    if (gain_[s].score() == 0) remove(s);
}

void SetCover::keep_as_best() {
  best_ = chosen_;
  std::sort(best_.begin(), best_.end());
}

// The chosen set whose removal loses the least weight; of equal ones the one that was added first.
std::uint32_t SetCover::cheapest(std::uint32_t tabu) const {
  std::uint32_t best = kNowhere;
  for (auto s : chosen_) {
    if (s == tabu) continue;
    if (best == kNowhere || gain_[s].score() > gain_[best].score() ||
        (gain_[s].score() == gain_[best].score() && set_[s].stamp < set_[best].stamp))
      best = s;
  }
  return best;
}

void SetCover::improve(std::uint64_t steps, std::uint64_t seed) {
  Random random(seed);
  std::uint32_t fresh = kNowhere;  // the set added last, which stays for one step
  for (std::uint64_t done = 0; done < steps && chosen_.size() > 1; done++) {
    step_++;
    while (uncovered_.empty() && chosen_.size() > 1) {
      if (chosen_.size() < best_.size()) keep_as_best();
      remove(cheapest(kNowhere));
    }
    if (chosen_.size() > 1) remove(cheapest(fresh));
    while (!uncovered_.empty() && chosen_.size() + 1 < best_.size()) {
      const auto element = uncovered_[random.below(uncovered_.size())];
      std::uint32_t pick = kNowhere;
      for (auto s : sets_of_[element]) {
        if (!gain_[s].may_add()) continue;
        if (pick == kNowhere || gain_[s].score() > gain_[pick].score() ||
            (gain_[s].score() == gain_[pick].score() && set_[s].stamp < set_[pick].stamp))
          pick = s;
      }
      if (pick == kNowhere) pick = sets_of_[element][0];
      add(pick), set_[pick].stamp = step_, fresh = pick;
      for (auto r : uncovered_) {
        element_[r].weight++;
        for (auto s : sets_of_[r]) gain_[s].change(1);
      }
    }
  }
  if (uncovered_.empty() && chosen_.size() < best_.size()) keep_as_best();
  // Return to the best cover, so that the next call starts from it.
  const std::vector<std::uint32_t> now = chosen_;
  for (auto s : now)
    if (!std::binary_search(best_.begin(), best_.end(), s)) remove(s);
  for (auto s : best_)
    if (set_[s].place == kNowhere) add(s);
}

std::vector<std::uint32_t> complete(const Sets& sets, std::size_t elements,
                                    const std::vector<std::uint32_t>& start) {
  std::vector<std::uint32_t> chosen = start, count(elements, 0), number(elements, kNowhere), global, own;
  for (const auto s : start)
    for (const auto r : sets[s]) count[r]++;
  Sets rest;
  std::uint32_t open = 0;
  for (std::uint32_t s = 0; s < sets.size(); s++) {
    own.clear();
    for (const auto r : sets[s]) {
      if (count[r] > 0) continue;
      if (number[r] == kNowhere) number[r] = open++;
      own.push_back(number[r]);
    }
    if (!own.empty()) rest.add(own), global.push_back(s);
  }
  SetCover cover(rest, open);
  cover.greedy();
  for (const auto k : cover.best()) {
    chosen.push_back(global[k]);
    for (const auto r : sets[global[k]]) count[r]++;
  }
  smallest_first(sets, chosen);  // so as to drop what the others make needless
  std::erase_if(chosen, [&](auto s) {
    const auto all = sets[s];
    if (std::any_of(all.begin(), all.end(), [&](auto r) { return count[r] == 1; })) return false;
    for (const auto r : all) count[r]--;
    return true;
  });
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

}  // namespace padder
