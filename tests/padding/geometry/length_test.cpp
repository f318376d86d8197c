// SPDX-License-Identifier: MIT
#include "padding/geometry/length.h"

#include <gtest/gtest.h>

namespace padder {
namespace {

TEST(Length, IsAbsoluteOrAShareOfTheDiagonal) {
  EXPECT_EQ(Length::of(0.5).absolute(20), 0.5);
  EXPECT_EQ(Length::share(0.01).absolute(20), 0.2);
  EXPECT_TRUE(Length::of(0.5).given());
  EXPECT_FALSE(Length().given());
  EXPECT_EQ(Length().absolute(20), 0);
}

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wdeprecated-declarations"
TEST(Length, TheDeprecatedFormStillWorks) {
  const Length share = {0.01, true}, length = {0.5, false};
  EXPECT_EQ(share.absolute(20), 0.2);
  EXPECT_EQ(length.absolute(20), 0.5);
}
#pragma GCC diagnostic pop

TEST(Length, IsReadFromANumberOrAShareAndNothingElse) {
  EXPECT_EQ(length_of("0.25")->value(), 0.25);
  EXPECT_FALSE(length_of("0.25")->is_share());
  EXPECT_EQ(length_of("1e-3")->value(), 1e-3);
  for (const char* text : {"5%", "5 %", "5.0%", "0.5e1%"}) {
    const auto length = length_of(text);
    ASSERT_TRUE(length) << text;
    EXPECT_TRUE(length->is_share());
    EXPECT_EQ(length->value(), 0.05);
  }
  for (const char* text : {"",     " ",     "%",      " %",  "5%%", "5 % ",  " 5",    "5 ",  "5\t%", "+5",
                           "-5",   "-5%",   "0",      "0%",  "-0",  "0x10",  "0x10%", "nan", "NaN%", "inf",
                           "inf%", "1e999", "1e-999", "5mm", "5,5", "1_000", "five",  "%5",  "5%5"})
    EXPECT_FALSE(length_of(text)) << '"' << text << '"';
}

}  // namespace
}  // namespace padder
