// SPDX-License-Identifier: MIT
// A static tree over points that answers: which points lie in this ball?
#pragma once
#include <cstdint>
#include <vector>

#include "padding/asset/mesh.h"

namespace padder {

// Keeps the points in the tree's own order, in which each subtree is one run: a subtree inside the ball is
// reported without looking at its points. Immutable after construction, so any number of threads may ask.
class PointTree {
 public:
  PointTree() = default;
  explicit PointTree(std::vector<Point> points);

  // Appends the index of each point with |x - center| <= radius, in ascending order of the tree.
  void find(const Point& center, double radius, std::vector<std::uint32_t>& found) const;

  const std::vector<Point>& points() const { return points_; }  // as given
  std::size_t size() const { return points_.size(); }

 private:
  struct Node {
    Point low, high;
    std::uint32_t begin, end, right;  // the left child follows its parent; right == 0: a leaf
  };
  std::uint32_t build(std::uint32_t begin, std::uint32_t end);

  std::vector<Point> points_, sorted_;
  std::vector<std::uint32_t> order_;  // index of each of sorted_
  std::vector<Node> nodes_;
};

}  // namespace padder
