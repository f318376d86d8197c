// SPDX-License-Identifier: MIT
// What a survey of spheres must find, without the survey.
#pragma once
#include <algorithm>
#include <cmath>
#include <vector>

#include "detect/core/grid.h"

namespace padder::detect {

inline Summary summary_of(const std::vector<Sphere>& spheres) {
  Summary s;
  s.count = spheres.size(), s.octaves_known = true;
  for (const Sphere& p : spheres) s.need_max = std::max(s.need_max, need_of(p));
  for (const Sphere& p : spheres) {
    Summary::Octave& o = s.octave[octave_of(exponent_of(s.need_max), need_of(p))];
    const double c[3] = {p.x, p.y, p.z};
    o.count++, o.need_max = std::max(o.need_max, need_of(p)), o.radius_max = std::max(o.radius_max, p.r);
    s.radius_max = std::max(s.radius_max, p.r), s.radius_min = std::min(s.radius_min, p.r),
    s.radius_sum += p.r;
    for (int k = 0; k < 3; k++) {
      o.low[k] = std::min(o.low[k], c[k]), o.high[k] = std::max(o.high[k], c[k]);
      s.low[k] = std::min(s.low[k], c[k]), s.high[k] = std::max(s.high[k], c[k]);
      s.extent = std::max(s.extent, std::abs(c[k]));
    }
  }
  return s;
}

}  // namespace padder::detect
