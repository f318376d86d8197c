// SPDX-License-Identifier: MIT
// The colours that tell families and bodies apart: the same in pictures, on the page and in files to look at.
#pragma once
#include <array>
#include <cstdint>

namespace padder {

using Colour = std::array<std::uint8_t, 3>;  // red, green, blue, sRGB

inline constexpr Colour kNoKind{232, 128, 58};  // of family 0
inline constexpr std::array<Colour, 12> kKinds{{{208, 64, 56},
                                                {48, 112, 192},
                                                {64, 152, 80},
                                                {226, 160, 40},
                                                {132, 88, 172},
                                                {40, 160, 168},
                                                {196, 92, 148},
                                                {128, 136, 52},
                                                {140, 92, 60},
                                                {92, 104, 208},
                                                {104, 184, 140},
                                                {120, 124, 132}}};

// Of a family, or of a body counted from 1. Colours repeat after twelve.
constexpr Colour colour_of_kind(std::uint64_t number) {
  return number == 0 ? kNoKind : kKinds[(number - 1) % kKinds.size()];
}

}  // namespace padder
