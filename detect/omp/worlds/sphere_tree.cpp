// SPDX-License-Identifier: MIT
#include "detect/omp/worlds/sphere_tree.h"

#include <algorithm>

namespace padder::detect::omp {

CurveBox curve_box(const Sphere* balls, std::uint32_t count) {
  constexpr std::uint32_t kSample = 1024;
  const std::uint32_t n = std::min(count, kSample);
  std::vector<double> at[3];
  for (std::uint32_t k = 0; k < n; k++) {
    const Sphere& s = balls[std::uint64_t(k) * count / n];
    at[0].push_back(s.x), at[1].push_back(s.y), at[2].push_back(s.z);
  }
  CurveBox box;
  for (int c = 0; c < 3; c++) {
    std::sort(at[c].begin(), at[c].end());
    set_axis(box, c, at[c][n / 64], at[c][n - 1 - n / 64]);
  }
  return box;
}

void SphereTree::build(const Sphere* spheres, std::uint32_t count, int threads) {
  tree_.levels = WideTreeLevels::of(count);
  tree_.groups = groups_.resize(tree_.levels.first[tree_.levels.count], "the tree of worlds");
  for (int level = 0; level < tree_.levels.count; level++) {
    const auto boxes = static_cast<std::int64_t>(tree_.boxes_of(level));
#pragma omp parallel for schedule(static) num_threads(threads)
    for (std::int64_t k = 0; k < boxes; k++) tree_.set(level, static_cast<std::uint32_t>(k), spheres, count);
  }
}

}  // namespace padder::detect::omp
