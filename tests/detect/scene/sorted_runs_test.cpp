// SPDX-License-Identifier: MIT
// Runs of a list against std::sort of the whole, where runs are short and keys lie as they like.
#include "detect/scene/sorted_runs.h"

#include <random>

#include "tests/detect/oracle.h"

namespace padder::detect {
namespace {

void expect_in_order(std::vector<Pair> pairs, std::uint64_t longest) {
  std::mt19937_64 random(7);
  std::shuffle(pairs.begin(), pairs.end(), random);
  const std::vector<Pair> wanted = sorted(pairs);
  for (const int threads : {1, 3}) {
    SCOPED_TRACE(threads);
    std::vector<Pair> found;
    SortedRuns(pairs, threads, longest).each([&](std::span<const std::uint64_t> run) {
      EXPECT_FALSE(run.empty());
      EXPECT_LE(run.size(), longest);
      for (const std::uint64_t key : run)
        found.push_back({static_cast<std::uint32_t>(key >> 32), static_cast<std::uint32_t>(key)});
    });
    ASSERT_EQ(found, wanted);
  }
}

TEST(SortedRuns, NothingAndOne) {
  expect_in_order({}, 10);
  expect_in_order({{0, 0xfffffffe}}, 10);
  expect_in_order({{0xfffffffd, 0xfffffffe}, {0, 1}}, 1);
}

TEST(SortedRuns, ManyRuns) {
  expect_in_order(brute_force(random_scene(1000, 3, 1, 7)), 100);
  expect_in_order(brute_force(random_scene(30, 3, 1, 8)), 1);
}

// A sphere that touches all others: its contacts are more than a run, and equal in their first 32 bits.
TEST(SortedRuns, OneSphereTouchesAll) {
  std::vector<Pair> pairs;
  for (std::uint32_t j = 1; j < 100000; j++) pairs.push_back({0, j});
  for (std::uint32_t i = 1; i < 100; i++) pairs.push_back({i, 0xfffffffe});
  expect_in_order(pairs, 1000);
  for (Pair& p : pairs) p.j -= 1, p.i = 0xfffffff0;
  pairs.resize(99999);
  expect_in_order(pairs, 1000);
}

TEST(SortedRuns, KeysAnywhere) {
  std::mt19937 random(11);
  std::vector<Pair> pairs;
  for (int k = 0; k < 20000; k++)
    pairs.push_back({static_cast<std::uint32_t>(random()), static_cast<std::uint32_t>(random())});
  for (std::uint32_t k = 0; k < 5000; k++)
    pairs.push_back({12345, 1000000 + k}), pairs.push_back({12345 + k, 77});
  expect_in_order(pairs, 64);
}

}  // namespace
}  // namespace padder::detect
