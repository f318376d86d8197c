// Families and masks (section 2.3 of the paper), for host and device. Stages 7 and 9 ask the same function.
#pragma once
#include "detect/host_device.h"

namespace padder::detect {

// Family and mask of a sphere (section 2.3 of the paper).
struct Filter {
  std::uint32_t family = 0;  // 0: none, equals nothing
  std::uint32_t mask = 0;    // bit k: no contact with family k + 1; families above 32 cannot be masked
};

// Two spheres of one family, or of which either masks the other's family, are no contact. Symmetric.
PADDER_HD bool masks(std::uint32_t mask, std::uint32_t family) {
  return family - 1u < 32u && (mask >> (family - 1u) & 1u) != 0;
}
PADDER_HD bool admitted(const Filter& a, const Filter& b) {
  if (a.family == b.family && a.family != 0) return false;
  return !masks(a.mask, b.family) && !masks(b.mask, a.family);
}

}  // namespace padder::detect
