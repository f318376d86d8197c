// SPDX-License-Identifier: MIT
#include "padding/geometry/point_tree.h"

#include <algorithm>

#include "padding/geometry/indices.h"

namespace padder {
namespace {

constexpr std::uint32_t kLeafPoints = 8;
constexpr std::uint32_t kTaskSize = 1 << 14;  // halves of more points are sorted side by side

std::uint32_t nodes_of(std::uint32_t points) {
  const std::uint32_t half = points / 2;
  return points <= kLeafPoints ? 0 : 1 + nodes_of(half) + nodes_of(points - half);
}

}  // namespace

PointTree::PointTree(std::vector<Point> points) : points_(std::move(points)) {
  const auto n = static_cast<std::uint32_t>(points_.size());
  order_ = numbered(n);
  if (n > kLeafPoints) {
    Box box;
    for (const Point& p : points_) box.add(p);
    nodes_.resize(nodes_of(n));
#pragma omp parallel if (n > kTaskSize)
#pragma omp single
    build(0, 0, n, box);
  }
  for (int axis = 0; axis < 3; axis++) {
    sorted_[axis].resize(n + kLeafPoints);
    for (std::uint32_t k = 0; k < n; k++) sorted_[axis][k] = points_[order_[k]][axis];
  }
}

std::vector<std::uint32_t> PointTree::renumber() {
  std::vector<std::uint32_t> before = numbered(order_.size());
  order_.swap(before);
  for (std::size_t k = 0; k < points_.size(); k++) points_[k] = {sorted_[0][k], sorted_[1][k], sorted_[2][k]};
  return before;
}

void PointTree::build(std::uint32_t index, std::uint32_t begin, std::uint32_t end, const Box& box) {
  if (end - begin <= kLeafPoints) return;
  int axis;
  (box.high - box.low).maxCoeff(&axis);
  const auto middle = begin + (end - begin) / 2;
  std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                   [&](auto s, auto t) {
                     const double x = points_[s][axis], y = points_[t][axis];
                     return x != y ? x < y : s < t;
                   });
  Box half[2];
  for (auto k = begin; k < end; k++) half[k >= middle].add(points_[order_[k]]);
  Node& node = nodes_[index];
  node.begin = begin, node.middle = middle, node.end = end, node.right = index + 1 + nodes_of(middle - begin);
  node.set(0, half[0]), node.set(1, half[1]);
  if (end - begin <= kTaskSize) {
    build(index + 1, begin, middle, half[0]);
    build(node.right, middle, end, half[1]);
    return;
  }
#pragma omp task
  build(index + 1, begin, middle, half[0]);
  build(node.right, middle, end, half[1]);
#pragma omp taskwait
}

void PointTree::find(const Point& center, double radius, std::vector<std::uint32_t>& found) const {
  if (points_.empty() || !(radius >= 0)) return;
  const double radius2 = radius * radius;
  const auto scan = [&](std::uint32_t begin, std::uint32_t count) {
    const double *x = &sorted_[0][begin], *y = &sorted_[1][begin], *z = &sorted_[2][begin];
    double distance2[kLeafPoints];
    for (std::uint32_t k = 0; k < kLeafPoints; k++) {
      const double u = x[k] - center.x(), v = y[k] - center.y(), w = z[k] - center.z();
      distance2[k] = u * u + (v * v + w * w);
    }
    std::uint32_t near[kLeafPoints], size = 0;
    for (std::uint32_t k = 0; k < count; k++) near[size] = order_[begin + k], size += distance2[k] <= radius2;
    found.insert(found.end(), near, near + size);
  };
  if (nodes_.empty()) return scan(0, static_cast<std::uint32_t>(points_.size()));
  struct Entry {
    std::uint32_t begin, end, node;
  };
  constexpr std::uint32_t inside = 0xffffffffu;
  Entry stack[64];  // median splits: the depth is log2(n / kLeafPoints)
  int top = 0;
  stack[top++] = {0, static_cast<std::uint32_t>(points_.size()), 0};
  while (top > 0) {
    const Entry entry = stack[--top];
    if (entry.node == inside) {
      found.insert(found.end(), order_.begin() + entry.begin, order_.begin() + entry.end);
      continue;
    }
    if (entry.end - entry.begin <= kLeafPoints) {
      scan(entry.begin, entry.end - entry.begin);
      continue;
    }
    const Node& node = nodes_[entry.node];
    const Eigen::Array2d near2 = node.distance2(center);
    Eigen::Array2d far2 = Eigen::Array2d::Zero();
    for (int k = 0; k < 3; k++) {
      const Eigen::Array2d far = (center[k] - node.low[k]).max(node.high[k] - center[k]);
      far2 += far * far;
    }
    if (near2[1] <= radius2) stack[top++] = {node.middle, node.end, far2[1] <= radius2 ? inside : node.right};
    if (near2[0] <= radius2)
      stack[top++] = {node.begin, node.middle, far2[0] <= radius2 ? inside : entry.node + 1};
  }
}

std::vector<std::uint32_t> sparse(const std::vector<Point>& points, const std::vector<std::uint32_t>& order,
                                  double spacing) {
  const PointTree tree(points);
  std::vector<char> gone(points.size());
  std::vector<std::uint32_t> near, taken;
  for (const auto k : order) {
    if (gone[k]) continue;
    taken.push_back(k);
    near.clear();
    tree.find(points[k], spacing, near);
    for (const auto other : near) gone[other] = 1;
  }
  return taken;
}

}  // namespace padder
