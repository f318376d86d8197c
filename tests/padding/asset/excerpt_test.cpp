// SPDX-License-Identifier: MIT
#include "padding/asset/excerpt.h"

#include <gtest/gtest.h>

namespace padder {
namespace {

TEST(Excerpt, TextThatCanBeShownStaysAsItIs) {
  for (const char* text : {"", "part 7.obj", "Größe µm", "日本語", "😀", "a'b\"c\\d"})
    EXPECT_EQ(excerpt(text), text);
}

TEST(Excerpt, LongTextIsCutBetweenCharacters) {
  EXPECT_EQ(excerpt(std::string(60, 'x')), std::string(60, 'x'));
  EXPECT_EQ(excerpt(std::string(10000000, 'x')), std::string(60, 'x') + "…");
  EXPECT_EQ(excerpt("äöü", 2), "äö…");
}

TEST(Excerpt, WhatWouldBreakTheLineIsEscaped) {
  EXPECT_EQ(excerpt("a\nb\tc\rd"), "a\\nb\\tc\\x0dd");
  EXPECT_EQ(excerpt("\x1b[2J\x7f"), "\\x1b[2J\\x7f");
  EXPECT_EQ(excerpt(std::string("\0", 1)), "\\x00");
  EXPECT_EQ(excerpt("\xc2\x9b"), "\\xc2\\x9b");           // a control character of two bytes
  EXPECT_EQ(excerpt("\xe2\x80\xae"), "\\xe2\\x80\\xae");  // turns the direction of what follows
}

TEST(Excerpt, BytesThatAreNoUtf8AreEscaped) {
  // A stray byte, a character cut off, one longer than needed, a surrogate, one beyond the last character.
  for (const char* bytes : {"\x80", "\xff", "\xc3", "\xe2\x82", "\xc0\xaf", "\xe0\x80\xaf", "\xed\xa0\x80",
                            "\xf4\x90\x80\x80", "\xf0\x80\x80\x80"})
    for (const char c : excerpt(bytes)) EXPECT_TRUE(c >= ' ' && c <= '~') << excerpt(bytes);
}

// The test vectors of RFC 4648.
TEST(Base64, VectorsOfTheStandard) {
  EXPECT_EQ(base64(""), "");
  EXPECT_EQ(base64("f"), "Zg==");
  EXPECT_EQ(base64("fo"), "Zm8=");
  EXPECT_EQ(base64("foo"), "Zm9v");
  EXPECT_EQ(base64("foobar"), "Zm9vYmFy");
  EXPECT_EQ(base64("\xff\xfe"), "//4=");
}

TEST(Counted, OneIsSingular) {
  EXPECT_EQ(counted(1, "part"), "1 part");
  EXPECT_EQ(counted(0, "part"), "0 parts");
  EXPECT_EQ(counted(2, "body", "bodies"), "2 bodies");
}

TEST(ShortNumber, SignificantDigits) {
  EXPECT_EQ(short_number(0.0123456, 3), "0.0123");
  EXPECT_EQ(short_number(2, 4), "2");
  EXPECT_EQ(short_number(1234567, 4), "1.235e+06");
}

}  // namespace
}  // namespace padder
