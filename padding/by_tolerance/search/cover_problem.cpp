// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/search/cover_problem.h"

#include <cmath>

namespace padder {

namespace {

// What a candidate covers: points within `reach` of its centre, less `slope` times their margin.
struct CoveredPart {
  double reach, slope;

  CoveredPart(const Candidate& c, double gap) {
    // Less by more than rounding, so that the certificate cannot disagree.
    reach = (c.ball.radius + gap) * (1 - 1e-12);
    // How fast the distance to the centre grows along a flat surface where the surface leaves the ball.
    const double cosine = c.inner_distance / reach;
    slope = std::sqrt(std::max(0.0, 1 - cosine * cosine));
  }
  double depth(const Candidate& c, const CoverPoint& point) const {
    return reach - slope * point.margin - (point.point - c.ball.center).norm();
  }
};

}  // namespace

// Builds a tree over the points from `first` on and numbers them in its order: points that one ball covers
// then lie side by side in memory, which saves much time. Many small trees would cost more than one. So when
// there are several, all but the large first one are built again as one; its points keep their numbers.
void CoverProblem::add_group(std::size_t first) {
  constexpr std::size_t most_groups = 4;
  const bool one = groups_.size() == most_groups;
  if (one) first = groups_[1].first, groups_.resize(1);
  std::vector<Point> places;
  for (std::size_t k = first; k < points_.size(); k++) places.push_back(points_[k].point);
  PointTree tree(std::move(places));
  if (!one) {  // others know the numbers of points that were there before
    const std::vector<CoverPoint> given(points_.begin() + static_cast<std::ptrdiff_t>(first), points_.end());
    for (const auto k : tree.renumber()) points_[first++] = given[k];
    first -= given.size();
  }
  groups_.push_back({first, std::make_shared<const PointTree>(std::move(tree))});
}

// Looks at new pairs only: candidates from `first_candidate` on with all points, the candidates before it
// with the points from `first_point` on.
void CoverProblem::find_covered(std::size_t first_candidate, std::size_t first_point) {
  const std::size_t begin = first_point < points_.size() ? 0 : first_candidate;
#pragma omp parallel for schedule(dynamic, 64) if (candidates_.size() - begin > 256)
  for (std::size_t k = begin; k < candidates_.size(); k++) {
    const std::size_t first = k < first_candidate ? first_point : 0;
    const Candidate& c = candidates_[k];
    const CoveredPart part(c, gap_);
    thread_local std::vector<std::uint32_t> found;
    for (const Group& group : groups_) {
      if (group.first + group.tree->size() <= first) continue;
      found.clear();
      group.tree->find(c.ball.center, part.reach, found);
      for (auto in_group : found) {
        const std::size_t point = group.first + in_group;
        if (point >= first && part.depth(c, points_[point]) >= 0)
          covered_[k].push_back(static_cast<std::uint32_t>(point));
      }
    }
  }
}

void CoverProblem::add(const std::vector<CoverPoint>& points, const std::vector<Candidate>& candidates) {
  const std::size_t first_point = points_.size(), first_candidate = candidates_.size();
  points_.insert(points_.end(), points.begin(), points.end());
  if (!points.empty()) add_group(first_point);
  candidates_.insert(candidates_.end(), candidates.begin(), candidates.end());
  covered_.resize(candidates_.size());
  find_covered(first_candidate, first_point);
}

double CoverProblem::depth(const Candidate& candidate, const CoverPoint& point) const {
  return CoveredPart(candidate, gap_).depth(candidate, point);
}

void CoverProblem::keep(const std::vector<std::uint32_t>& candidates) {
  std::vector<Candidate> kept;
  std::vector<std::vector<std::uint32_t>> covered;
  for (auto k : candidates) kept.push_back(candidates_[k]), covered.push_back(std::move(covered_[k]));
  candidates_.swap(kept), covered_.swap(covered);
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
