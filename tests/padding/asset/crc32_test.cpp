// SPDX-License-Identifier: MIT
// The checksum against its definition, a bit at a time, for every length about the sizes of its steps.
#include "padding/asset/crc32.h"

#include <gtest/gtest.h>

#include <random>
#include <string>

namespace padder {
namespace {

std::uint32_t a_bit_at_a_time(std::string_view bytes) {
  std::uint32_t state = ~0u;
  for (const char b : bytes) {
    state ^= static_cast<unsigned char>(b);
    for (int bit = 0; bit < 8; bit++) state = state >> 1 ^ (state & 1 ? 0xEDB88320u : 0);
  }
  return ~state;
}

std::string some_bytes(std::size_t size) {
  std::mt19937 random(static_cast<unsigned>(size));
  std::string bytes(size, '\0');
  for (char& b : bytes) b = static_cast<char>(random());
  return bytes;
}

TEST(Crc32, TheCheckValueOfItsStandard) {
  EXPECT_EQ(crc32("123456789"), 0xCBF43926u);
  EXPECT_EQ(crc32(""), 0u);
}

TEST(Crc32, EveryLengthAtEveryAddress) {
  const std::string bytes = some_bytes(700);
  for (std::size_t size = 0; size < 400; size++)
    for (std::size_t from = 0; from < 17; from++) {
      const std::string_view piece = std::string_view(bytes).substr(from, size);
      ASSERT_EQ(crc32(piece), a_bit_at_a_time(piece)) << size << " bytes from " << from;
    }
}

TEST(Crc32, PiecesAsTheWhole) {
  const std::string_view all = "The quick brown fox jumps over the lazy dog";
  const std::string bytes = some_bytes(100000);
  const std::uint32_t whole = a_bit_at_a_time(bytes);
  for (const std::size_t first : {0u, 1u, 63u, 64u, 255u, 4096u, 99999u, 100000u}) {
    const std::string_view a = std::string_view(bytes).substr(0, first),
                           b = std::string_view(bytes).substr(first);
    EXPECT_EQ(crc32(b, crc32(a)), whole) << first;
    EXPECT_EQ(crc32_joined(crc32(a), crc32(b), b.size()), whole) << first;
  }
  EXPECT_EQ(crc32(all), 0x414FA339u);
}

// 5 GiB of zeros after a piece: joined GiB by GiB, and all at once.
TEST(Crc32, SizesBeyond4GiB) {
  const std::string zeros(1 << 20, '\0');
  std::uint32_t gib = 0, sum = crc32("head");
  for (int k = 0; k < 1024; k++) gib = crc32_joined(gib, crc32(zeros), zeros.size());
  for (int k = 0; k < 5; k++) sum = crc32_joined(sum, gib, std::uint64_t(1) << 30);
  std::uint32_t five = 0;
  for (int k = 0; k < 5; k++) five = crc32_joined(five, gib, std::uint64_t(1) << 30);
  EXPECT_EQ(sum, crc32_joined(crc32("head"), five, std::uint64_t(5) << 30));
}

}  // namespace
}  // namespace padder
