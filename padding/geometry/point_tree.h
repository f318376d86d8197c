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

  const std::vector<Point>& points() const { return points_; }  // as given
  std::size_t size() const { return points_.size(); }

 private:
  struct Node {
    Point low, high;
    std::uint32_t begin, end, right;  // the left child stands behind its parent; right is 0 for a leaf
  };
  // Builds the subtree at nodes_[index] and returns the index behind it.
  std::uint32_t build(std::uint32_t index, std::uint32_t begin, std::uint32_t end);

  std::vector<Point> points_, sorted_;
  std::vector<std::uint32_t> order_;  // index of each of sorted_
  std::vector<Node> nodes_;
};

}  // namespace padder
