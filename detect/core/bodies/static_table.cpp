// SPDX-License-Identifier: MIT
#include "detect/core/bodies/static_table.h"

#include <algorithm>

namespace padder::detect {

bool StaticTable::build(std::span<const Sphere> all, std::uint32_t first) {
  Summary s;
  s.count = count = static_cast<std::uint32_t>(all.size());
  for (const Sphere& b : all) {
    if (fault_of(b) != Fault::none) return false;
    s.need_max = std::max(s.need_max, need_of(b));
  }
  s.octaves_known = true;
  std::vector<std::uint64_t> of_exponent(kExponents, 0);
  for (const Sphere& b : all) of_exponent[static_cast<std::size_t>(exponent_of(need_of(b)) + 1023)]++;
  if (count > 0) s.above = octaves_above(std::span<const std::uint64_t, kExponents>(of_exponent));
  const int top = exponent_of(s.need_max) - s.above;
  for (const Sphere& b : all) {
    Summary::Octave& o = s.octave[octave_of(top, need_of(b))];
    const double c[3] = {b.x, b.y, b.z};
    o.count++, o.need_max = std::max(o.need_max, need_of(b)), o.radius_max = std::max(o.radius_max, b.r);
    for (int k = 0; k < 3; k++) o.low[k] = std::min(o.low[k], c[k]), o.high[k] = std::max(o.high[k], c[k]);
  }
  grid = choose_grid(s, 0);
  std::fill_n(bounds, kMaxLevels, Bounds{{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}});
  std::vector<std::uint32_t> keys(all.size());
  starts.assign(std::uint64_t(grid.buckets) + 1, 0);
  for (std::size_t k = 0; k < all.size(); k++) {
    const int level = level_of(grid, all[k]);
    const double c[3] = {all[k].x, all[k].y, all[k].z};
    for (int a = 0; a < 3; a++) {
      bounds[level].low[a] = std::min(bounds[level].low[a], c[a]);
      bounds[level].high[a] = std::max(bounds[level].high[a], c[a]);
    }
    keys[k] = key_of(grid.level[level], bin_of(grid.level[level], all[k]));
    starts[keys[k] + 1]++;
  }
  for (std::size_t k = 1; k < starts.size(); k++) starts[k] += starts[k - 1];
  std::vector<std::uint32_t> at(starts.begin(), starts.end() - 1);
  elements.resize(all.size()), balls.resize(all.size());
  for (std::size_t k = 0; k < all.size(); k++) {
    const std::uint32_t to = at[keys[k]]++;
    elements[to] = first + static_cast<std::uint32_t>(k), balls[to] = all[k];
  }
  return true;
}

}  // namespace padder::detect
