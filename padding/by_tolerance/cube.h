// SPDX-License-Identifier: MIT
// A cell of an octree. Not installed.
#pragma once
#include <cmath>

#include "padding/asset/mesh.h"

namespace padder {

struct Cube {
  Point center;
  double half = 0;  // of its edge

  double radius() const { return std::sqrt(3.0) * half; }  // of the ball around it
  Cube eighth(int corner) const {                          // 0 to 7
    const double step = 0.5 * half;
    return {center + Vector(corner & 1 ? step : -step, corner & 2 ? step : -step, corner & 4 ? step : -step),
            step};
  }
};

}  // namespace padder
