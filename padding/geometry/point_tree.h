// SPDX-License-Identifier: MIT
// A static tree over points that answers which of them lie in a ball.
#pragma once
#include <cstdint>
#include <vector>

#include "padding/asset/mesh.h"

namespace padder {

// Keeps the points in the order of the tree, where each subtree is contiguous. So a subtree that lies inside
// the ball is reported without looking at its points. Does not change after construction, so any number of
// threads may ask.
class PointTree {
 public:
  PointTree() = default;
  explicit PointTree(std::vector<Point> points);

  // Appends the index of each point with |x - center| <= radius, in the order of the tree.
  void find(const Point& center, double radius, std::vector<std::uint32_t>& found) const;

  // Numbers the points in the order of the tree. Returns the index that each had.
  std::vector<std::uint32_t> renumber();

  const std::vector<Point>& points() const { return points_; }  // as given, or renumbered
  std::size_t size() const { return points_.size(); }

 private:
  // A child of at most leaf_points points has no node.
  struct Node : BoxPair {
    std::uint32_t begin, middle, end, right;  // the left child stands behind its parent
  };
  void build(std::uint32_t index, std::uint32_t begin, std::uint32_t end, const Box& box);

  std::vector<Point> points_;
  std::vector<double> sorted_[3];     // the coordinates in the order of the tree, and some zeros
  std::vector<std::uint32_t> order_;  // index of each of sorted_
  std::vector<Node> nodes_;
};

// Takes points in the given order, each unless one taken before lies within `spacing` of it. Returns their
// indices, in that order.
std::vector<std::uint32_t> sparse(const std::vector<Point>& points, const std::vector<std::uint32_t>& order,
                                  double spacing);

}  // namespace padder
