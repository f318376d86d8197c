// SPDX-License-Identifier: MIT
#include "padding/input/polygon.h"

#include <Eigen/Geometry>
#include <cmath>
#include <set>

namespace padder {
namespace {

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
  using Flat = std::array<double, 2>;

  static double cross(const Flat& a, const Flat& b, const Flat& c) {
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
  }

  void collect_reflex(std::uint32_t first, std::size_t left) {
    reflex_.clear();
    for (std::uint32_t k = first, i = 0; i < left; k = next_[k], i++)
      if (!(cross(flat_[previous_[k]], flat_[k], flat_[next_[k]]) > 0)) reflex_.push_back(k);
  }

  // Puts corner k on the list if it and its neighbours form an ear.
  void offer(std::uint32_t k, bool strict) {
    const std::uint32_t i = previous_[k], j = next_[k];
    const Flat &a = flat_[i], &b = flat_[k], &c = flat_[j];
    if (!(cross(a, b, c) > 0)) return;
    // The list may still have corners that are no longer reflex or already cut. A cut corner lies in no ear
    // that is left, so it does no harm.
    for (const std::uint32_t r : reflex_) {
      const Flat& p = flat_[r];
      if (r == i || r == k || r == j || p == a || p == b || p == c) continue;
      const double low = std::min({cross(a, b, p), cross(b, c, p), cross(c, a, p)});
      if (strict ? low > 0 : low >= 0) return;
    }
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
  std::vector<std::uint32_t> next_, previous_, reflex_;
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
