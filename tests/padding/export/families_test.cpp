// SPDX-License-Identifier: MIT
#include "padding/export/families.h"

#include <gtest/gtest.h>

#include "detect/filter.h"
#include "tests/padding/random_input.h"

namespace padder {
namespace {

// Families and masks that show every case: none, inside 1 to 32, its ends, above 32; masks of oneself,
// others, all.
std::vector<CollisionFilter> table() {
  std::vector<CollisionFilter> out;
  for (const std::uint32_t family : {0u, 1u, 2u, 3u, 31u, 32u, 33u, 34u, 0xffffffffu})
    for (const std::uint32_t mask : {0u, 1u, 2u, 5u, 0x80000000u, 0x40000000u, 0xffffffffu})
      out.push_back({family, mask});
  return out;
}

TEST(Families, OurRuleIsTheDetectors) {
  for (const auto& a : table())
    for (const auto& b : table())
      EXPECT_EQ(may_touch(a, b), detect::admitted({a.family, a.mask}, {b.family, b.mask}))
          << a.family << " " << a.mask << ", " << b.family << " " << b.mask;
}

// What MuJoCo and what Chrono, Jolt and Bullet make of the bits.
bool either_side(const FilterBits& a, const FilterBits& b) {
  return (a.own & b.others) || (b.own & a.others);
}
bool both_sides(const FilterBits& a, const FilterBits& b) { return (a.own & b.others) && (b.own & a.others); }

void expect_translated(const std::vector<CollisionFilter>& bodies, int bits, bool copies) {
  const auto translated = filter_bits(bodies, bits);
  ASSERT_TRUE(translated);
  ASSERT_EQ(translated->size(), bodies.size());
  for (std::size_t i = 0; i < bodies.size(); i++) {
    EXPECT_EQ(__builtin_popcount((*translated)[i].own), 1);
    EXPECT_LT(std::uint64_t((*translated)[i].own | (*translated)[i].others), std::uint64_t(1) << bits);
    for (std::size_t j = copies ? i : i + 1; j < bodies.size(); j++) {
      EXPECT_EQ(either_side((*translated)[i], (*translated)[j]), may_touch(bodies[i], bodies[j]))
          << i << " " << j;
      EXPECT_EQ(both_sides((*translated)[i], (*translated)[j]), may_touch(bodies[i], bodies[j]))
          << i << " " << j;
    }
  }
}

TEST(Families, BitsOfEveryPairOfTheTruthTable) {
  for (const auto& a : table())
    for (const auto& b : table()) expect_translated({a, b}, 2, true);
}

TEST(Families, BitsOfRandomScenes) {
  shapes::RandomInput random(5);
  for (int scene = 0; scene < 50; scene++) {
    std::vector<CollisionFilter> bodies;
    for (int k = 0; k < 40; k++)
      bodies.push_back({std::uint32_t(random.uniform(0, 9)), std::uint32_t(random.uniform(0, 4)) & 5u});
    expect_translated(bodies, 32, true);
  }
}

TEST(Families, BodiesOfTheirOwnFamilyShareOneBit) {
  std::vector<CollisionFilter> bodies;  // as a scene gives them to bodies without a family
  for (std::uint32_t k = 0; k < 200; k++) bodies.push_back({33 + k, 0});
  expect_translated(bodies, 1, false);
}

TEST(Families, MoreClassesThanBitsIsSaid) {
  std::vector<CollisionFilter> chain;  // each masks the one before: no two have the same others
  for (std::uint32_t k = 1; k <= 17; k++) chain.push_back({k, k == 1 ? 0 : 1u << (k - 2)});
  EXPECT_FALSE(filter_bits(chain, 15));
  expect_translated(chain, 17, true);
  expect_translated(chain, 32, true);
}

// Chrono's rule, and what a body of Chrono's own is at first (the comment at chrono_bits).
const FilterBits kChronoDefault{1, 0x7fff};

TEST(Families, ChronosRuleIsOursInEveryFile) {
  std::vector<CollisionFilter> filters;
  for (const std::uint32_t family : {0u, 1u, 2u, 3u, 13u, 14u})
    for (const std::uint32_t mask : {0u, 1u, 2u, 5u, 0x2000u, 0x3fffu, 0xffffc000u, 0xffffffffu})
      filters.push_back({family, mask});
  for (const auto& a : filters)
    for (const auto& b : filters) {  // each translated by itself, as parts written to two files are
      const FilterBits one = chrono_bits({a})->front(), other = chrono_bits({b})->front();
      EXPECT_EQ(both_sides(one, other), may_touch(a, b))
          << a.family << " " << a.mask << ", " << b.family << " " << b.mask;
      EXPECT_TRUE(both_sides(one, kChronoDefault));
      EXPECT_EQ(__builtin_popcount(one.own), 1);  // SetFamilyGroup asserts it
      EXPECT_LE(one.others, 0x7fffu);             // SetFamilyMask asserts it
    }
  EXPECT_EQ(chrono_bits({{0, 0}})->front(), kChronoDefault);
  EXPECT_EQ(chrono_bits({{3, 4}})->front().own, 1u << 3);  // SetFamily(3)
}

TEST(Families, ChronoTellsMoreFamiliesApartAmongThemselves) {
  EXPECT_FALSE(chrono_bits({{15, 0}}));  // alone there is nothing to tell it from
  const std::vector<CollisionFilter> robot{{40, 1}, {1, 0}, {2, 1}, {2, 0}};
  const auto bits = chrono_bits(robot);
  ASSERT_TRUE(bits);
  for (std::size_t i = 0; i < robot.size(); i++) {
    EXPECT_TRUE(both_sides((*bits)[i], kChronoDefault));
    for (std::size_t j = 0; j < robot.size(); j++)
      EXPECT_EQ(both_sides((*bits)[i], (*bits)[j]), may_touch(robot[i], robot[j])) << i << " " << j;
  }
}

TEST(Families, MujocosBitsAreTheSameInEveryFile) {
  const FilterBits mujoco_default{1, 1};
  for (const auto& a : table()) {
    EXPECT_TRUE(either_side(mujoco_bits(a), mujoco_default)) << a.family << " " << a.mask;
    for (const auto& b : table()) {
      const bool touch = either_side(mujoco_bits(a), mujoco_bits(b));
      EXPECT_TRUE(touch || !may_touch(a, b))
          << a.family << " " << a.mask << ", " << b.family << " " << b.mask;
      const bool have_bits = std::max(a.family, b.family) <= kMujocoFamilies;
      const auto masks = [](const CollisionFilter& x, const CollisionFilter& y) {
        return y.family >= 1 && y.family <= 32 && (x.mask >> (y.family - 1) & 1) != 0;
      };
      // One family, a mask of a body without a family, a mask returned: the bits alone say it.
      const bool said = (a.family == b.family && a.family != 0) || (a.family == 0 && masks(a, b)) ||
                        (masks(a, b) && masks(b, a));
      EXPECT_FALSE(touch && have_bits && said)
          << a.family << " " << a.mask << ", " << b.family << " " << b.mask;
    }
  }
  // Only one of the two fields: a floor that is met, but meets nothing by itself, and the other way round.
  EXPECT_TRUE(either_side(mujoco_bits({0, 0}), {0, 1}));
  EXPECT_TRUE(either_side(mujoco_bits({0, 0}), {2, 0}));
  EXPECT_EQ(mujoco_bits({3, 0}).own, 1u << 3);
  EXPECT_NE(mujoco_bits({0, 4}), mujoco_bits({0, 0}));
}

TEST(Families, MujocosBitsReadBack) {
  for (const CollisionFilter f : {CollisionFilter{0, 0}, {5, 3}, {30, 0}, {0, 6}, {1, 0x3ffffffe}})
    EXPECT_EQ(filter_of_mujoco_bits(mujoco_bits(f)), f) << f.family << " " << f.mask;
  // MuJoCo's own of a geom that states none, and two that somebody else may have chosen.
  for (const FilterBits b : {FilterBits{1, 1}, {0, 0}, {2, 2}})
    EXPECT_FALSE(filter_of_mujoco_bits(b)) << b.own << " " << b.others;
}

TEST(Families, PairsAreThoseThatMayNotTouch) {
  const std::vector<CollisionFilter> bodies{{1, 2}, {2, 0}, {1, 0}, {0, 0}};
  EXPECT_EQ(filtered_pairs(bodies), (std::vector<std::pair<std::size_t, std::size_t>>{{0, 1}, {0, 2}}));
}

void expect_families(std::size_t n, const std::vector<std::pair<std::size_t, std::size_t>>& pairs) {
  const auto families = families_of(n, pairs);
  ASSERT_TRUE(families);
  EXPECT_EQ(filtered_pairs(*families), pairs);
  for (const auto& f : *families) EXPECT_FALSE(may_touch(f, f));
}

TEST(Families, FamiliesOfAChain) {
  for (const std::size_t n : {1, 7, 32, 33, 65}) {  // 65 in a row: every second one needs a family below 33
    SCOPED_TRACE(n);
    std::vector<std::pair<std::size_t, std::size_t>> pairs;
    for (std::size_t k = 0; k + 1 < n; k++) pairs.emplace_back(k, k + 1);
    expect_families(n, pairs);
  }
}

TEST(Families, FamiliesOfRandomTreesAndOfStars) {
  shapes::RandomInput random(6);
  for (int tree = 0; tree < 20; tree++) {
    std::vector<std::pair<std::size_t, std::size_t>> pairs;
    for (std::size_t k = 1; k < 50; k++) pairs.emplace_back(std::size_t(random.uniform(0, double(k))), k);
    std::sort(pairs.begin(), pairs.end());
    expect_families(50, pairs);
  }
  std::vector<std::pair<std::size_t, std::size_t>> star;
  for (std::size_t k = 1; k < 500; k++) star.emplace_back(0, k);
  expect_families(500, star);
}

TEST(Families, TooManyNeighboursIsSaid) {
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  for (std::size_t k = 0; k + 1 < 70; k++) pairs.emplace_back(k, k + 1);
  EXPECT_FALSE(families_of(70, pairs));
}

}  // namespace
}  // namespace padder
