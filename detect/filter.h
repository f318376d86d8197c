// SPDX-License-Identifier: MIT
// Families and masks (section 2.3 of the paper), for host and device. Stages 7 and 9 ask the same function.
#pragma once
#include "detect/host_device.h"

namespace padder::detect {

// Family and mask of a sphere (section 2.3 of the paper).
struct Filter {
  std::uint32_t family = 0;  // 0: none, equals nothing
  std::uint32_t mask = 0;    // bit k: no contact with family k + 1; families above 32 cannot be masked
  std::uint32_t owner = 0;   // 1 + the number of its body, 0: a loose sphere; kStatic added: it never moves
};
// Bit of Filter::owner.
inline constexpr std::uint32_t kStatic = 1u << 31;
// Filter::owner of the spheres of a body.
PADDER_HD std::uint32_t owner_of(std::uint32_t body, bool is_static) {
  return (body + 1) | (is_static ? kStatic : 0);
}

PADDER_HD bool masks(std::uint32_t mask, std::uint32_t family) {
  return family - 1u < 32u && (mask >> (family - 1u) & 1u) != 0;
}
// Two spheres of one body, of one family, two static ones, or two of which either masks the other's family,
// are no contact. Symmetric.
PADDER_HD bool admitted(const Filter& a, const Filter& b) {
  if (a.owner & b.owner & kStatic) return false;
  if (a.owner == b.owner && a.owner != 0) return false;
  if (a.family == b.family && a.family != 0) return false;
  return !masks(a.mask, b.family) && !masks(b.mask, a.family);
}

}  // namespace padder::detect
