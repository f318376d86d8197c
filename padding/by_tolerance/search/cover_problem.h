// SPDX-License-Identifier: MIT
// The set cover problem behind a cover of a surface: points to cover, balls to choose from, and which ball
// covers which point.
#pragma once
#include <cstdint>
#include <memory>
#include <vector>

#include "padding/by_tolerance/search/samples.h"
#include "padding/by_tolerance/search/set_cover.h"
#include "padding/geometry/balls.h"
#include "padding/geometry/point_tree.h"

namespace padder {

// A ball that may be chosen.
struct Candidate {
  Ball ball;                    // as it would be in the cluster
  double inner_distance = 0;    // how far its centre lies below the surface
  Point point = Point::Zero();  // the point of the surface that it was grown from
  std::uint32_t triangle = 0;   // that this point lies on
};

// A ball covers a point that lies within `gap` of it. A point stands for the surface around it, as far as its
// margin. So near the rim of what the ball covers, the point must lie inside by its margin, measured along
// the surface.
class CoverProblem {
 public:
  explicit CoverProblem(double gap) : gap_(gap) {}

  // The points come behind those that are there, in an order of the problem's own.
  void add(const std::vector<CoverPoint>& points, const std::vector<Candidate>& candidates);
  // Drops all other candidates and takes these in this order.
  void keep(const std::vector<std::uint32_t>& candidates);

  // How deep the point lies inside what the candidate covers; below 0 where it is not covered.
  double depth(const Candidate& candidate, const CoverPoint& point) const;
  const std::vector<std::uint32_t>& covered(std::uint32_t candidate) const { return covered_[candidate]; }
  Sets sets() const;  // set k: the points that candidate k covers
  const std::vector<CoverPoint>& points() const { return points_; }
  const std::vector<Candidate>& candidates() const { return candidates_; }

 private:
  // Points that were added together. Copies of a problem share the trees.
  struct Group {
    std::size_t first;  // index of its first point
    std::shared_ptr<const PointTree> tree;
  };
  void add_group(std::size_t first);
  void find_covered(std::size_t first_candidate, std::size_t first_point);

  double gap_;
  std::vector<CoverPoint> points_;
  std::vector<Group> groups_;
  std::vector<Candidate> candidates_;
  std::vector<std::vector<std::uint32_t>> covered_;  // for each candidate, the points that it covers
};

}  // namespace padder
