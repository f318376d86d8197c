// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/samples.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "padding/asset/error.h"
#include "padding/geometry/medial.h"
#include "padding/geometry/point_tree.h"
#include "padding/geometry/random.h"

namespace padder {
namespace {

constexpr double medial_tolerance =
    0.05;  // share of the reach; what a ball misses its point by costs that much cover

constexpr std::size_t most_pieces = 20'000'000;  // about 2 GB

// A piece of a triangle. What samples stand apart is compared with its longest edge; pieces of a bisected
// triangle are about a third smaller than that on the whole.
struct Piece {
  std::array<Point, 3> corner;
  std::uint32_t triangle;
  double disc = 0;  // covered by the ball grown nearby

  Point centroid() const { return (corner[0] + corner[1] + corner[2]) / 3; }
};

// The longest edge: squared length, and the corner it starts from.
std::pair<double, int> longest_edge(const Piece& piece) {
  std::pair<double, int> longest{-1, 0};
  for (int k = 0; k < 3; k++) {
    const double l2 = (piece.corner[(k + 1) % 3] - piece.corner[k]).squaredNorm();
    if (l2 > longest.first) longest = {l2, k};
  }
  return longest;
}

void bisect(const Piece& piece, std::vector<Piece>& halves) {
  const int from = longest_edge(piece).second, to = (from + 1) % 3;
  const Point middle = 0.5 * (piece.corner[from] + piece.corner[to]);
  halves.push_back(piece), halves.back().corner[to] = middle;
  halves.push_back(piece), halves.back().corner[from] = middle;
}

// The pieces' centroids with their normals: finds those around one of them that face the same way, so that a
// thin wall keeps the samples of both its sides.
class Neighbours {
 public:
  Neighbours(const Mesh& mesh, const std::vector<Piece>& pieces) : normals_(pieces.size()) {
    std::vector<Point> points(pieces.size());
    for (std::size_t k = 0; k < pieces.size(); k++) {
      points[k] = pieces[k].centroid();
      normals_[k] = mesh.area_normal(pieces[k].triangle).normalized();
    }
    tree_ = PointTree(std::move(points));
  }
  const Point& point(std::uint32_t k) const { return tree_.points()[k]; }
  template <class Visit>
  void visit(std::uint32_t k, double radius, Visit&& visit) const {
    thread_local std::vector<std::uint32_t> found;
    found.clear();
    tree_.find(point(k), radius, found);
    for (auto other : found)
      if (normals_[k].dot(normals_[other]) > 0.7) visit(other);
  }

 private:
  PointTree tree_;
  std::vector<Vector> normals_;
};

class Sampler {
 public:
  Sampler(const Surface& surface, const SampleOptions& options)
      : surface_(surface),
        options_(options),
        largest_(std::min(options.largest, surface.bounds().diagonal())) {}

  Samples run() {
    Samples samples;
    std::vector<Piece> pieces = cut();
    grow(pieces, samples.grown);
    cut_rows(pieces);
    const Neighbours near(surface_.mesh(), pieces);
    samples.coarse = take_rows(pieces, near, options_.coarse_density);
    samples.fine = take_rows(pieces, near, options_.fine_density);
    return samples;
  }

 private:
  double piece_size(double disc, double density) const { return 1.43 * disc / density; }
  Ball ball_at(const Point& p, std::uint32_t triangle) const {
    return inner_medial_ball(surface_, p, surface_.mesh().area_normal(triangle).normalized(), largest_,
                             medial_tolerance * options_.reach);
  }

  static void check(double pieces) {
    if (pieces > static_cast<double>(most_pieces))
      throw Error("the tolerance is too small for this mesh: its surface would have to be cut in more than " +
                  std::to_string(most_pieces / 1000000) + " million pieces; ask for a larger one");
  }

  // Bisects until each piece is about as small as the balls around it will be dense.
  std::vector<Piece> cut() const {
    const Mesh& mesh = surface_.mesh();
    const auto wanted = [&](double r) {
      return piece_size(covered_disc(r, options_.reach), options_.grown_density);
    };
    const double finest = wanted(0), coarsest = wanted(largest_);
    check(mesh.area() / (coarsest * coarsest));
    std::vector<Piece> level, done, next;
    for (std::size_t t = 0; t < mesh.triangles.size(); t++)
      if (mesh.area_normal(t).squaredNorm() > 0)
        level.push_back(
            {{mesh.corner(t, 0), mesh.corner(t, 1), mesh.corner(t, 2)}, static_cast<std::uint32_t>(t)});
    std::vector<char> split;
    for (; !level.empty(); level.swap(next)) {
      split.assign(level.size(), 0);
#pragma omp parallel for schedule(dynamic, 64) if (level.size() > 256)
      for (std::size_t k = 0; k < level.size(); k++) {
        const double size = std::sqrt(longest_edge(level[k]).first);
        if (size <= finest) continue;
        // Near the finest size a split is cheaper than to ask.
        split[k] = size < 2.5 * finest || size > coarsest ||
                   size > wanted(ball_at(level[k].centroid(), level[k].triangle).radius);
      }
      next.clear();
      for (std::size_t k = 0; k < level.size(); k++) {
        if (split[k])
          bisect(level[k], next);
        else
          done.push_back(level[k]);
      }
      check(static_cast<double>(next.size() + done.size()));
    }
    return done;
  }

  // Takes pieces in a random order, each with its ball; those near a taken one go and learn its disc.
  void grow(std::vector<Piece>& pieces, std::vector<Sample>& grown) const {
    const Neighbours near(surface_.mesh(), pieces);
    const std::vector<std::uint32_t> order = random_order(pieces.size(), 1);
    std::vector<std::uint32_t> batch;
    std::vector<Ball> balls;
    std::vector<char> gone(pieces.size());
    for (std::size_t at = 0; at < order.size();) {
      const std::size_t size = std::max<std::size_t>(8, grown.size() / 4);
      batch.clear();
      for (; at < order.size() && batch.size() < size; at++)
        if (!gone[order[at]]) batch.push_back(order[at]);
      balls.resize(batch.size());
#pragma omp parallel for schedule(dynamic, 4) if (batch.size() > 32)
      for (std::size_t k = 0; k < batch.size(); k++)
        balls[k] = ball_at(near.point(batch[k]), pieces[batch[k]].triangle);
      for (std::size_t k = 0; k < batch.size(); k++) {
        if (gone[batch[k]]) continue;
        grown.push_back({near.point(batch[k]), pieces[batch[k]].triangle, balls[k]});
        const double disc = covered_disc(balls[k].radius, options_.reach);
        near.visit(batch[k], disc / options_.grown_density, [&](auto other) {
          if (!gone[other]) gone[other] = 1, pieces[other].disc = disc;
        });
      }
    }
  }

  void cut_rows(std::vector<Piece>& pieces) const {
    std::vector<Piece> stack, done;
    for (const Piece& piece : pieces) {
      const double size = piece_size(piece.disc, options_.fine_density);
      stack.push_back(piece);
      while (!stack.empty()) {
        const Piece top = stack.back();
        stack.pop_back();
        if (longest_edge(top).first > size * size)
          bisect(top, stack);
        else
          done.push_back(top);
      }
      check(static_cast<double>(done.size()));
    }
    pieces.swap(done);
  }

  static std::vector<Row> take_rows(const std::vector<Piece>& pieces, const Neighbours& near,
                                    double density) {
    std::vector<Row> rows;
    std::vector<char> gone(pieces.size());
    for (auto k : random_order(pieces.size(), 2)) {
      if (gone[k]) continue;
      const double radius = pieces[k].disc / density;
      rows.push_back({near.point(k), radius});
      near.visit(k, radius, [&](auto other) { gone[other] = 1; });
    }
    return rows;
  }

  const Surface& surface_;
  const SampleOptions& options_;
  const double largest_;
};

}  // namespace

double covered_disc(double r, double reach) { return std::sqrt((2 * r + reach) * reach); }

Samples sample_surface(const Surface& surface, const SampleOptions& options) {
  return Sampler(surface, options).run();
}

}  // namespace padder
