// SPDX-License-Identifier: MIT
// The table in which the balls of static elements wait, so that a moving ball finds those near it. Built on
// the host, searched by both backends. Internal.
#pragma once
#include <span>
#include <vector>

#include "detect/core/grid.h"

namespace padder::detect {

// Static elements in the bins of their balls' centres. A ball that moves is held against it level by level,
// over all bins within reach, however many of its bins it covers.
struct StaticTable {
  struct Bounds {
    double low[3], high[3];  // of the centres of a level
    friend bool operator==(const Bounds&, const Bounds&) = default;
  };
  Grid grid;
  Bounds bounds[kMaxLevels] = {};
  std::uint32_t count = 0;
  std::vector<std::uint32_t> starts;    // of each bucket, and the end
  std::vector<std::uint32_t> elements;  // in the order of bins, then of elements
  std::vector<Sphere> balls;            // the same order

  // balls[k] is that of element first + k. False when one of them is faulty: then there is no table.
  bool build(std::span<const Sphere> all, std::uint32_t first);
};

// The table as the search reads it, in the memory of whoever searches.
struct StaticView {
  StaticTable::Bounds bounds[kMaxLevels] = {};
  const std::uint32_t* starts = nullptr;
  const std::uint32_t* elements = nullptr;
  const Sphere* balls = nullptr;
  friend bool operator==(const StaticView&, const StaticView&) = default;
};

// The bins of a level that may hold the centre of a ball which `ball` touches; false: none. `whole` when all
// of the level is to be looked at instead, for it has fewer balls than the box has rows (bins where it is
// hashed).
struct BinBox {
  std::int64_t low[3], high[3];
  bool whole = false;
};
PADDER_HD bool bins_in_reach(const Level& l, const StaticTable::Bounds& bounds, const Sphere& ball,
                             std::uint32_t population, BinBox& box) {
  const double c[3] = {ball.x, ball.y, ball.z}, reach = (ball.r + l.radius_max) * (1 + 0x1p-20);
  double bins = 1;
  for (int k = 0; k < 3; k++) {
    // Cut to where there are centres before a bin is asked for: far outside there are no bin numbers.
    const double low = larger(c[k] - reach - magnitude(c[k]) * 0x1p-50, bounds.low[k]),
                 high = smaller(c[k] + reach + magnitude(c[k]) * 0x1p-50, bounds.high[k]);
    if (!(low <= high)) return false;
    box.low[k] = split(l, low).bin, box.high[k] = split(l, high).bin;
    if (k > 0 || l.hashed) bins *= static_cast<double>(box.high[k] - box.low[k] + 1);
  }
  box.whole = bins > population;
  return true;
}

}  // namespace padder::detect
