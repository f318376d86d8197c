// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/fill.h"

#include <algorithm>
#include <cmath>

#include "padding/by_tolerance/cube.h"
#include "padding/by_tolerance/search/set_cover.h"
#include "padding/geometry/indices.h"

namespace padder {
namespace {

// A cell is cut until it is this much smaller than the ball that could fill it: a hollow is then met by few
// cells, and most places where only several balls together cover a cell are told from one.
constexpr double kSmallestCell = 1.0 / 32;

enum class Verdict { done, cut, fill, open };

class Fill {
 public:
  Fill(const Surface& surface, const BallSet& balls, const FillOptions& options)
      : surface_(surface), balls_(balls), options_(options) {}

  Filled run() {
    Filled filled;
    if (!surface_.closed() || surface_.hull() || !(options_.depth > 0) || !(options_.protrusion > 0))
      return filled;
    const Box box = surface_.bounds();
    std::vector<Cube> level = {{box.center(), 0.5 * (box.high - box.low).maxCoeff()}}, next, hollow;
    std::vector<Ball> fills;
    filled.covered = true;
    while (!level.empty()) {
      std::vector<Verdict> verdicts(level.size());
      std::vector<Ball> offers(level.size());
#pragma omp parallel for schedule(dynamic, 64) if (level.size() > 128)
      for (std::size_t k = 0; k < level.size(); k++) verdicts[k] = look(level[k], offers[k]);
      next.clear();
      for (std::size_t k = 0; k < level.size(); k++) {
        if (verdicts[k] == Verdict::open) filled.covered = false;
        if (verdicts[k] == Verdict::fill) hollow.push_back(level[k]), fills.push_back(offers[k]);
        if (verdicts[k] == Verdict::cut)
          for (int corner = 0; corner < 8; corner++) next.push_back(level[k].eighth(corner));
      }
      level.swap(next);
    }
    for (const std::size_t k : few(hollow, fills)) {
      filled.balls.push_back(fills[k]);
      filled.triangle.push_back(surface_.nearest(fills[k].center).triangle);
    }
    return filled;
  }

 private:
  // `offer` becomes the ball that fills the cell, where it must be filled.
  Verdict look(const Cube& cell, Ball& offer) const {
    const Point& c = cell.center;
    const double radius = cell.radius();
    // The ball whose sphere is the farthest from the centre is the one most likely to hold the cell.
    const BallGap gap = balls_.gap(c);
    if (gap.value + options_.moved + radius <= 0 || holds(balls_.balls()[gap.ball], cell))
      return Verdict::done;
    const double distance = surface_.nearest(c).distance;
    if (distance + radius <= options_.depth) return Verdict::done;
    // Without a winding number the centre lies on the surface, as far as rounding can tell.
    const auto winding = surface_.winding_number(c);
    const bool inside = winding && *winding > 0;
    if (distance > radius && !inside) return winding ? Verdict::done : Verdict::cut;
    if (!inside) return Verdict::cut;
    offer = {c, std::min(distance + options_.protrusion, options_.max_radius)};
    // A hollow is filled at once where the fill is sure to be needed.
    const double small = (gap.value > 0 ? 4 : 1) * kSmallestCell * offer.radius;
    if (radius > small) return Verdict::cut;
    return offer.radius >= options_.min_radius && holds(offer, cell) ? Verdict::fill : Verdict::open;
  }

  // Also once the ball is moved?
  bool holds(const Ball& ball, const Cube& cell) const {
    const Vector far = (cell.center - ball.center).cwiseAbs() + Vector::Constant(cell.half);
    return far.norm() <= ball.radius - options_.moved;
  }

  // A few of the fills that together hold all hollow cells. The largest come first, and each makes those
  // needless whose cells it holds; of the ones that are left, a greedy choice drops some more.
  std::vector<std::uint32_t> few(const std::vector<Cube>& hollow, const std::vector<Ball>& fills) const {
    std::vector<std::uint32_t> order = numbered(fills.size()), taken, cells;
    std::stable_sort(order.begin(), order.end(),
                     [&](auto a, auto b) { return fills[a].radius > fills[b].radius; });
    std::vector<char> held(hollow.size());
    Sets sets;
    for (auto k : order) {
      if (held[k]) continue;
      taken.push_back(k);
      cells.clear();
      for (std::uint32_t j = 0; j < hollow.size(); j++)
        if (holds(fills[k], hollow[j])) cells.push_back(j), held[j] = 1;
      sets.add(cells);
    }
    SetCover cover(sets, hollow.size());
    cover.greedy();
    std::vector<std::uint32_t> chosen;
    for (auto k : cover.best()) chosen.push_back(taken[k]);
    return chosen;
  }

  const Surface& surface_;
  const BallSet& balls_;
  const FillOptions& options_;
};

}  // namespace

Filled fill_body(const Surface& surface, const BallSet& balls, const FillOptions& options) {
  return Fill(surface, balls, options).run();
}

}  // namespace padder
