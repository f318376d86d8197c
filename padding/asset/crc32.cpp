// SPDX-License-Identifier: MIT
#include "padding/asset/crc32.h"

#include <array>
#include <cstring>

#if defined(__x86_64__) && defined(__GNUC__)
#define PADDER_CARRYLESS 1
#include <immintrin.h>
#endif

// A checksum is a polynomial over GF(2) modulo kPolynomial. Reflected: the highest bit is the coefficient of
// x^0.
namespace padder {
namespace {

constexpr std::uint32_t kPolynomial = 0xEDB88320u, kOne = 0x80000000u, kX8 = 0x00800000u;

constexpr std::uint32_t times_x(std::uint32_t a) { return a >> 1 ^ (a & 1 ? kPolynomial : 0); }

// tables[d][b]: what byte b does to the state when d more bytes follow it.
constexpr auto kTables = [] {
  std::array<std::array<std::uint32_t, 256>, 8> t{};
  for (std::uint32_t b = 0; b < 256; b++) {
    t[0][b] = b;
    for (int bit = 0; bit < 8; bit++) t[0][b] = times_x(t[0][b]);
  }
  for (std::size_t d = 1; d < 8; d++)
    for (std::size_t b = 0; b < 256; b++) t[d][b] = t[d - 1][b] >> 8 ^ t[0][t[d - 1][b] & 255];
  return t;
}();

// Any machine, eight bytes at a step.
std::uint32_t by_tables(std::uint32_t state, std::string_view bytes) {
  const auto& t = kTables;
  for (; bytes.size() >= 8; bytes.remove_prefix(8)) {
    std::uint64_t w;
    std::memcpy(&w, bytes.data(), 8);
    w ^= state;
    state = t[7][w & 255] ^ t[6][w >> 8 & 255] ^ t[5][w >> 16 & 255] ^ t[4][w >> 24 & 255] ^
            t[3][w >> 32 & 255] ^ t[2][w >> 40 & 255] ^ t[1][w >> 48 & 255] ^ t[0][w >> 56];
  }
  for (const char b : bytes) state = t[0][(state ^ static_cast<unsigned char>(b)) & 255] ^ state >> 8;
  return state;
}

#ifdef PADDER_CARRYLESS
#define PADDER_TARGET __attribute__((target("pclmul,sse2")))
PADDER_TARGET inline __m128i load(std::string_view bytes, std::size_t at) {
  return _mm_loadu_si128(reinterpret_cast<const __m128i*>(bytes.data() + at));
}
// x, moved ahead of the bytes in between: its halves times the two powers of x in `powers`.
PADDER_TARGET inline __m128i ahead(__m128i x, __m128i powers) {
  return _mm_xor_si128(_mm_clmulepi64_si128(x, powers, 0x00), _mm_clmulepi64_si128(x, powers, 0x11));
}

// Ten times as fast as the tables: 64 bytes at a step are folded onto the next 64 by multiplications without
// carry (Gopal et al., "Fast CRC computation for generic polynomials using PCLMULQDQ", Intel 2009). What is
// left are 16 bytes of the same remainder, which go through the tables. At least 64 bytes.
PADDER_TARGET std::uint32_t by_folding(std::uint32_t state, std::string_view bytes) {
  const __m128i by_64 = _mm_set_epi64x(0x1c6e41596, 0x154442bd4);  // x^(512 - 32), x^(512 + 32)
  const __m128i by_16 = _mm_set_epi64x(0x0ccaa009e, 0x1751997d0);  // x^(128 - 32), x^(128 + 32)
  __m128i a = _mm_xor_si128(load(bytes, 0), _mm_cvtsi32_si128(static_cast<int>(state)));
  __m128i b = load(bytes, 16), c = load(bytes, 32), d = load(bytes, 48);
  for (bytes.remove_prefix(64); bytes.size() >= 64; bytes.remove_prefix(64)) {
    a = _mm_xor_si128(ahead(a, by_64), load(bytes, 0)), b = _mm_xor_si128(ahead(b, by_64), load(bytes, 16));
    c = _mm_xor_si128(ahead(c, by_64), load(bytes, 32)), d = _mm_xor_si128(ahead(d, by_64), load(bytes, 48));
  }
  b = _mm_xor_si128(ahead(a, by_16), b), c = _mm_xor_si128(ahead(b, by_16), c);
  d = _mm_xor_si128(ahead(c, by_16), d);
  for (; bytes.size() >= 16; bytes.remove_prefix(16)) d = _mm_xor_si128(ahead(d, by_16), load(bytes, 0));
  char left[16];
  _mm_storeu_si128(reinterpret_cast<__m128i*>(left), d);
  return by_tables(by_tables(0, {left, sizeof left}), bytes);
}
#undef PADDER_TARGET
#endif

std::uint32_t product(std::uint32_t a, std::uint32_t b) {
  std::uint32_t sum = 0;
  for (; a != 0; a <<= 1, b = times_x(b))
    if (a & kOne) sum ^= b;
  return sum;
}

}  // namespace

std::uint32_t crc32(std::string_view bytes, std::uint32_t before) {
#ifdef PADDER_CARRYLESS
  static const bool can_fold = __builtin_cpu_supports("pclmul");
  if (can_fold && bytes.size() >= 64) return ~by_folding(~before, bytes);
#endif
  return ~by_tables(~before, bytes);
}

std::uint32_t crc32_joined(std::uint32_t first, std::uint32_t second, std::uint64_t size_of_second) {
  std::uint32_t shift = kOne;  // x^(8 size_of_second)
  for (std::uint32_t power = kX8; size_of_second > 0; size_of_second >>= 1, power = product(power, power))
    if (size_of_second & 1) shift = product(shift, power);
  return product(first, shift) ^ second;
}

}  // namespace padder
