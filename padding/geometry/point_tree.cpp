// SPDX-License-Identifier: MIT
#include "padding/geometry/point_tree.h"

#include <algorithm>
#include <numeric>

namespace padder {
namespace {

constexpr std::uint32_t leaf_points = 8;
constexpr std::uint32_t task_size = 1 << 14;  // halves of more points are sorted side by side

std::uint32_t nodes_of(std::uint32_t points) {
  const std::uint32_t half = points / 2;
  return points <= leaf_points ? 1 : 1 + nodes_of(half) + nodes_of(points - half);
}

}  // namespace

PointTree::PointTree(std::vector<Point> points) : points_(std::move(points)) {
  const auto n = static_cast<std::uint32_t>(points_.size());
  order_.resize(n);
  std::iota(order_.begin(), order_.end(), 0u);
  if (n > 0) {
    nodes_.resize(nodes_of(n));
#pragma omp parallel if (n > task_size)
#pragma omp single
    build(0, 0, n);
  }
  sorted_.resize(n);
  for (std::uint32_t k = 0; k < n; k++) sorted_[k] = points_[order_[k]];
}

std::uint32_t PointTree::build(std::uint32_t index, std::uint32_t begin, std::uint32_t end) {
  Box box;
  for (auto k = begin; k < end; k++) box.add(points_[order_[k]]);
  Node& node = nodes_[index];
  node = {box.low, box.high, begin, end, 0};
  if (end - begin <= leaf_points) return index + 1;
  int axis;
  (box.high - box.low).maxCoeff(&axis);
  const auto middle = begin + (end - begin) / 2;
  std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                   [&](auto s, auto t) {
                     const double x = points_[s][axis], y = points_[t][axis];
                     return x != y ? x < y : s < t;
                   });
  if (end - begin <= task_size) {
    node.right = build(index + 1, begin, middle);
    return build(node.right, middle, end);
  }
  node.right = index + 1 + nodes_of(middle - begin);
#pragma omp task
  build(index + 1, begin, middle);
  const std::uint32_t next = build(node.right, middle, end);
#pragma omp taskwait
  return next;
}

void PointTree::find(const Point& center, double radius, std::vector<std::uint32_t>& found) const {
  if (nodes_.empty() || !(radius >= 0)) return;
  const double radius2 = radius * radius;
  std::uint32_t stack[64];  // median splits: the depth is log2(n / leaf_points)
  int top = 0;
  stack[top++] = 0;
  while (top > 0) {
    const std::uint32_t index = stack[--top];
    const Node& node = nodes_[index];
    double near2 = 0, far2 = 0;
    for (int k = 0; k < 3; k++) {
      const double below = node.low[k] - center[k], above = center[k] - node.high[k];
      const double near = std::max({below, 0.0, above});
      const double far = std::max(-below, -above);
      near2 += near * near, far2 += far * far;
    }
    if (near2 > radius2) continue;
    if (far2 <= radius2) {
      found.insert(found.end(), order_.begin() + node.begin, order_.begin() + node.end);
    } else if (node.right == 0) {
      for (auto k = node.begin; k < node.end; k++)
        if ((sorted_[k] - center).squaredNorm() <= radius2) found.push_back(order_[k]);
    } else {
      stack[top++] = node.right, stack[top++] = index + 1;
    }
  }
}

}  // namespace padder
