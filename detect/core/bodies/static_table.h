// SPDX-License-Identifier: MIT
// The table in which the balls of static elements wait, so that a moving ball finds those near it. Built on
// the host, searched by both backends. Internal.
#pragma once
#include <span>
#include <vector>

#include "detect/core/grid.h"

namespace padder::detect {

// The balls of static elements, each in the bin of its centre. A moving ball searches the table level by
// level, in all bins that bins_near() names.
struct StaticTable {
  struct Bounds {
    double low[3], high[3];  // bounds of the centres of a level
    friend bool operator==(const Bounds&, const Bounds&) = default;
  };
  Grid grid;
  Bounds bounds[kMaxLevels] = {};
  std::uint32_t count = 0;
  std::vector<std::uint32_t> starts;    // where each bucket begins in `elements`, and the end
  std::vector<std::uint32_t> elements;  // ordered by bin, and inside a bin by their number
  std::vector<Sphere> balls;            // in the same order

  // all[k] is the ball of element first + k. False if one of them is faulty; then there is no table.
  bool build(std::span<const Sphere> all, std::uint32_t first);
};

// The arrays of the table in the memory of the backend that searches it.
struct StaticView {
  StaticTable::Bounds bounds[kMaxLevels] = {};
  const std::uint32_t* starts = nullptr;
  const std::uint32_t* elements = nullptr;
  const Sphere* balls = nullptr;
  friend bool operator==(const StaticView&, const StaticView&) = default;
};

// Bins of a level, as a box. `whole`: all balls of the level are to be tested instead, because they are fewer
// than the rows of the box (than its bins, if the level is hashed).
struct BinBox {
  std::int64_t low[3], high[3];
  bool whole = false;
};
// The bins that hold the centres of all balls of the level that `ball` may touch. False if there are none.
// `population`: the number of balls of the level.
PADDER_HD bool bins_near(const Level& l, const StaticTable::Bounds& bounds, const Sphere& ball,
                         std::uint32_t population, BinBox& box) {
  const double c[3] = {ball.x, ball.y, ball.z}, search_radius = (ball.r + l.radius_max) * (1 + 0x1p-20);
  double bins = 1;
  for (int k = 0; k < 3; k++) {
    // The box is cut to the bounds of the centres before bins are computed, because far outside there are no
    // bin numbers.
    const double low = larger(c[k] - search_radius - magnitude(c[k]) * 0x1p-50, bounds.low[k]),
                 high = smaller(c[k] + search_radius + magnitude(c[k]) * 0x1p-50, bounds.high[k]);
    if (!(low <= high)) return false;
    box.low[k] = split(l, low).bin, box.high[k] = split(l, high).bin;
    if (k > 0 || l.hashed) bins *= static_cast<double>(box.high[k] - box.low[k] + 1);
  }
  box.whole = bins > population;
  return true;
}

}  // namespace padder::detect
