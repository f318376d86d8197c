// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/search/samples.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "padding/asset/error.h"
#include "padding/geometry/medial.h"
#include "padding/geometry/point_tree.h"
#include "padding/geometry/random.h"
#include "padding/geometry/triangle.h"

namespace padder {
namespace {

constexpr std::size_t kMostParts = 20'000'000;  // about 2 GB
// A mesh with more parts is a fine scan: of those smaller than the spacing, the first in a cell is enough.
constexpr std::size_t kPartsOfScan = 1'000'000;
// A mesh with more parts has stacks of sheets: the first in a cell of a part's own size is enough.
constexpr std::size_t kPartsOfStack = 4'000'000;
// How densely the places with balls stand, as SampleOptions counts it.
constexpr double kGrownDensity = 3;

std::string too_small() {
  return "the tolerance is too small for this mesh: its surface would have to be cut into more than " +
         std::to_string(kMostParts / 1000000) + " million parts: use a larger tolerance";
}

// What samples stand apart is compared with the longest edge of a part. The parts of a triangle that is
// bisected are on the whole about a third smaller than that.
struct SamplePart : TrianglePart {
  double disc = 0;    // radius of the disc that the ball grown nearby covers
  double radius = 0;  // of a medial ball nearby, or of a smaller one; 0: not known
  double apart = 1;   // so many times as far apart do cover points stand; above 1 in a crowd
};

// Finds the parts whose centroids lie near that of a given part and whose normals are similar. Comparing the
// normals keeps samples on both sides of a thin wall.
class Neighbours {
 public:
  Neighbours(const Mesh& mesh, const std::vector<SamplePart>& parts)
      : normals_(parts.size()), areas_(parts.size()) {
    std::vector<Point> points(parts.size());
#pragma omp parallel for schedule(static) if (parts.size() > 4096)
    for (std::size_t k = 0; k < parts.size(); k++) {
      const auto& c = parts[k].corner;
      points[k] = parts[k].centroid();
      normals_[k] = mesh.area_normal(parts[k].triangle).normalized();
      areas_[k] = 0.5 * (c[1] - c[0]).cross(c[2] - c[0]).norm();
    }
    tree_ = PointTree(std::move(points));
  }
  const Point& point(std::uint32_t k) const { return tree_.points()[k]; }

  template <class Visit>
  void visit(std::uint32_t k, double radius, bool all_normals, Visit&& visit) const {
    for (auto other : find(k, radius))
      if (all_normals || normals_[k].dot(normals_[other]) > 0.7) visit(other);
  }

  // Is there so much surface within the radius that a ball nearby covers many walls?
  bool crowd(std::uint32_t k, double radius) const {
    double area = 0;
    for (auto other : find(k, radius)) area += areas_[other];
    return area > kWallsOfCrowd * std::numbers::pi * radius * radius;
  }

 private:
  static constexpr double kWallsOfCrowd = 7;  // thin walls that meet in a corner have 6

  const std::vector<std::uint32_t>& find(std::uint32_t k, double radius) const {
    thread_local std::vector<std::uint32_t> found;
    found.clear();
    tree_.find(point(k), radius, found);
    return found;
  }

  PointTree tree_;
  std::vector<Vector> normals_;
  std::vector<double> areas_;
};

void split_into(const SamplePart& part, std::vector<SamplePart>& parts) {
  for (const SamplePart& half : bisect(part)) parts.push_back(half);
}

// Cuts slivers, which are thinner than the spacing of the samples, across their length. A mesh may have
// thousands of them side by side, each as long as the part. So only the first piece in a cell is kept.
class SliverParts {
 public:
  explicit SliverParts(double cell) : cell_(cell) {}

  void add(const SamplePart& sliver, const Vector& normal, std::vector<SamplePart>& parts) {
    const auto [length2, from] = sliver.longest_edge();
    const Point &a = sliver.corner[from], &b = sliver.corner[(from + 1) % 3],
                &c = sliver.corner[(from + 2) % 3];
    const double top = (c - a).dot(b - a) / length2;  // where on the longest edge the third corner stands
    const auto pieces = static_cast<std::int64_t>(std::ceil(std::sqrt(length2) / cell_));
    steps_ += static_cast<double>(pieces);
    if (steps_ > kMostSteps) throw Error(too_small());
    const auto across = [&](double at) {  // on the two shorter edges
      return at < top ? Point(a + at / top * (c - a))
                      : Point(b + (1 - at) / std::max(1 - top, 1e-12) * (c - b));
    };
    for (std::int64_t k = 0; k < pieces; k++) {
      const double begin = static_cast<double>(k) / static_cast<double>(pieces);
      const double end = static_cast<double>(k + 1) / static_cast<double>(pieces);
      SamplePart piece = sliver;
      piece.corner = {Point(a + begin * (b - a)), Point(a + end * (b - a)), across(0.5 * (begin + end))};
      if (first_.take(piece.centroid(), normal, cell_)) parts.push_back(piece);
    }
  }

 private:
  static constexpr double kMostSteps = 1e8;  // some 10 s

  const double cell_;
  double steps_ = 0;
  FirstOfCell first_;
};

class Sampler {
 public:
  Sampler(const Surface& surface, const SampleOptions& options)
      : surface_(surface),
        options_(options),
        largest_(std::min(options.largest, surface.bounds().diagonal())) {}

  Samples run() {
    Samples samples;
    std::vector<SamplePart> parts = cut();
    grow(parts, samples.grown);
    cut_finer(parts);
    const Neighbours near(surface_.mesh(), parts);
#pragma omp parallel sections
    {
#pragma omp section
      samples.coarse = choose_points(parts, near, options_.coarse_density);
#pragma omp section
      samples.fine = choose_points(parts, near, options_.fine_density);
    }
    return samples;
  }

 private:
  double part_size(double disc, double density) const { return 1.43 * disc / density; }
  // The medial ball of a part, or one of the radius `largest` that fits in.
  Ball ball_at(const SamplePart& part, double largest) const {
    const double guess = part.radius > 0 ? 1.2 * part.radius + options_.tolerance_sum : 0;
    return inner_medial_ball(surface_, part.centroid(),
                             surface_.mesh().area_normal(part.triangle).normalized(),
                             std::min(largest, largest_), kMedialTolerance * options_.tolerance_sum, guess);
  }

  static void check(double parts) {
    if (parts > static_cast<double>(kMostParts)) throw Error(too_small());
  }

  // Bisects the triangles until the size of each part is about the spacing of the balls there.
  std::vector<SamplePart> cut() const {
    const Mesh& mesh = surface_.mesh();
    const double sum = options_.tolerance_sum;
    const auto wanted = [&](double r) { return part_size(covered_disc(r, sum), kGrownDensity); };
    const auto radius_for = [&](double size) {  // wanted(radius_for(size)) == size
      const double disc = size / part_size(1, kGrownDensity);
      return 0.5 * (disc * disc / sum - sum);
    };
    const double finest = wanted(0), coarsest = wanted(largest_);
    check(mesh.area() / (coarsest * coarsest));
    const double smallest_cell = part_size(options_.tolerance_sum, options_.fine_density);
    std::vector<SamplePart> level, done, next;
    SliverParts slivers(0.5 * finest);
    for (std::size_t t = 0; t < mesh.triangles.size(); t++) {
      const Vector normal = mesh.area_normal(t);  // as long as twice the area
      if (!(normal.squaredNorm() > 0)) continue;
      const SamplePart part{{mesh.corners(t), static_cast<std::uint32_t>(t)}};
      const double size = part.size();
      if (size > finest && normal.norm() < 0.25 * finest * size)
        slivers.add(part, normal, done);
      else
        level.push_back(part);
    }
    check(static_cast<double>(done.size()));
    thin(level, smallest_cell);
    std::vector<char> split;
    for (; !level.empty(); level.swap(next)) {
      split.assign(level.size(), 0);
#pragma omp parallel for schedule(dynamic, 64) if (level.size() > 256)
      for (std::size_t k = 0; k < level.size(); k++) {
        SamplePart& part = level[k];
        const double size = part.size();
        if (size <= finest) continue;
        // The radius is that of the larger part that this one was cut from. Where it says that this one is
        // too large, too, or near the finest size, splitting costs less than finding the ball.
        const bool known = part.radius > 0 && size > wanted(part.radius);
        // A ball for which the part is small enough says all. The largest one costs more, most of all in a
        // fine sphere, where every triangle is as near to its centre as any other.
        if (!known && size >= 2.5 * finest && size <= coarsest)
          part.radius = ball_at(part, radius_for(size) + sum).radius;
        split[k] = size > wanted(part.radius);
      }
      next.clear();
      for (std::size_t k = 0; k < level.size(); k++) {
        if (split[k])
          split_into(level[k], next);
        else
          done.push_back(level[k]);
      }
      thin(next, smallest_cell);
      check(static_cast<double>(next.size() + done.size()));
    }
    return done;
  }

  void thin(std::vector<SamplePart>& parts, double smallest_cell) const {
    if (parts.size() <= kPartsOfScan) return;
    const bool stack = parts.size() > kPartsOfStack;
    FirstOfCell first;
    std::erase_if(parts, [&](const SamplePart& part) {
      const double size = part.size();
      if (size > smallest_cell && !stack) return false;
      const double cell = size > smallest_cell ? std::exp2(std::floor(std::log2(size))) : smallest_cell;
      return !first.take(part.centroid(), surface_.mesh().area_normal(part.triangle), cell);
    });
  }

  // Takes parts in a random order and grows a ball on each. The parts nearby are then dropped from the order,
  // and remember the disc that this ball covers.
  void grow(std::vector<SamplePart>& parts, std::vector<Sample>& grown) const {
    const Neighbours near(surface_.mesh(), parts);
    const std::vector<std::uint32_t> order = random_order(parts.size(), 1);
    std::vector<std::uint32_t> batch;
    std::vector<Grown> found;
    std::vector<char> gone(parts.size());
    for (std::size_t at = 0; at < order.size();) {
      const std::size_t size = std::max<std::size_t>(8, grown.size() / 4);
      batch.clear();
      for (; at < order.size() && batch.size() < size; at++)
        if (!gone[order[at]]) batch.push_back(order[at]);
      found.resize(batch.size());
#pragma omp parallel for schedule(dynamic, 4) if (batch.size() > 32)
      for (std::size_t k = 0; k < batch.size(); k++) found[k] = grow_on(parts[batch[k]], near, batch[k]);
      for (std::size_t k = 0; k < batch.size(); k++) {
        if (gone[batch[k]]) continue;
        const double disc = found[k].disc, apart = found[k].apart;
        grown.push_back({near.point(batch[k]), parts[batch[k]].triangle, found[k].ball});
        near.visit(batch[k], 0.5 * (1 + apart) * disc / kGrownDensity, apart > 1, [&](auto other) {
          if (!gone[other]) gone[other] = 1, parts[other].disc = disc, parts[other].apart = apart;
        });
      }
    }
  }

  struct Grown {
    Ball ball;
    double disc, apart;  // as in SamplePart
  };

  // In a crowd samples stand farther apart, and normals do not count: so there is a number of samples for
  // each ball, and not for each wall that it covers. A ball in a wall that is thinner than the tolerance
  // covers its neighbours, too, wherever they lie within its disc.
  Grown grow_on(const SamplePart& part, const Neighbours& near, std::uint32_t place) const {
    const Ball ball = ball_at(part, largest_);
    const double disc = covered_disc(ball.radius, options_.tolerance_sum);
    const bool dense = near.crowd(place, disc / kGrownDensity);
    const bool crowd = dense || (disc < 2 * options_.tolerance_sum && near.crowd(place, disc));
    return {ball, disc, dense ? 2.0 : crowd ? 1.5 : 1.0};
  }

  void cut_finer(std::vector<SamplePart>& parts) const {
    std::vector<SamplePart> stack, done;
    for (const SamplePart& part : parts) {
      // Where points stand farther apart, more parts would only be looked through. Points among parts of half
      // the size gave no smaller covers.
      const double size = part.apart * 2 * part.disc / options_.fine_density;
      stack.push_back(part);
      while (!stack.empty()) {
        const SamplePart top = stack.back();
        stack.pop_back();
        if (top.longest_edge().first > size * size)
          split_into(top, stack);
        else
          done.push_back(top);
      }
      check(static_cast<double>(done.size()));
    }
    parts.swap(done);
  }

  static std::vector<CoverPoint> choose_points(const std::vector<SamplePart>& parts, const Neighbours& near,
                                               double density) {
    // In a crowd a ball reaches surface all around it and not on one flat, so more slips out between points.
    constexpr double crowd_margin = 2;
    std::vector<CoverPoint> points;
    std::vector<char> gone(parts.size());
    for (auto k : random_order(parts.size(), 2)) {
      if (gone[k]) continue;
      const double radius = parts[k].apart * parts[k].disc / density;
      const bool crowd = parts[k].apart > 1;
      points.push_back({near.point(k), crowd ? crowd_margin * radius : radius});
      near.visit(k, radius, crowd, [&](auto other) { gone[other] = 1; });
    }
    return points;
  }

  const Surface& surface_;
  const SampleOptions& options_;
  const double largest_;
};

}  // namespace

std::size_t FirstOfCell::Hash::operator()(const std::array<std::int64_t, 4>& key) const {
  std::uint64_t h = 0;
  for (auto k : key) h = Random(h ^ static_cast<std::uint64_t>(k)).next();
  return h;
}

bool FirstOfCell::take(const Point& place, const Vector& normal, double cell) {
  int axis, exponent;
  normal.cwiseAbs().maxCoeff(&axis);
  std::frexp(cell, &exponent);  // cells of several sizes are told apart
  const Point at = place / cell;
  return taken_
      .insert({std::llround(at.x()), std::llround(at.y()), std::llround(at.z()),
               8 * std::int64_t(exponent) + 2 * axis + (normal[axis] < 0)})
      .second;
}

double covered_disc(double r, double tolerance_sum) {
  return std::sqrt((2 * r + tolerance_sum) * tolerance_sum);
}

Samples sample_surface(const Surface& surface, const SampleOptions& options) {
  return Sampler(surface, options).run();
}

}  // namespace padder
