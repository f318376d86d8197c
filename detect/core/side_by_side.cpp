// SPDX-License-Identifier: MIT
#include "detect/core/side_by_side.h"

#include <algorithm>
#include <bit>

namespace padder::detect {

bool lay_side_by_side(const WorldBounds& b, std::uint64_t spheres, double margin, SideBySide& s,
                      double& extent) {
  const std::uint32_t last = b.many() ? b.last_world - b.first_world + (b.every > 0) : 0;
  if (b.sparse(spheres) || !(b.radius_min >= 0)) return false;
  const int bits = std::bit_width(last);
  s.first_world = b.first_world, s.last_box = last, s.bits_x = static_cast<std::uint32_t>(bits + 2) / 3,
  s.bits_y = static_cast<std::uint32_t>(bits + 1) / 3;
  const std::uint32_t most[3] = {std::min(last, (1u << s.bits_x) - 1),
                                 std::min(last >> s.bits_x, (1u << s.bits_y) - 1),
                                 last >> (s.bits_x + s.bits_y)};
  extent = 0;
  for (int c = 0; c < 3; c++) {
    const double wide = b.high[c] - b.low[c] + 2.5 * b.radius_max + 1.25 * margin;
    if (!(wide < 1e300 && wide > 1e-300)) return false;
    const double unit = std::ldexp(1, std::ilogb(wide) - 4),
                 middle = std::round((b.low[c] / 2 + b.high[c] / 2) / unit);
    if (!(magnitude(middle) < 0x1p40)) return false;
    s.middle[c] = middle * unit, s.step[c] = unit * (std::ceil(wide / unit) + 1);
    s.lowest[c] = -(most[c] * s.step[c]) / 2;
    extent = std::max(extent, (most[c] + 1.0) * s.step[c] / 2);
  }
  return extent < 1e300;
}

}  // namespace padder::detect
