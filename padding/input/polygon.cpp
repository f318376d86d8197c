// SPDX-License-Identifier: MIT
#include "padding/input/polygon.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <set>

namespace padder {
namespace {

using Flat = std::array<double, 2>;

// Points in the cells of a grid: those that a thin triangle may hold are found without a look at all others.
class PointGrid {
 public:
  void fill(const std::vector<Flat>& points, const std::vector<std::uint32_t>& taken) {
    taken_ = taken, side_ = 1;
    low_ = {INFINITY, INFINITY};
    Flat high = {-INFINITY, -INFINITY};
    for (const std::uint32_t k : taken)
      for (std::size_t axis = 0; axis < 2; axis++)
        low_[axis] = std::min(low_[axis], points[k][axis]),
        high[axis] = std::max(high[axis], points[k][axis]);
    // Few points are looked at one by one, and so are those that no grid of numbers holds.
    const double span = std::max(high[0] - low_[0], high[1] - low_[1]);
    if (taken.size() > 64 && std::isfinite(span) && span > 0)
      side_ = static_cast<std::int64_t>(std::sqrt(double(taken.size())));
    cell_ = span / double(side_);
    first_.assign(static_cast<std::size_t>(side_ * side_) + 1, 0);
    if (side_ == 1) return void(first_ = {0, taken.size()});
    const auto place = [&](std::uint32_t k) { return cell(points[k][1], 1) * side_ + cell(points[k][0], 0); };
    for (const std::uint32_t k : taken) first_[static_cast<std::size_t>(place(k)) + 1]++;
    for (std::size_t c = 1; c < first_.size(); c++) first_[c] += first_[c - 1];
    std::vector<std::size_t> next(first_.begin(), first_.end() - 1);
    for (const std::uint32_t k : taken) taken_[next[static_cast<std::size_t>(place(k))]++] = k;
  }

  // Is `yes` true of a point that may lie in the triangle or at its border? Cells beside the triangle are
  // looked through as well, so that no rounding counts.
  template <class Yes>
  bool any(const std::array<Flat, 3>& triangle, const Yes& yes) const {
    if (side_ == 1) return std::any_of(taken_.begin(), taken_.end(), yes);
    const auto [low, high] = std::minmax({triangle[0][1], triangle[1][1], triangle[2][1]});
    for (std::int64_t row = before(low, 1), last = behind(high, 1); row <= last; row++) {
      const Flat span =
          across(triangle, low_[1] + double(row - 1) * cell_, low_[1] + double(row + 2) * cell_);
      for (std::int64_t c = before(span[0], 0), end = behind(span[1], 0); c <= end; c++) {
        const auto at = static_cast<std::size_t>(row * side_ + c);
        for (std::size_t k = first_[at]; k < first_[at + 1]; k++)
          if (yes(taken_[k])) return true;
      }
    }
    return false;
  }

 private:
  std::int64_t cell(double x, std::size_t axis) const {
    return static_cast<std::int64_t>(std::clamp((x - low_[axis]) / cell_, 0.0, double(side_ - 1)));
  }
  std::int64_t before(double x, std::size_t axis) const {
    return std::max<std::int64_t>(cell(x, axis) - 1, 0);
  }
  std::int64_t behind(double x, std::size_t axis) const { return std::min(cell(x, axis) + 1, side_ - 1); }

  // From where to where along x the part of the triangle with y from `low` to `high` reaches.
  static Flat across(const std::array<Flat, 3>& triangle, double low, double high) {
    Flat span = {INFINITY, -INFINITY};
    const auto add = [&](double x) { span = {std::min(span[0], x), std::max(span[1], x)}; };
    for (std::size_t k = 0; k < 3; k++) {
      const Flat &a = triangle[k], &b = triangle[(k + 1) % 3];
      if (a[1] >= low && a[1] <= high) add(a[0]);
      for (const double y : {low, high})
        if ((a[1] < y) != (b[1] < y)) add(a[0] + (b[0] - a[0]) * ((y - a[1]) / (b[1] - a[1])));
    }
    return span;
  }

  Flat low_ = {};
  double cell_ = 0;
  std::int64_t side_ = 1;
  std::vector<std::uint32_t> taken_;  // cell by cell
  std::vector<std::size_t> first_;    // of each cell, and the end
};

class Clipper {
 public:
  explicit Clipper(std::span<const Point> polygon) : n_(polygon.size()), points_(polygon) {
    // Newell's normal. The coordinate of its largest component is dropped, so the flat coordinates are the
    // given ones, without rounding.
    Vector normal = Vector::Zero();
    for (std::size_t k = 1; k + 1 < n_; k++)
      normal += (polygon[k] - polygon[0]).cross(polygon[k + 1] - polygon[0]);
    Eigen::Index drop;
    normal.cwiseAbs().maxCoeff(&drop);
    const Eigen::Index u = (drop + 1) % 3, v = (drop + 2) % 3;
    const double turn = normal[drop] < 0 ? -1 : 1;
    flat_.reserve(n_);
    for (const Point& p : polygon) flat_.push_back({p[u], turn * p[v]});
    next_.resize(n_), previous_.resize(n_), quality_.resize(n_);
    for (std::uint32_t k = 0; k < n_; k++) {
      next_[k] = k + 1 == n_ ? 0 : k + 1;
      previous_[k] = k == 0 ? static_cast<std::uint32_t>(n_ - 1) : k - 1;
    }
  }

  void run(std::vector<std::array<std::uint32_t, 3>>& triangles) {
    std::uint32_t any = 0;
    std::size_t left = n_;
    const auto clip = [&](std::uint32_t k) {
      triangles.push_back({previous_[k], k, next_[k]});
      next_[previous_[k]] = next_[k], previous_[next_[k]] = previous_[k];
      any = next_[k];
      left--;
    };
    // At first a corner that touches the ear blocks it. If no ear is left, only corners inside block it: a
    // polygon with a bridge to a hole touches itself.
    for (const bool strict : {false, true}) {
      bool found = true;
      // An ear may open far from the last cut: when the list is empty, all corners are looked at again.
      while (left > 3 && found) {
        ears_.clear();
        collect_reflex(any, left);
        for (std::uint32_t k = any, i = 0; i < left; k = next_[k], i++) offer(k, strict);
        found = !ears_.empty();
        while (left > 3 && !ears_.empty()) {
          const std::uint32_t k = ears_.rbegin()->second;
          ears_.erase(std::prev(ears_.end()));
          const std::uint32_t a = previous_[k], c = next_[k];
          ears_.erase({quality_[a], a}), ears_.erase({quality_[c], c});
          clip(k);
          offer(a, strict), offer(c, strict);
        }
      }
    }
    while (left >= 3) clip(any);  // the last triangle, or a polygon without an ear because it crosses itself
  }

 private:
  static double cross(const Flat& a, const Flat& b, const Flat& c) {
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
  }

  void collect_reflex(std::uint32_t first, std::size_t left) {
    std::vector<std::uint32_t> reflex;
    for (std::uint32_t k = first, i = 0; i < left; k = next_[k], i++)
      if (!(cross(flat_[previous_[k]], flat_[k], flat_[next_[k]]) > 0)) reflex.push_back(k);
    reflex_.fill(flat_, reflex);
  }

  // Puts corner k on the list if it and its neighbours form an ear.
  void offer(std::uint32_t k, bool strict) {
    const std::uint32_t i = previous_[k], j = next_[k];
    const Flat &a = flat_[i], &b = flat_[k], &c = flat_[j];
    if (!(cross(a, b, c) > 0)) return;
    // The list may still have corners that are no longer reflex or already cut. A cut corner lies in no ear
    // that is left, so it does no harm.
    const auto blocks = [&](std::uint32_t r) {
      const Flat& p = flat_[r];
      if (r == i || r == k || r == j || p == a || p == b || p == c) return false;
      const double low = std::min({cross(a, b, p), cross(b, c, p), cross(c, a, p)});
      return strict ? low > 0 : low >= 0;
    };
    if (reflex_.any({a, b, c}, blocks)) return;
    quality_[k] = shape(i, k, j);
    if (n_ == 4)
      quality_[k] = std::min(quality_[k], shape(j, next_[j], i));  // the triangle that is left counts too
    ears_.insert({quality_[k], k});
  }

  // Twice the area over the square of the longest side: it grows with the smallest angle and has no unit.
  double shape(std::uint32_t i, std::uint32_t j, std::uint32_t k) const {
    const Vector ab = points_[j] - points_[i], ac = points_[k] - points_[i], bc = points_[k] - points_[j];
    const double longest = std::max({ab.squaredNorm(), ac.squaredNorm(), bc.squaredNorm()});
    return longest > 0 && std::isfinite(longest) ? ab.cross(ac).norm() / longest : 0;
  }

  std::size_t n_;
  std::span<const Point> points_;
  std::vector<Flat> flat_;
  std::vector<std::uint32_t> next_, previous_;
  PointGrid reflex_;
  std::vector<double> quality_;
  std::set<std::pair<double, std::uint32_t>> ears_;
};

}  // namespace

void triangulate_polygon(std::span<const Point> polygon,
                         std::vector<std::array<std::uint32_t, 3>>& triangles) {
  if (polygon.size() < 3) return;
  if (polygon.size() == 3)
    triangles.push_back({0, 1, 2});
  else
    Clipper(polygon).run(triangles);
}

}  // namespace padder
