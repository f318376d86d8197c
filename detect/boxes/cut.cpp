// SPDX-License-Identifier: MIT
#include "detect/boxes/cut.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "padding/asset/error.h"

namespace padder::detect {
namespace {

constexpr std::size_t kTaskPoints = 4096;  // fewer points are not worth a task of their own

// How far the points spread along an axis, without the sixteenth at either end: one grain that flew away must
// not decide along which axis a pile is cut.
double spread_of(std::span<const WeightedPoint> points, int axis, std::vector<double>& scratch) {
  scratch.clear();
  for (const WeightedPoint& p : points) scratch.push_back(p.at[axis]);
  const auto nth = [&](std::size_t k) {
    std::nth_element(scratch.begin(), scratch.begin() + static_cast<std::ptrdiff_t>(k), scratch.end());
    return scratch[k];
  };
  const std::size_t low = points.size() / 16, high = points.size() - 1 - low;
  const double from = nth(low);
  return nth(high) - from;
}

// Any face of the region serves where there is nothing to separate: one of the two boxes is empty then.
double face_of(const Region& region) {
  if (std::isfinite(region.low[0])) return region.low[0];
  return std::isfinite(region.high[0]) ? region.high[0] : 0;
}

}  // namespace

// The plane with `share` of the weight below it, as nearly as the points allow.
BoxTree::Plane BoxTree::plane_of(std::span<WeightedPoint> points, double share, const Region& region) {
  if (points.empty()) return {0, face_of(region)};
  std::vector<double> scratch;
  scratch.reserve(points.size());
  double spread[3];
  int axes[3] = {0, 1, 2};
  for (int a = 0; a < 3; a++) spread[a] = spread_of(points, a, scratch);
  std::stable_sort(axes, axes + 3, [&](int a, int b) { return spread[a] > spread[b]; });
  double total = 0;
  for (const WeightedPoint& p : points) total += p.weight;
  const double wanted = share * total;
  for (const int axis : axes) {
    std::sort(points.begin(), points.end(), [axis](const WeightedPoint& p, const WeightedPoint& q) {
      return p.at[axis] != q.at[axis] ? p.at[axis] < q.at[axis] : p.weight < q.weight;
    });
    // Only where two coordinates differ can a plane pass between them.
    double below = 0, best = INFINITY, cut = 0;
    for (std::size_t k = 1; k < points.size(); k++) {
      below += points[k - 1].weight;
      const double a = points[k - 1].at[axis], b = points[k].at[axis];
      if (!(a < b)) continue;
      const double off = std::abs(below - wanted);
      if (off < best) {
        const double middle = std::midpoint(a, b);  // may round to a; the plane must be above a
        best = off, cut = middle > a ? middle : b;
      }
    }
    if (best < INFINITY) return {axis, cut};
  }
  return {0, points[0].at[0]};  // all at one place: the upper box takes them
}

// A subtree of `boxes` leaves takes 2 boxes - 1 nodes, in preorder. So every task knows its places.
void BoxTree::divide(std::span<WeightedPoint> points, std::uint32_t node, std::uint32_t first,
                     std::uint32_t boxes, const Region& region) {
  if (boxes == 1) {
    nodes_[node] = {0, first, kLeaf}, regions_[first] = region;
    return;
  }
  const std::uint32_t lower = boxes / 2;
  const Plane plane = plane_of(points, static_cast<double>(lower) / boxes, region);
  const auto middle = std::partition(points.begin(), points.end(),
                                     [&](const WeightedPoint& p) { return p.at[plane.axis] < plane.cut; });
  const auto count = static_cast<std::size_t>(middle - points.begin());
  const std::uint32_t upper = node + 2 * lower;
  nodes_[node] = {plane.cut, upper, static_cast<std::uint32_t>(plane.axis)};
  Region below = region, above = region;
  below.high[plane.axis] = above.low[plane.axis] = plane.cut;
#pragma omp task if (count > kTaskPoints)
  divide(points.first(count), node + 1, first, lower, below);
  divide(points.subspan(count), upper, first + lower, boxes - lower, above);
#pragma omp taskwait
}

std::uint32_t BoxTree::box_of(const double (&at)[3]) const {
  std::uint32_t node = 0;
  while (nodes_[node].axis != kLeaf)
    node = at[nodes_[node].axis] < nodes_[node].cut ? node + 1 : nodes_[node].upper;
  return nodes_[node].upper;
}

BoxTree cut_space(std::vector<WeightedPoint> points, std::uint32_t boxes, const Region& whole, int threads) {
  BoxTree tree;
  boxes = std::max(boxes, 1u);
  tree.nodes_.assign(2 * std::size_t(boxes) - 1, {});
  tree.regions_.assign(boxes, whole);
  for (WeightedPoint& p : points)
    for (int a = 0; a < 3; a++) p.at[a] = std::min(std::max(p.at[a], whole.low[a]), whole.high[a]);
#pragma omp parallel num_threads(threads)
#pragma omp single
  tree.divide(points, 0, 0, boxes, whole);
  return tree;
}

// Appends the nodes of a subtree in preorder.
void BoxTree::join(std::span<std::uint32_t> boxes, std::span<const Region> from, const Region& region) {
  if (boxes.size() == 1) {
    nodes_.push_back({0, boxes[0], kLeaf}), regions_[boxes[0]] = region;
    return;
  }
  // Along each axis the planes that cut no box; the one that halves the boxes best counts.
  std::size_t best = 0;
  int best_axis = 0;
  const auto sort_along = [&](int axis) {
    std::sort(boxes.begin(), boxes.end(), [&, axis](std::uint32_t a, std::uint32_t b) {
      const Region &p = from[a], &q = from[b];
      return p.low[axis] != q.low[axis] ? p.low[axis] < q.low[axis] : p.high[axis] < q.high[axis];
    });
  };
  const auto from_middle = [&](std::size_t k) {
    return k > boxes.size() - k ? 2 * k - boxes.size() : boxes.size() - 2 * k;
  };
  for (int axis = 0; axis < 3; axis++) {
    sort_along(axis);
    double reach = -INFINITY;
    for (std::size_t k = 1; k < boxes.size(); k++) {
      reach = std::max(reach, from[boxes[k - 1]].high[axis]);
      if (reach <= from[boxes[k]].low[axis] && std::isfinite(from[boxes[k]].low[axis]) &&
          (best == 0 || from_middle(k) < from_middle(best)))
        best = k, best_axis = axis;
    }
  }
  if (best == 0) throw Error("the boxes were not made by bisection: no plane separates them");
  sort_along(best_axis);
  const double cut = from[boxes[best]].low[best_axis];
  Region below = region, above = region;
  below.high[best_axis] = above.low[best_axis] = cut;
  const std::size_t node = nodes_.size();
  nodes_.push_back({cut, 0, static_cast<std::uint32_t>(best_axis)});
  join(boxes.first(best), from, below);
  nodes_[node].upper = static_cast<std::uint32_t>(nodes_.size());
  join(boxes.subspan(best), from, above);
}

BoxTree tree_of(std::span<const Region> boxes) {
  BoxTree tree;
  std::vector<std::uint32_t> all(boxes.size());
  std::iota(all.begin(), all.end(), 0);
  tree.nodes_.clear(), tree.regions_.assign(boxes.size(), {});
  tree.join(all, boxes, {});
  return tree;
}

double imbalance_of(const std::vector<double>& work) {
  double sum = 0, most = 0;
  for (const double w : work) sum += w, most = std::max(most, w);
  return sum > 0 ? most * static_cast<double>(work.size()) / sum : 1;
}

}  // namespace padder::detect
