// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/cover_problem.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace padder {
namespace {

std::vector<std::uint32_t> rows_of(const Pool& pool, std::size_t set) {
  const Sets sets = pool.sets();
  std::vector<std::uint32_t> rows(sets[set].begin(), sets[set].end());
  std::sort(rows.begin(), rows.end());
  return rows;
}

Candidate ball(double x, double radius, double depth = 0) {
  return {{Point(x, 0, 0), radius}, depth, Point(x, 0, 0), 0};
}

TEST(Pool, CoversWithinTheGapAndItsMargin) {
  Pool pool(0.5);
  // Radius 1 and gap 0.5, a slope of 1 at depth 0: reach 1.5 less the margin.
  pool.add({{Point(1.4, 0, 0), 0}, {Point(1.6, 0, 0), 0}, {Point(1.4, 0, 0), 0.2}}, {ball(0, 1)});
  EXPECT_EQ(rows_of(pool, 0), (std::vector<std::uint32_t>{0}));
}

TEST(Pool, DeepCentreNeedsLessMargin) {
  Pool pool(0.5);
  // At depth 1.2 of 1.5 the surface leaves the ball with a slope of 0.6 (3-4-5).
  pool.add({{Point(1.35, 0, 0), 0.2}}, {ball(0, 1), ball(0, 1, 1.2)});
  EXPECT_TRUE(rows_of(pool, 0).empty());
  EXPECT_EQ(rows_of(pool, 1), (std::vector<std::uint32_t>{0}));
}

TEST(Pool, LaterRowsAndCandidatesLearnOfEachOther) {
  Pool pool(0.5);
  pool.add({{Point(0, 0, 0), 0}}, {ball(0, 1)});
  pool.add({{Point(3, 0, 0), 0}, {Point(1, 0, 0), 0}}, {ball(2, 1)});
  EXPECT_EQ(rows_of(pool, 0), (std::vector<std::uint32_t>{0, 2}));
  EXPECT_EQ(rows_of(pool, 1), (std::vector<std::uint32_t>{1, 2}));
  pool.keep({1});
  EXPECT_EQ(rows_of(pool, 0), (std::vector<std::uint32_t>{1, 2}));
  pool.replace_rows({{Point(2, 0, 0), 0}});
  EXPECT_EQ(rows_of(pool, 0), (std::vector<std::uint32_t>{0}));
}

}  // namespace
}  // namespace padder
