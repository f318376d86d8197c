// SPDX-License-Identifier: MIT
// Loose spheres of many worlds as if the worlds lay side by side, each in a box of its own. Then spheres of
// two worlds are far from each other, and a search of the grid needs to know nothing of worlds. For host and
// device, except for what is marked as host code. Internal.
#pragma once
#include "detect/contact.h"
#include "detect/filter.h"

namespace padder::detect {

// World w is in box w - first_world, and kEveryWorld in the last one. The number of a box along x is so many
// of its lowest bits, along y so many of the next ones, and along z the rest.
struct SideBySide {
  double middle[3] = {};  // of each world
  double step[3] = {};    // from box to box
  double lowest[3] = {};  // the middle of box 0
  std::uint32_t first_world = 0, last_box = 0, bits_x = 0, bits_y = 0;
  friend bool operator==(const SideBySide&, const SideBySide&) = default;

  // All products and the sums in brackets are exact, so a coordinate is off by one rounding of its distance
  // from the middle of its world, and one of itself.
  PADDER_HD Sphere moved(const Sphere& s, std::uint32_t world) const {
    const std::uint32_t own = world - first_world, box = own < last_box ? own : last_box, y = box >> bits_x;
    return {add(sub(s.x, middle[0]), (lowest[0] + (box & ((1u << bits_x) - 1)) * step[0])),
            add(sub(s.y, middle[1]), (lowest[1] + (y & ((1u << bits_y) - 1)) * step[1])),
            add(sub(s.z, middle[2]), (lowest[2] + (y >> bits_y) * step[2])), s.r};
  }
};

// What the boxes follow from.
struct WorldBounds {
  double low[3], high[3];  // of the centres, whatever their world
  double radius_min, radius_max;
  std::uint32_t first_world, last_world;  // but for kEveryWorld; first > last: there are no others
  std::uint64_t every = 0;                // spheres of kEveryWorld

  // Are there two worlds whose spheres do not meet?
  bool many() const { return first_world < last_world; }
  // Do the numbers leave most boxes of so many spheres empty? Then ranks may take their place.
  static constexpr std::uint64_t kMostBoxesPerSphere = 4;
  bool sparse(std::uint64_t spheres) const {
    return many() && last_world - first_world >= kMostBoxesPerSphere * spheres;
  }
};

// Host code. Boxes for so many spheres, so far from each other that spheres of two of them do not come within
// `margin`. Spheres of kEveryWorld have a box of their own: who meets them there must be found in another
// way. Unless there is but one other world, or none: then all spheres are in one box. Lengths are rounded to
// a few bits, so that the boxes seldom change while spheres move. `extent`: no |coordinate| of a moved sphere
// is larger. False: some bound is no number, the worlds are sparse, or they lie so far from the origin, for
// their size, that moving would round more than the proof in docs/detector/exactness.md allows.
bool lay_side_by_side(const WorldBounds& bounds, std::uint64_t spheres, double margin, SideBySide& boxes,
                      double& extent);

}  // namespace padder::detect
