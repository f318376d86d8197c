// SPDX-License-Identifier: MIT
#include "detect/boxes/cut.h"

#include <algorithm>
#include <cmath>
#include <numeric>

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

}  // namespace padder::detect
