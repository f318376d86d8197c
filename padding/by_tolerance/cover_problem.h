// SPDX-License-Identifier: MIT
// The set cover problem behind a cover of a surface: rows to be covered, balls to choose from, and who covers
// whom.
#pragma once
#include <cstdint>
#include <vector>

#include "padding/by_tolerance/samples.h"
#include "padding/by_tolerance/set_cover.h"
#include "padding/geometry/balls.h"

namespace padder {

// A ball that may be chosen.
struct Candidate {
  Ball ball;                    // as it would be in the cluster
  double depth = 0;             // of its centre below the surface
  Point point = Point::Zero();  // of the surface, that it was grown from
  std::uint32_t triangle = 0;   // that the point lies on
};

// A ball covers a row if the row's point lies within `gap` of it; near the rim of what it covers by a margin
// as large as the row's own, measured along the surface, because the points around the row must be covered
// too.
class Pool {
 public:
  explicit Pool(double gap) : gap_(gap) {}

  void add(const std::vector<Row>& rows, const std::vector<Candidate>& candidates);
  void keep(const std::vector<std::uint32_t>& candidates);  // only these, in this order
  void replace_rows(const std::vector<Row>& rows);

  Sets sets() const;
  const std::vector<Row>& rows() const { return rows_; }
  const std::vector<Candidate>& candidates() const { return candidates_; }

 private:
  void cover(std::size_t first_candidate, std::size_t first_row);

  double gap_;
  std::vector<Row> rows_;
  std::vector<Candidate> candidates_;
  std::vector<std::vector<std::uint32_t>> covered_;  // rows of each candidate
};

}  // namespace padder
