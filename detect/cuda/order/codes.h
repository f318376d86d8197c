// SPDX-License-Identifier: MIT
// Codes: a sphere's coarse position in one 32-bit word, for the first test of a search through one level.
// Each coordinate is counted in units of a 64th to a 92nd of a bin, modulo 256, and takes a byte. One
// subtraction of two words gives the three differences; one dot product of bytes squares and adds them. A
// pair that touches always passes the test; most other pairs do not. Only .cu files include this.
#pragma once
#include <algorithm>

#include "detect/cuda/order/float_bins.h"

namespace padder::detect::cuda {

// With t the exact coordinates in units, a word holds q = floor(t) modulo 256: x in the highest byte, then y,
// z, and the radius. A difference of words is that of the bytes, less the borrows of the bytes below: in the
// byte of z more than dz - 1 and less than dz + 1, in those of y and x more than d - 2 and less than d + 1.
// Units computed in float are off by 0.045 each (4,096 bins of 92 units, two roundings), which makes at most
//   sqrt(1.09^2 + 2 * 2.09^2) < 3.2 units
// between the length of (dx, dy, dz) and that of the bytes. Two spheres of a level that touch are at most a
// bin apart: the bytes then do not overflow.
inline constexpr float kCodeUnits = 92;  // of a bin; modulo 256, few spheres two bins away look near
inline constexpr int kFixedShift = kUnitBits - 6;  // of fixed point: 64 units
inline constexpr double kCodeSlack = 3.2;

PADDER_HD std::uint32_t packed(std::uint32_t x, std::uint32_t y, std::uint32_t z, std::uint32_t low) {
  return x << 24 | (y & 255) << 16 | (z & 255) << 8 | low;
}
// The lowest byte of the code of a sphere of this radius, in units: 256 minus the radius, which is rounded
// up. So subtracting codes adds radii. The radius counts as at least 1, so that the subtraction always
// borrows from the next byte; and as at most 60, so that radii which do not fit the bins (those of another
// scene) do no harm.
PADDER_HD std::uint32_t radius_byte(float units) {
  const float up = ::ceilf(units);
  return 256 - static_cast<std::uint32_t>(up < 1 ? 1.0f : up > 60 ? 60.0f : up);
}

// The bin of a coordinate in the float bins of a hashed level, and how far it is from the bin's face.
struct FloatSplit {
  std::int32_t bin;
  float rest;
};
PADDER_HD FloatSplit float_split(float x, float size, float per_size) {
  float b = ::floorf(x * per_size), rest = ::fmaf(-b, size, x);
  if (rest < 0)
    b -= 1, rest = ::fmaf(-b, size, x);
  else if (rest >= size)
    b += 1, rest = ::fmaf(-b, size, x);
  return {static_cast<std::int32_t>(b), rest};
}

// The code of a float slot in bins of float; of a float slot by its level; of a fixed-point slot.
template <SlotKind Kind>
PADDER_HD std::uint32_t code_of(const FloatBins& b, const FloatSlot& s) {
  const auto unit = [&](float x, int k) {
    if (b.size > 0) {
      const FloatSplit s = float_split(x, b.size, b.per_size[0]);
      return static_cast<std::uint32_t>(s.bin * static_cast<std::int32_t>(kCodeUnits) +
                                        static_cast<std::int32_t>(::floorf(s.rest * b.units)));
    }
    return static_cast<std::uint32_t>(static_cast<std::int32_t>((x - b.origin[k]) * b.units));
  };
  return packed(unit(s.x, 0), unit(s.y, 1), unit(s.z, 2),
                Kind == SlotKind::equal ? 0 : radius_byte((s.r + b.grown_by) * b.units));
}
template <SlotKind Kind>
PADDER_HD std::uint32_t code_of(const Level& l, const FloatSlot& s) {
  const double units = l.per_size * kCodeUnits;
  const auto unit = [&](float x) {
    return static_cast<std::uint32_t>(static_cast<std::int64_t>(whole_below(x * units)));
  };
  return packed(unit(s.x), unit(s.y), unit(s.z),
                Kind == SlotKind::equal ? 0 : radius_byte(static_cast<float>((s.r + l.grown_by) * units)));
}
template <SlotKind Kind>
PADDER_HD std::uint32_t code_of(const Level&, const FixedPointSlot& s) {
  const auto unit = [](std::int32_t x) { return static_cast<std::uint32_t>(x) >> kFixedShift; };
  return packed(unit(s.x), unit(s.y), unit(s.z), radius_byte(s.r * (1.0f / (1 << kFixedShift))));
}

// The word from which a sphere that looks for partners subtracts their codes. With unequal radii it holds the
// sphere's own radius plus the slack, rounded up, and makes good the borrow that always comes.
template <SlotKind Kind>
PADDER_HD std::uint32_t seeker(std::uint32_t code) {
  if constexpr (Kind == SlotKind::equal)
    return code;
  else
    return (code & ~255u) + 256 + (256 - (code & 255)) + 4;
}
// Equal radii: a pair passes if its squared distance in units plus this is negative. Not used with unequal
// radii. `radius`: of the grown spheres.
inline std::int32_t code_limit(const Grid& grid, const FloatBins& bins, double radius) {
  const double units = bins.on ? bins.units : grid.level[0].per_size * kCodeUnits,
               most = 2 * radius * units * (1 + 0x1p-20) + kCodeSlack;
  return -static_cast<std::int32_t>(std::min(most * most, 0x1p20)) - 1;
}
// c plus the sum of the four products of the signed bytes of a and b.
PADDER_HD std::int32_t dot_bytes(std::uint32_t a, std::uint32_t b, std::int32_t c) {
#if defined(__CUDA_ARCH__)
  return __dp4a(static_cast<int>(a), static_cast<int>(b), c);
#else
  for (int k = 0; k < 32; k += 8) c += static_cast<std::int8_t>(a >> k) * static_cast<std::int8_t>(b >> k);
  return c;
#endif
}
// Negative where the two may touch. With unequal radii the lowest byte of the difference is s, the sum of
// both radii and the slack; its complement is -s - 1, and the product of the two subtracts s^2 + s.
template <SlotKind Kind>
PADDER_HD std::int32_t code_excess(std::uint32_t seeker, std::uint32_t code, std::int32_t limit) {
  const std::uint32_t d = seeker - code;
  if constexpr (Kind == SlotKind::equal)
    return dot_bytes(d, d, limit);
  else
    return dot_bytes(d, d ^ 255, 0);
}

}  // namespace padder::detect::cuda
