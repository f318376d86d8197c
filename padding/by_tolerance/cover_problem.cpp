// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/cover_problem.h"

#include <cmath>

#include "padding/geometry/point_tree.h"

namespace padder {

// Candidates from the first given on learn of all rows, the others of the rows from the first given on.
void Pool::cover(std::size_t first_candidate, std::size_t first_row) {
  const auto tree_of = [&](std::size_t begin, std::size_t end) {
    std::vector<Point> points;
    for (std::size_t k = begin; k < end; k++) points.push_back(rows_[k].point);
    return PointTree(std::move(points));
  };
  const PointTree old_rows = tree_of(0, first_row), new_rows = tree_of(first_row, rows_.size());
#pragma omp parallel for schedule(dynamic, 64) if (candidates_.size() > 256)
  for (std::size_t k = 0; k < candidates_.size(); k++) {
    if (k < first_candidate && new_rows.size() == 0) continue;
    const Candidate& c = candidates_[k];
    const double r = (c.ball.radius + gap_) * (1 - 1e-12);  // the certificate must see it covered too
    // Slope of the distance to the ball along a flat surface, where it leaves the ball.
    const double cosine = c.depth / r, slope = std::sqrt(std::max(0.0, 1 - cosine * cosine));
    std::vector<std::uint32_t> found;
    new_rows.find(c.ball.center, r, found);
    for (auto& row : found) row += static_cast<std::uint32_t>(first_row);
    if (k >= first_candidate) old_rows.find(c.ball.center, r, found);
    for (auto row : found)
      if ((rows_[row].point - c.ball.center).norm() <= r - slope * rows_[row].margin)
        covered_[k].push_back(row);
  }
}

void Pool::add(const std::vector<Row>& rows, const std::vector<Candidate>& candidates) {
  const std::size_t first_row = rows_.size(), first_candidate = candidates_.size();
  rows_.insert(rows_.end(), rows.begin(), rows.end());
  candidates_.insert(candidates_.end(), candidates.begin(), candidates.end());
  covered_.resize(candidates_.size());
  cover(first_candidate, first_row);
}

void Pool::keep(const std::vector<std::uint32_t>& candidates) {
  std::vector<Candidate> kept;
  std::vector<std::vector<std::uint32_t>> covered;
  for (auto k : candidates) kept.push_back(candidates_[k]), covered.push_back(std::move(covered_[k]));
  candidates_.swap(kept), covered_.swap(covered);
}

void Pool::replace_rows(const std::vector<Row>& rows) {
  rows_ = rows;
  covered_.assign(candidates_.size(), {});
  cover(0, 0);
}

Sets Pool::sets() const {
  Sets sets;
  std::size_t entries = 0;
  for (const auto& rows : covered_) entries += rows.size();
  sets.rows.reserve(entries), sets.begin.reserve(covered_.size() + 1);
  for (const auto& rows : covered_) sets.add(rows);
  return sets;
}

}  // namespace padder
