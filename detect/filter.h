// SPDX-License-Identifier: MIT
// Families and masks (section 2.3 of the paper): which spheres may touch which. For host and device.
#pragma once
#include "detect/host_device.h"

namespace padder::detect {

// What decides with which others a sphere may be in contact.
struct Filter {
  std::uint32_t family = 0;  // 0: the sphere is in no family
  std::uint32_t mask = 0;    // bit k: no contact with family k + 1; families above 32 cannot be masked
  // 0 for a loose sphere, else 1 + the number of its body; plus kStatic if it is static.
  std::uint32_t owner = 0;
};
// The bit of Filter::owner that marks static spheres.
inline constexpr std::uint32_t kStatic = 1u << 31;
// The value of Filter::owner for the spheres of a body.
PADDER_HD std::uint32_t owner_of(std::uint32_t body, bool is_static) {
  return (body + 1) | (is_static ? kStatic : 0);
}

// The world whose spheres meet those of all worlds, and each other (Body::world, Spheres::world).
inline constexpr std::uint32_t kEveryWorld = 0xffffffffu;
// May spheres of these worlds be in contact? Symmetric.
PADDER_HD bool worlds_meet(std::uint32_t a, std::uint32_t b) {
  return a == b || a == kEveryWorld || b == kEveryWorld;
}

// Does the mask exclude the family? 1 or 0.
PADDER_HD std::uint32_t masks(std::uint32_t mask, std::uint32_t family) {
  const std::uint32_t bit = family - 1u;
  return static_cast<std::uint32_t>(bit < 32u) & (mask >> (bit & 31u));
}
// May two spheres be in contact? Not if both are static, if they belong to the same body or to the same
// family, or if the mask of one excludes the family of the other. Symmetric. Without a branch, which would be
// mispredicted for every other pair.
PADDER_HD bool admitted(const Filter& a, const Filter& b) {
  const std::uint32_t both_static = a.owner & b.owner & kStatic,
                      masked = masks(a.mask, b.family) | masks(b.mask, a.family);
  const bool same_body = (a.owner == b.owner) & (a.owner != 0),
             same_family = (a.family == b.family) & (a.family != 0);
  return (both_static | masked | static_cast<std::uint32_t>(same_body | same_family)) == 0;
}

}  // namespace padder::detect
