// SPDX-License-Identifier: MIT
// Every combination of families and masks of docs/detector/use.md, both ways round.
#include "detect/filter.h"

#include "tests/detect/oracle.h"

namespace padder::detect {
namespace {

TEST(Filter, EveryCombinationAgainstTheWordsOfTheRule) {
  const std::uint32_t families[] = {0, 1, 2, 16, 31, 32, 33, 64, 0x80000000u, 0xffffffffu};
  std::vector<std::uint32_t> masks{0, 0xffffffffu, 0x80000001u};
  for (int bit = 0; bit < 32; bit++) masks.push_back(1u << bit);
  for (const std::uint32_t fa : families)
    for (const std::uint32_t fb : families)
      for (const std::uint32_t ma : masks)
        for (const std::uint32_t mb : masks) {
          ASSERT_EQ(admitted({fa, ma}, {fb, mb}), oracle_admits(fa, ma, fb, mb))
              << fa << " " << ma << " " << fb << " " << mb;
          ASSERT_EQ(admitted({fa, ma}, {fb, mb}), admitted({fb, mb}, {fa, ma}));
        }
}

TEST(Filter, ByName) {
  EXPECT_TRUE(admitted({0, 0}, {0, 0})) << "family 0 equals nothing, not even itself";
  EXPECT_FALSE(admitted({7, 0}, {7, 0})) << "one family";
  EXPECT_FALSE(admitted({0, 1u << 4}, {5, 0})) << "bit 4 masks family 5";
  EXPECT_FALSE(admitted({5, 0}, {0, 1u << 4})) << "either side's mask is enough";
  EXPECT_TRUE(admitted({0, 0xffffffffu}, {0, 0xffffffffu})) << "no mask names family 0";
  EXPECT_TRUE(admitted({1, 0xfffffffeu}, {33, 0xfffffffeu})) << "families above 32 cannot be masked";
}

}  // namespace
}  // namespace padder::detect
