// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/search/set_cover.h"

#include <gtest/gtest.h>

#include <bit>
#include <set>

#include "padding/geometry/random.h"

namespace padder {
namespace {

bool covers(const Sets& sets, std::size_t elements, const std::vector<std::uint32_t>& chosen) {
  std::set<std::uint32_t> open, all;
  for (std::size_t s = 0; s < sets.size(); s++) all.insert(sets[s].begin(), sets[s].end());
  open = all;
  for (auto s : chosen)
    for (auto r : sets[s]) open.erase(r);
  return open.empty() && all.size() <= elements;
}

Sets random_sets(std::size_t count, std::size_t elements, double share, std::uint64_t seed) {
  Random random(seed);
  Sets sets;
  for (std::size_t s = 0; s < count; s++) {
    std::vector<std::uint32_t> set;
    for (std::uint32_t r = 0; r < elements; r++)
      if (random.uniform() < share) set.push_back(r);
    sets.add(set);
  }
  return sets;
}

// The oracle tries all subsets.
TEST(SetCover, FindsTheSmallestCoverOfSmallProblems) {
  for (std::uint64_t seed = 1; seed <= 40; seed++) {
    const std::size_t elements = 18;
    const Sets sets = random_sets(14, elements, 0.25, seed);
    std::uint32_t all = 0;
    std::vector<std::uint32_t> mask(sets.size(), 0);
    for (std::size_t s = 0; s < sets.size(); s++)
      for (auto r : sets[s]) mask[s] |= 1u << r, all |= 1u << r;
    int least = 99;
    for (std::uint32_t subset = 0; subset < (1u << sets.size()); subset++) {
      if (std::popcount(subset) >= least) continue;
      std::uint32_t covered = 0;
      for (std::size_t s = 0; s < sets.size(); s++)
        if (subset >> s & 1) covered |= mask[s];
      if (covered == all) least = std::popcount(subset);
    }
    SetCover cover(sets, elements);
    cover.greedy();
    EXPECT_TRUE(covers(sets, elements, cover.best()));
    EXPECT_GE(static_cast<int>(cover.best().size()), least);
    cover.improve(2000, seed);
    EXPECT_TRUE(covers(sets, elements, cover.best()));
    EXPECT_EQ(static_cast<int>(cover.best().size()), least) << "seed " << seed;
  }
}

// Intervals of 10 elements on a line of 1000: 100 are needed, but only those that start at multiples of 10
// fit.
TEST(SetCover, SearchBeatsGreedy) {
  Random random(3);
  Sets sets;
  for (std::uint32_t k = 0; k < 100; k++) {
    std::vector<std::uint32_t> set;
    for (std::uint32_t r = 0; r < 10; r++) set.push_back(10 * k + r);
    sets.add(set);
  }
  for (int k = 0; k < 300; k++) {
    std::vector<std::uint32_t> set;
    const auto from = static_cast<std::uint32_t>(random.below(990));
    for (std::uint32_t r = 0; r < 11 && from + r < 1000; r++) set.push_back(from + r);
    sets.add(set);
  }
  SetCover cover(sets, 1000);
  cover.greedy();
  const std::size_t greedy = cover.best().size();
  cover.improve(20000, 1);
  EXPECT_TRUE(covers(sets, 1000, cover.best()));
  EXPECT_LT(cover.best().size(), greedy);
  EXPECT_LE(cover.best().size(), 100u);
}

TEST(SetCover, DropsWhatTheStartHasTooMuch) {
  Sets sets;
  sets.add(std::vector<std::uint32_t>{0, 1});
  sets.add(std::vector<std::uint32_t>{2, 3});
  sets.add(std::vector<std::uint32_t>{0, 1, 2, 3});
  SetCover cover(sets, 4);
  cover.greedy(std::vector<std::uint32_t>{0, 1, 2});
  EXPECT_EQ(cover.best(), (std::vector<std::uint32_t>{2}));
}

// From nothing it is the greedy choice; from some sets it covers, keeps no set that the others make needless,
// and comes near to what the greedy choice makes of the same start.
TEST(SetCover, CompletesAStart) {
  for (std::uint64_t seed = 1; seed <= 20; seed++) {
    const Sets sets = random_sets(60, 200, 0.06, seed);
    SetCover greedy(sets, 200);
    greedy.greedy();
    EXPECT_EQ(complete(sets, 200, {}), greedy.best()) << seed;
    std::vector<std::uint32_t> start;
    for (std::uint32_t s = 0; s < 60; s += 4) start.push_back(s);
    SetCover same_start(sets, 200);
    same_start.greedy(start);
    const std::vector<std::uint32_t> chosen = complete(sets, 200, start);
    EXPECT_TRUE(covers(sets, 200, chosen)) << seed;
    EXPECT_NEAR(static_cast<double>(chosen.size()), static_cast<double>(same_start.best().size()), 2) << seed;
    for (std::size_t k = 0; k < chosen.size(); k++) {
      std::vector<std::uint32_t> fewer = chosen;
      fewer.erase(fewer.begin() + static_cast<std::ptrdiff_t>(k));
      EXPECT_FALSE(covers(sets, 200, fewer)) << seed;
    }
  }
}

TEST(SetCover, EmptyAndUncoverable) {
  const Sets no_sets;
  SetCover none(no_sets, 3);
  none.greedy();
  none.improve(10, 1);
  EXPECT_TRUE(none.best().empty());
  Sets sets;
  sets.add(std::vector<std::uint32_t>{1});
  SetCover one(sets, 3);  // elements 0 and 2 are in no set
  one.greedy();
  one.improve(10, 1);
  EXPECT_EQ(one.best(), (std::vector<std::uint32_t>{0}));
}

}  // namespace
}  // namespace padder
