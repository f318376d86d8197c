// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>

#include "padding/geometry/balls.h"
#include "padding/geometry/indices.h"
#include "padding/view/view.h"

namespace padder {
namespace {

constexpr double kCoarse = 1. / 50, kFine = 1. / 200;  // edges, as shares of the diagonal
constexpr double kBend = 0.06;                         // of the largest error: what interpolation may be off
constexpr std::size_t kMostTriangles = 100000;

using Middles = std::unordered_map<std::uint64_t, std::uint32_t>;  // of divided edges, by edge_of()

// Divides triangles edge by edge. Whether an edge is divided depends on it alone, so that the triangles on
// both of its sides agree and no crack opens.
class Division {
 public:
  explicit Division(View& view) : view_(view), fine_(view.errors.mesh) {
    const std::size_t levels = std::max<std::size_t>(1, view.rungs.size());
    for (std::size_t k = 0; k < levels; k++) {
      first_.push_back(view.rungs.empty() ? 0 : view.rungs[k].first);
      const std::size_t end = view.rungs.empty() ? view.size() : first_[k] + view.rungs[k].count;
      std::vector<Ball> balls;
      for (std::size_t s = first_[k]; s < end; s++) balls.push_back({view.centers[s], view.radii[s]});
      sets_.emplace_back(std::move(balls));
    }
    gaps_.resize(levels);
    fine_.points = view.mesh.points;
    diagonal_ = view.mesh.bounds().diagonal();
    find_gaps();
  }

  void run() {
    std::vector<Corners> active = view_.mesh.triangles, next;
    while (!active.empty() && fine_.triangles.size() + active.size() < kMostTriangles) {
      const Middles middles = divided_edges(active);
      find_gaps();
      next.clear();
      for (const Corners& t : active) divide(t, middles, next);
      std::swap(active, next);
    }
    fine_.triangles.insert(fine_.triangles.end(), active.begin(), active.end());
  }

  // The largest gap of the points that each sphere is nearest to.
  // Surface inside the body, which repair takes away, can lie deeper or farther off than the spheres are
  // wrong: nothing is beyond the protrusion of the sphere, nor beyond the gap that the level reports.
  void finish() {
    std::vector<std::uint8_t> used(fine_.points.size());
    for (const Corners& t : fine_.triangles)
      for (const std::uint32_t p : t) used[p] = 1;
    view_.gap.assign(view_.size(), 0.f);
    for (std::size_t k = 0; k < sets_.size(); k++) {
      std::vector<float>& out = view_.errors.gap.emplace_back(fine_.points.size(), 0.f);
      if (sets_[k].empty()) continue;
      const auto& accuracy = view_.rungs.empty() ? view_.accuracy : view_.rungs[k].accuracy;
      const double most = accuracy.empty() ? std::numeric_limits<double>::infinity() : accuracy[0].gap_max;
      for (std::size_t p = 0; p < out.size(); p++) {
        if (!used[p]) continue;
        const std::size_t sphere = first_[k] + gaps_[k][p].ball;
        const double depth = view_.protrusion.empty() ? most : view_.protrusion[sphere];
        out[p] = float(std::clamp(gaps_[k][p].value, -depth, most));
        view_.gap[sphere] = std::max(view_.gap[sphere], out[p]);
      }
    }
  }

 private:
  void find_gaps() {  // of the points that have none yet
    for (std::size_t k = 0; k < sets_.size(); k++) {
      if (sets_[k].empty()) continue;
      const auto begin = std::int64_t(gaps_[k].size()), end = std::int64_t(fine_.points.size());
      gaps_[k].resize(fine_.points.size());
#pragma omp parallel for schedule(dynamic, 256)
      for (std::int64_t p = begin; p < end; p++) gaps_[k][p] = sets_[k].gap(fine_.points[p]);
      for (std::int64_t p = begin; p < end; p++) largest_ = std::max(largest_, std::abs(gaps_[k][p].value));
    }
  }

  bool bends(std::uint32_t a, std::uint32_t b, const Point& middle) const {
    for (std::size_t k = 0; k < sets_.size(); k++) {
      if (sets_[k].empty()) continue;
      const double between = (gaps_[k][a].value + gaps_[k][b].value) / 2;
      if (std::abs(sets_[k].gap(middle).value - between) > kBend * largest_) return true;
    }
    return false;
  }

  // Those that are divided, which have their middle among the points then.
  Middles divided_edges(const std::vector<Corners>& triangles) {
    std::vector<std::uint64_t> edges;
    for (const Corners& t : triangles)
      for (int k = 0; k < 3; k++) edges.push_back(edge_of(t[k], t[(k + 1) % 3]));
    sort_unique(edges);
    std::vector<std::uint8_t> divide(edges.size());
    const auto n = std::int64_t(edges.size());
#pragma omp parallel for schedule(dynamic, 256)
    for (std::int64_t k = 0; k < n; k++) {
      const auto [a, b] = ends_of(edges[k]);
      const Point &from = fine_.points[a], &to = fine_.points[b];
      const double length = (from - to).norm();
      divide[k] =
          length > kCoarse * diagonal_ || (length > kFine * diagonal_ && bends(a, b, (from + to) / 2));
    }
    Middles middles;
    for (std::int64_t k = 0; k < n; k++) {
      if (!divide[k]) continue;
      const auto [a, b] = ends_of(edges[k]);
      middles.emplace(edges[k], std::uint32_t(fine_.points.size()));
      fine_.points.push_back((fine_.points[a] + fine_.points[b]) / 2);
    }
    return middles;
  }

  // Into 2, 3 or 4 triangles, which may be divided further, or none.
  void divide(const Corners& t, const Middles& middles, std::vector<Corners>& next) {
    Corners m;  // the middles of its edges, or its corner where there is none
    int first = -1, count = 0;
    for (int k = 0; k < 3; k++) {
      const auto middle = middles.find(edge_of(t[k], t[(k + 1) % 3]));
      m[k] = middle == middles.end() ? t[k] : middle->second;
      if (m[k] != t[k]) count++;
    }
    const auto has = [&](int k) { return m[k % 3] != t[k % 3]; };
    for (int k = 0; k < 3 && first < 0; k++)
      if (count == 3 || (count == 1 && has(k)) || (count == 2 && has(k) && has(k + 1))) first = k;
    const auto c = [&](int k) { return t[(first + k) % 3]; };
    const auto mid = [&](int k) { return m[(first + k) % 3]; };
    if (count == 0) {
      fine_.triangles.push_back(t);
    } else if (count == 1) {
      next.insert(next.end(), {{c(0), mid(0), c(2)}, {mid(0), c(1), c(2)}});
    } else if (count == 2) {
      next.insert(next.end(), {{mid(0), c(1), mid(1)}, {c(0), mid(0), mid(1)}, {c(0), mid(1), c(2)}});
    } else {
      next.insert(
          next.end(),
          {{c(0), mid(0), mid(2)}, {mid(0), c(1), mid(1)}, {mid(2), mid(1), c(2)}, {mid(0), mid(1), mid(2)}});
    }
  }

  View& view_;
  Mesh& fine_;
  std::vector<BallSet> sets_;  // by level of detail
  std::vector<std::size_t> first_;
  std::vector<std::vector<BallGap>> gaps_;  // by level, of each point
  double diagonal_ = 0, largest_ = 0;
};

}  // namespace

void add_errors(View& view) {
  view.errors = {};
  view.gap.clear();
  if (!view.has_mesh() || view.size() == 0) return;
  Division division(view);
  division.run();
  division.finish();
}

}  // namespace padder
