// SPDX-License-Identifier: MIT
#include "padding/verify/certify.h"

#include <algorithm>
#include <cmath>

namespace padder {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

// Cells smaller than this share of the largest coordinate are not split further: rounding rules below.
constexpr double smallest_cell = 1e-9;

// A centre that is nearer to the surface than this share of its radius lies on it: on a knife's edge no ball
// has its centre inside.
constexpr double on_surface = 1e-6;

double bound_by(const Ball& ball, const Cell& cell) {
  double far2 = 0;
  for (const Point& p : cell.corner) far2 = std::max(far2, (p - ball.center).squaredNorm());
  return std::sqrt(far2) - ball.radius;
}

// Tightens cell.bound by a ball's convex gap function.
void tighten(Cell& cell, const BallSet& balls, std::uint32_t ball) {
  cell.bound = std::min(cell.bound, bound_by(balls.balls()[ball], cell));
}

// The two halves across the longest edge. They keep the parent's bound, which holds for its parts.
std::array<Cell, 2> bisect(const Cell& cell) {
  int k = 0;
  double longest = -1;
  for (int e = 0; e < 3; e++) {
    const double length = (cell.corner[(e + 1) % 3] - cell.corner[e]).squaredNorm();
    if (length > longest) longest = length, k = e;
  }
  const Point middle = 0.5 * (cell.corner[k] + cell.corner[(k + 1) % 3]);
  std::array<Cell, 2> halves = {cell, cell};
  halves[0].corner[(k + 1) % 3] = middle;
  halves[1].corner[k] = middle;
  return halves;
}

Cell cell_of(const Mesh& mesh, std::size_t t) {
  Cell cell;
  cell.triangle = static_cast<std::uint32_t>(t);
  for (int k = 0; k < 3; k++) cell.corner[k] = mesh.corner(t, k);
  cell.bound = infinity;
  return cell;
}

double smallest_size(const Mesh& mesh) {
  const Box box = mesh.bounds();
  return box.empty()
             ? 0
             : smallest_cell * std::max(box.low.cwiseAbs().maxCoeff(), box.high.cwiseAbs().maxCoeff());
}

}  // namespace

double Cell::size() const {
  double longest = 0;
  for (int k = 0; k < 3; k++) longest = std::max(longest, (corner[(k + 1) % 3] - corner[k]).squaredNorm());
  return std::sqrt(longest);
}

ProtrusionBound protrusion_bound(const Surface& surface, const std::vector<Ball>& balls) {
  ProtrusionBound bound;
  bound.proved = surface.closed();
  bound.each.resize(balls.size());
  std::size_t outside = 0;
#pragma omp parallel for schedule(dynamic, 16) if (balls.size() > 64) reduction(+ : outside)
  for (std::size_t k = 0; k < balls.size(); k++) {
    const Ball& ball = balls[k];
    const Nearest at = surface.signed_nearest(ball.center);
    double distance = at.distance;
    // Where no winding number can be told the centre lies on the surface, but for rounding: outside is the
    // safe side.
    if (bound.proved) distance = std::copysign(distance, surface.winding_number(ball.center) > 0 ? -1. : 1.);
    bound.each[k] = ball.radius + distance;
    outside += distance > on_surface * ball.radius;
  }
  bound.outside = outside;
  for (std::size_t k = 0; k < balls.size(); k++)
    if (bound.each[k] > bound.max) bound.max = bound.each[k], bound.ball = static_cast<std::uint32_t>(k);
  return bound;
}

// Breadth first, one level of bisection at a time: what a level prunes depends only on the levels before, so
// the result is the same for any number of threads.
GapBound gap_bound(const Mesh& mesh, const BallSet& balls, double floor, double relative) {
  GapBound best;
  const std::size_t n = mesh.triangles.size();
  if (n == 0) return best;
  if (balls.empty()) {
    best.lower = best.upper = infinity, best.point = mesh.corner(0, 0);
    return best;
  }
  const double smallest = smallest_size(mesh);
  double pruned = 0;  // largest bound among the cells that were let go

  // Looks at a cell; true when it must be split. `hint` is the ball of the cell before: most often it settles
  // this one.
  const auto examine = [&](Cell& cell, std::uint32_t& hint, double enough) {
    tighten(cell, balls, hint);
    cell.value = -infinity;
    if (cell.bound <= enough) return false;
    cell.point = cell.centroid();
    const BallGap gap = balls.gap(cell.point);
    cell.value = gap.value, hint = gap.ball;
    tighten(cell, balls, hint);
    return cell.bound > enough;
  };
  // Up to the floor no share is added: a gap just below a tolerance is proved to keep it.
  const auto settled = [&](double lower) { return lower <= floor ? floor : lower * (1 + relative); };
  const auto improve = [&](const Cell& cell) {
    if (cell.value > best.lower)
      best.lower = cell.value, best.point = cell.point, best.triangle = cell.triangle;
  };

  std::vector<Cell> level, next;
  for (bool first = true; first || !level.empty(); first = false) {
    const double enough = settled(best.lower);
    const std::size_t count = first ? n : level.size();
    constexpr std::size_t block = 256;
    const std::size_t blocks = (count + block - 1) / block;
    struct Result {
      std::vector<Cell> open;
      double pruned = 0;
      Cell top;  // of the largest value
    };
    std::vector<Result> results(blocks);
#pragma omp parallel for schedule(dynamic, 4) if (blocks > 4)
    for (std::size_t b = 0; b < blocks; b++) {
      Result& result = results[b];
      result.top.value = -infinity;
      std::uint32_t hint = 0;
      const auto look = [&](Cell& cell) {
        const bool open = examine(cell, hint, enough);
        if (cell.value > result.top.value) result.top = cell;
        if (open)
          result.open.push_back(cell);
        else
          result.pruned = std::max(result.pruned, cell.bound);
      };
      for (std::size_t k = b * block; k < std::min(count, (b + 1) * block); k++) {
        if (first) {
          Cell cell = cell_of(mesh, k);
          look(cell);
        } else {
          for (Cell& half : bisect(level[k])) look(half);
        }
      }
    }
    next.clear();
    for (const Result& result : results) improve(result.top), pruned = std::max(pruned, result.pruned);
    const double now = settled(best.lower);
    for (const Result& result : results)
      for (const Cell& cell : result.open) {
        if (cell.bound > now && cell.size() > smallest)
          next.push_back(cell);
        else
          pruned = std::max(pruned, cell.bound);
      }
    level.swap(next);
  }
  best.upper = std::max({0.0, best.lower, pruned});
  return best;
}

std::vector<Cell> gap_failures(const Mesh& mesh, const BallSet& balls, double bound, double grain) {
  const std::size_t n = mesh.triangles.size();
  const double smallest = smallest_size(mesh);
  constexpr std::size_t block = 256;
  const std::size_t blocks = (n + block - 1) / block;
  std::vector<std::vector<Cell>> failed(blocks);
#pragma omp parallel for schedule(dynamic, 4) if (blocks > 4)
  for (std::size_t b = 0; b < blocks; b++) {
    std::vector<Cell> stack;
    std::uint32_t hint = 0;
    for (std::size_t t = b * block; t < std::min(n, (b + 1) * block); t++) {
      stack.push_back(cell_of(mesh, t));
      while (!stack.empty()) {
        Cell cell = stack.back();
        stack.pop_back();
        if (!balls.empty()) {
          tighten(cell, balls, hint);
          if (cell.bound <= bound) continue;
        }
        cell.point = cell.centroid();
        const BallGap gap = balls.gap(cell.point);
        cell.value = gap.value;
        if (!balls.empty()) tighten(cell, balls, hint = gap.ball);
        if (cell.bound <= bound) continue;
        // A cell across the rim of an uncovered spot holds both kinds of points: a corner outside settles it.
        // Splitting it until its centroid is outside would follow the rim all along.
        const double size = cell.size();
        if (size <= grain)
          for (const Point& p : cell.corner) {
            const double value = balls.gap(p).value;
            if (value > cell.value) cell.value = value, cell.point = p;
          }
        if (size > smallest && (size > grain || cell.value <= bound)) {
          const auto halves = bisect(cell);
          stack.push_back(halves[1]), stack.push_back(halves[0]);
        } else {
          failed[b].push_back(cell);
        }
      }
    }
  }
  std::vector<Cell> all;
  for (auto& part : failed) all.insert(all.end(), part.begin(), part.end());
  return all;
}

}  // namespace padder
