// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/cover_problem.h"

#include <cmath>

#include "padding/geometry/point_tree.h"

namespace padder {

// Looks at new pairs only: candidates from `first_candidate` on with all points, the candidates before it
// with the points from `first_point` on.
void CoverProblem::find_covered(std::size_t first_candidate, std::size_t first_point) {
  const auto tree_of = [&](std::size_t begin, std::size_t end) {
    std::vector<Point> points;
    for (std::size_t k = begin; k < end; k++) points.push_back(points_[k].point);
    return PointTree(std::move(points));
  };
  const PointTree old_points = tree_of(0, first_point), new_points = tree_of(first_point, points_.size());
#pragma omp parallel for schedule(dynamic, 64) if (candidates_.size() > 256)
  for (std::size_t k = 0; k < candidates_.size(); k++) {
    if (k < first_candidate && new_points.size() == 0) continue;
    const Candidate& c = candidates_[k];
    // Less by more than rounding, so that the certificate cannot disagree.
    const double r = (c.ball.radius + gap_) * (1 - 1e-12);
    // How fast the distance to the centre grows along a flat surface where the surface leaves the ball.
    const double cosine = c.inner_distance / r, slope = std::sqrt(std::max(0.0, 1 - cosine * cosine));
    std::vector<std::uint32_t> found;
    new_points.find(c.ball.center, r, found);
    for (auto& point : found) point += static_cast<std::uint32_t>(first_point);
    if (k >= first_candidate) old_points.find(c.ball.center, r, found);
    for (auto point : found)
      if ((points_[point].point - c.ball.center).norm() <= r - slope * points_[point].margin)
        covered_[k].push_back(point);
  }
}

void CoverProblem::add(const std::vector<CoverPoint>& points, const std::vector<Candidate>& candidates) {
  const std::size_t first_point = points_.size(), first_candidate = candidates_.size();
  points_.insert(points_.end(), points.begin(), points.end());
  candidates_.insert(candidates_.end(), candidates.begin(), candidates.end());
  covered_.resize(candidates_.size());
  find_covered(first_candidate, first_point);
}

void CoverProblem::keep(const std::vector<std::uint32_t>& candidates) {
  std::vector<Candidate> kept;
  std::vector<std::vector<std::uint32_t>> covered;
  for (auto k : candidates) kept.push_back(candidates_[k]), covered.push_back(std::move(covered_[k]));
  candidates_.swap(kept), covered_.swap(covered);
}

void CoverProblem::replace_points(const std::vector<CoverPoint>& points) {
  points_ = points;
  covered_.assign(candidates_.size(), {});
  find_covered(0, 0);
}

Sets CoverProblem::sets() const {
  Sets sets;
  std::size_t entries = 0;
  for (const auto& points : covered_) entries += points.size();
  sets.elements.reserve(entries), sets.begin.reserve(covered_.size() + 1);
  for (const auto& points : covered_) sets.add(points);
  return sets;
}

}  // namespace padder
