// SPDX-License-Identifier: MIT
#include "padding/verify/certify.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>

namespace padder {
namespace {

constexpr double kUnbounded = std::numeric_limits<double>::infinity();

// Parts smaller than this share of the largest coordinate are not split further: below it, rounding decides.
constexpr double kSmallestShare = 1e-9;

// A centre that is nearer to the surface than this share of the radius counts as on it: a ball at a sharp
// edge cannot have its centre inside.
constexpr double kOnSurface = 1e-6;

// By so much the two bounds of the largest gap may differ, as a share of it.
constexpr double kGapShare = 1e-3;

double bound_by(const Ball& ball, const GapPart& part) {
  double far2 = 0;
  for (const Point& p : part.corner) far2 = std::max(far2, (p - ball.center).squaredNorm());
  return std::sqrt(far2) - ball.radius;
}

// Lowers part.bound to what this ball proves.
void tighten(GapPart& part, const BallSet& balls, std::uint32_t ball) {
  part.bound = std::min(part.bound, bound_by(balls.balls()[ball], part));
}

GapPart gap_part_of(const Mesh& mesh, std::size_t t) {
  GapPart part;
  part.corner = mesh.corners(t), part.triangle = static_cast<std::uint32_t>(t);
  part.bound = kUnbounded;
  return part;
}

double smallest_size(const Mesh& mesh) {
  const Box box = mesh.bounds();
  return box.empty()
             ? 0
             : kSmallestShare * std::max(box.low.cwiseAbs().maxCoeff(), box.high.cwiseAbs().maxCoeff());
}

// In a hull, a centre within the standoff is still inside.
bool is_outside(const Surface& surface, const Ball& ball, double distance) {
  return distance > kOnSurface * ball.radius &&
         !(surface.hull() && surface.winding_number(ball.center).value_or(0) > 0);
}

}  // namespace

bool has_centre_inside(const Surface& surface, const Ball& ball) {
  return !surface.closed() || !is_outside(surface, ball, surface.certified_distance(ball.center));
}

ProtrusionBound protrusion_bound(const Surface& surface, const std::vector<Ball>& balls) {
  ProtrusionBound bound;
  bound.proved = surface.closed();
  double max = bound.max;
  std::size_t outside = 0;
#pragma omp parallel for schedule(dynamic, 16) if (balls.size() > 64) reduction(+ : outside) reduction(max : max)
  for (std::size_t k = 0; k < balls.size(); k++) {
    const Ball& ball = balls[k];
    const double distance =
        bound.proved ? surface.certified_distance(ball.center) : surface.signed_nearest(ball.center).distance;
    max = std::max(max, ball.radius + distance);
    outside += is_outside(surface, ball, distance);
  }
  bound.max = max, bound.outside = outside;
  return bound;
}

// Goes breadth first, one round of bisection at a time. What a round prunes depends only on the rounds before
// it, so the result does not depend on the number of threads.
GapBound gap_bound(const Mesh& mesh, const BallSet& balls, double floor) {
  const double least = std::min(floor, 0.0);
  GapBound best{.upper = least, .lower = least};
  const std::size_t n = mesh.triangles.size();
  if (n == 0) return best;
  if (balls.empty()) {
    best.lower = best.upper = kUnbounded, best.point = mesh.corner(0, 0);
    return best;
  }
  const double smallest = smallest_size(mesh);
  double pruned = least;  // the largest bound among the parts that were not split further

  // Bounds a part and returns true when it must be split. `hint` is the ball of the part before, which
  // settles most parts without a query.
  const auto examine = [&](GapPart& part, std::uint32_t& hint, double enough) {
    tighten(part, balls, hint);
    part.value = -kUnbounded;
    if (part.bound <= enough) return false;
    part.point = part.centroid();
    const BallGap gap = balls.gap(part.point);
    part.value = gap.value, hint = gap.ball;
    tighten(part, balls, hint);
    return part.bound > enough;
  };
  // Below the floor nothing is added, so that a gap just below a tolerance is proved to keep it.
  const auto settled = [&](double x) { return x <= floor ? floor : x + std::abs(x) * kGapShare; };
  const auto improve = [&](const GapPart& part) {
    if (part.value > best.lower) best.lower = part.value, best.point = part.point;
  };

  std::vector<GapPart> level, next;
  for (bool first = true; first || !level.empty(); first = false) {
    const double enough = settled(best.lower);
    const std::size_t count = first ? n : level.size();
    constexpr std::size_t block = 256;
    const std::size_t blocks = (count + block - 1) / block;
    struct Result {
      std::vector<GapPart> open;
      double pruned = -kUnbounded;
      GapPart top;  // of the largest value
    };
    std::vector<Result> results(blocks);
#pragma omp parallel for schedule(dynamic, 4) if (blocks > 4)
    for (std::size_t b = 0; b < blocks; b++) {
      Result& result = results[b];
      result.top.value = -kUnbounded;
      std::uint32_t hint = 0;
      const auto look = [&](GapPart& part) {
        const bool open = examine(part, hint, enough);
        if (part.value > result.top.value) result.top = part;
        if (open)
          result.open.push_back(part);
        else
          result.pruned = std::max(result.pruned, part.bound);
      };
      for (std::size_t k = b * block; k < std::min(count, (b + 1) * block); k++) {
        if (first) {
          GapPart part = gap_part_of(mesh, k);
          look(part);
        } else {
          for (GapPart& half : bisect(level[k])) look(half);
        }
      }
    }
    next.clear();
    for (const Result& result : results) improve(result.top), pruned = std::max(pruned, result.pruned);
    const double now = settled(best.lower);
    for (const Result& result : results)
      for (const GapPart& part : result.open) {
        if (part.bound > now && part.size() > smallest)
          next.push_back(part);
        else
          pruned = std::max(pruned, part.bound);
      }
    level.swap(next);
  }
  best.upper = std::max(best.lower, pruned);
  return best;
}

namespace {

// What was found last in each cell of a grid: the ball that proved a part there, and the parts that no ball
// proved. Slivers side by side are cut into many parts, and what holds for one holds for those beside it.
class LastProofs {
 public:
  explicit LastProofs(double cell) : cell_(cell), ball_(4096, 0), open_(4096, 0) {}
  std::uint32_t& at(const Point& x) { return ball_[hash(x, cell_, 0) >> 52]; }

  // Was the last part of about this size and place found open? Size and place count to a quarter.
  bool was_open(const Point& x, double size) const {
    const std::uint64_t h = hash_of_part(x, size);
    return open_[h >> 52] == h;
  }
  void set_open(const Point& x, double size) {
    const std::uint64_t h = hash_of_part(x, size);
    open_[h >> 52] = h;
  }

 private:
  static std::uint64_t hash(const Point& x, double cell, std::uint64_t h) {
    for (const double c : x)
      h = (h ^ static_cast<std::uint64_t>(static_cast<std::int64_t>(std::floor(c / cell)))) *
          0x9e3779b97f4a7c15ull;
    return h;
  }
  static std::uint64_t hash_of_part(const Point& x, double size) {
    const double step = std::floor(4 * std::log2(size));
    return hash(x, 0.25 * size_of(step), static_cast<std::uint64_t>(static_cast<std::int64_t>(step)));
  }
  static double size_of(double step) { return std::exp2(0.25 * step); }

  double cell_;
  std::vector<std::uint32_t> ball_;
  std::vector<std::uint64_t> open_;
};

// The balls that can cover any point of a part, for the parts that this one is cut into: asking these few one
// by one is cheaper than asking all.
class NearBalls {
 public:
  NearBalls(const BallSet& balls, double bound) : balls_(balls), bound_(bound) {}

  // Begins with a part, unless too many balls are near.
  bool take(const GapPart& part) {
    near_.clear();
    balls_.find(part.centroid(), (bound_ + part.radius()) * (1 + 1e-12) + 1e-300, near_);
    std::sort(near_.begin(), near_.end());  // of equal gaps that of the lowest index counts
    return near_.size() <= kMost;
  }

  // The same as BallSet::gap(), for a point of the part.
  BallGap gap(const Point& x) const {
    BallGap best;
    for (const auto k : near_) {
      const double value = gap_to(balls_.balls()[k], x);
      if (value < best.value) best = {value, k};
    }
    return best.value <= bound_ ? best : balls_.gap(x);
  }

 private:
  static constexpr std::size_t kMost = 24;
  const BallSet& balls_;
  const double bound_;
  std::vector<std::uint32_t> near_;
};

// Looks for failures in parts that come one after another: what it learns from one helps with the next.
class FailureSearch {
 public:
  FailureSearch(const BallSet& balls, double bound, double grain, double smallest)
      : balls_(balls),
        bound_(bound),
        grain_(grain),
        smallest_(smallest),
        near_(balls, bound),
        last_(4 * grain) {}

  // Adds the failures in one part, until `enough` says that no more are wanted.
  template <class Enough>
  void look(const GapPart& whole, std::vector<GapPart>& failed, const Enough& enough) {
    stack_.assign(1, whole);
    above_ = kNobody;
    while (!stack_.empty() && !enough()) {
      GapPart part = stack_.back();
      stack_.pop_back();
      if (stack_.size() < above_) above_ = kNobody;
      if (proved(part)) continue;
      // A part across the border of an uncovered spot has points of both kinds, and its centroid may be
      // covered. Then a corner that is not covered is enough. Splitting until a centroid fails would follow
      // the border all along.
      const double size = part.size();
      if (size > smallest_ && (size > grain_ || part.value <= bound_)) {
        const auto halves = bisect(part);
        stack_.push_back(halves[1]), stack_.push_back(halves[0]);
      } else {
        failed.push_back(part);
      }
    }
  }

 private:
  bool proved(GapPart& part) {
    if (!balls_.empty()) {
      tighten(part, balls_, hint_);
      if (part.bound <= bound_) return true;
    }
    part.point = part.centroid();
    std::uint32_t& proof = last_.at(part.point);
    if (!balls_.empty() && proof != hint_) {
      tighten(part, balls_, hint_ = proof);
      if (part.bound <= bound_) return true;
    }
    const double size = part.size();
    // A part like one that stayed open is cut unasked: what a ball proves, it proves of both halves.
    if (size > grain_ && last_.was_open(part.point, size)) return false;
    const BallGap gap = above_ == kNobody ? balls_.gap(part.point) : near_.gap(part.point);
    part.value = gap.value;
    if (!balls_.empty()) tighten(part, balls_, hint_ = gap.ball);
    if (part.bound <= bound_) {
      proof = hint_;
      return true;
    }
    if (above_ == kNobody && !balls_.empty() && size <= small_enough_ &&
        size <= 2 * (balls_.balls()[gap.ball].radius + bound_)) {
      if (near_.take(part))
        above_ = stack_.size();
      else
        small_enough_ = 0.25 * size;
    }
    if (size > grain_) {
      last_.set_open(part.point, size);
      return false;
    }
    for (const Point& p : part.corner) {
      const double value = balls_.gap(p).value;
      if (value > part.value) part.value = value, part.point = p;
    }
    return false;
  }

  static constexpr std::size_t kNobody = std::numeric_limits<std::size_t>::max();
  const BallSet& balls_;
  const double bound_, grain_, smallest_;
  std::vector<GapPart> stack_;
  std::uint32_t hint_ = 0;
  NearBalls near_;
  std::size_t above_ = kNobody;  // what stands at this place of the stack or higher is cut from near's part
  LastProofs last_;
  double small_enough_ = kUnbounded;  // larger parts have too many balls near
};

}  // namespace

std::vector<GapPart> whole_triangles(const Mesh& mesh) {
  std::vector<GapPart> parts(mesh.triangles.size());
  for (std::size_t t = 0; t < parts.size(); t++) parts[t] = gap_part_of(mesh, t);
  return parts;
}

std::optional<std::vector<GapPart>> gap_failures(const std::vector<GapPart>& parts, const BallSet& balls,
                                                 double bound, double grain, std::size_t most) {
  const std::size_t n = parts.size();
  double largest = 0;
  for (const GapPart& part : parts)
    for (const Point& p : part.corner) largest = std::max(largest, p.cwiseAbs().maxCoeff());
  constexpr std::size_t block = 256;
  const std::size_t blocks = (n + block - 1) / block;
  std::vector<std::vector<GapPart>> failed(blocks);
  std::atomic<std::size_t> found = 0;  // of all finished parts
#pragma omp parallel for schedule(dynamic, 4) if (blocks > 4)
  for (std::size_t b = 0; b < blocks; b++) {
    FailureSearch search(balls, bound, grain, kSmallestShare * largest);
    for (std::size_t k = b * block; k < std::min(n, (b + 1) * block); k++) {
      const std::size_t before = failed[b].size();
      search.look(parts[k], failed[b], [&] { return found + (failed[b].size() - before) > most; });
      found += failed[b].size() - before;
    }
  }
  if (found > most) return std::nullopt;
  std::vector<GapPart> all;
  all.reserve(found);
  for (auto& part : failed) all.insert(all.end(), part.begin(), part.end());
  return all;
}

std::vector<GapPart> gap_failures(const Mesh& mesh, const BallSet& balls, double bound, double grain) {
  return *gap_failures(whole_triangles(mesh), balls, bound, grain, std::numeric_limits<std::size_t>::max());
}

}  // namespace padder
