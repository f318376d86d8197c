// SPDX-License-Identifier: MIT
#include "padding/geometry/balls.h"

#include <algorithm>
#include <cmath>

namespace padder {
namespace {

constexpr std::uint32_t kLeafBalls = 4;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kBallStack = 128;  // median splits: the depth is log2(n / kLeafBalls)

}  // namespace

BallSet::BallSet(std::vector<Ball> balls) : balls_(std::move(balls)) {
  const auto n = static_cast<std::uint32_t>(balls_.size());
  slots_.resize(n);
  for (std::uint32_t k = 0; k < n; k++) slots_[k] = {balls_[k], k};
  if (n == 0) return;
  nodes_.reserve(n / 2 + 1);
  build(0, n);
}

// Splits at the median along the dimension with the widest spread. The radius is the fourth dimension.
std::uint32_t BallSet::build(std::uint32_t begin, std::uint32_t end) {
  const auto less_along = [](int axis) {
    return [axis](const Slot& s, const Slot& t) {
      const double x = axis < 3 ? s.ball.center[axis] : s.ball.radius;
      const double y = axis < 3 ? t.ball.center[axis] : t.ball.radius;
      return x != y ? x < y : s.index < t.index;
    };
  };
  Box centers;
  double small = kInfinity, large = 0;
  for (auto k = begin; k < end; k++) {
    centers.add(slots_[k].ball.center);
    small = std::min(small, slots_[k].ball.radius), large = std::max(large, slots_[k].ball.radius);
  }
  int axis;
  if ((centers.high - centers.low).maxCoeff(&axis) < large - small) axis = 3;
  const auto middle = begin + (end - begin) / 2;
  std::nth_element(slots_.begin() + begin, slots_.begin() + middle, slots_.begin() + end, less_along(axis));

  const auto index = static_cast<std::uint32_t>(nodes_.size());
  nodes_.emplace_back();
  const std::uint32_t from[2] = {begin, middle}, to[2] = {middle, end};
  for (int side = 0; side < 2; side++) {
    Box box;
    double radius = 0;
    for (auto k = from[side]; k < to[side]; k++) {
      box.add(slots_[k].ball.center);
      radius = std::max(radius, slots_[k].ball.radius);
    }
    std::uint32_t child = from[side], count = to[side] - from[side];
    if (count > kLeafBalls) child = build(from[side], to[side]), count = 0;
    Node& node = nodes_[index];
    node.set(side, box);
    node.radius[side] = radius, node.child[side] = child, node.count[side] = count;
  }
  return index;
}

// Visits leaves as long as their lower bound is not above `limit`, the nearer child first. The visit may
// lower `limit`, and returns true to stop. A single ball leaves an empty child, whose bound is infinite.
template <class Visit>
void BallSet::traverse(const Point& x, double& limit, Visit&& visit) const {
  if (nodes_.empty()) return;
  struct Entry {
    double bound;
    std::uint32_t child, count;
  };
  Entry stack[kBallStack];
  int top = 0;
  stack[top++] = {-kInfinity, 0, 0};
  while (top > 0) {
    const Entry entry = stack[--top];
    if (entry.bound > limit) continue;
    if (entry.count > 0) {
      for (auto k = entry.child; k < entry.child + entry.count; k++)
        if (visit(slots_[k])) return;
      continue;
    }
    const Node& node = nodes_[entry.child];
    const Eigen::Array2d bound = node.distance2(x).sqrt() - node.radius;
    const int near = bound[1] < bound[0];
    for (int side : {1 - near, near})
      if (bound[side] <= limit && bound[side] < kInfinity)
        stack[top++] = {bound[side], node.child[side], node.count[side]};
  }
}

BallGap BallSet::gap(const Point& x, double limit) const {
  BallGap best;
  traverse(x, limit, [&](const Slot& slot) {
    const double value = gap_to(slot.ball, x);
    if (value < limit || (value == limit && value == best.value && slot.index < best.ball))
      limit = best.value = value, best.ball = slot.index;
    return false;
  });
  return best;
}

std::optional<std::uint32_t> BallSet::containing(const Point& x, double margin) const {
  double limit = -margin;
  std::optional<std::uint32_t> found;
  traverse(x, limit, [&](const Slot& slot) {
    if (gap_to(slot.ball, x) <= -margin) found = slot.index;
    return found.has_value();
  });
  return found;
}

void BallSet::find(const Point& x, double distance, std::vector<std::uint32_t>& found) const {
  traverse(x, distance, [&](const Slot& slot) {
    if (gap_to(slot.ball, x) < distance) found.push_back(slot.index);
    return false;
  });
}

}  // namespace padder
