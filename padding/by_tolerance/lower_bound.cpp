// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/lower_bound.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "padding/asset/error.h"
#include "padding/by_tolerance/cube.h"
#include "padding/by_tolerance/search/samples.h"
#include "padding/by_tolerance/search/set_cover.h"
#include "padding/geometry/point_tree.h"

namespace padder {
namespace {

constexpr double kRounding = 1e-9;          // share of a length or a sum that covers rounding many times
constexpr std::size_t kMostPoints = 30000;  // with weights
constexpr int kFirstSteps = 1200, kLaterSteps = 400;  // of the linear programme
constexpr double kMostAdditions = 5e8;                // of a round, over all steps
constexpr int kMostRounds = 12;                       // of weights and boxes in turn
constexpr double kNearEnough = 1.02;                  // the last round: no ball gathers more than this
constexpr std::size_t kBatch = 256;                   // boxes that are split together
// Boxes have the size of the neighbourhoods in which balls cover about the same, which the tolerance sum
// tells. Half edges in shares of it: of boxes that are not split further, and of the largest that become
// sets.
constexpr double kSmallestBox = 0.03, kLargestRow = 0.13;
constexpr double kRowDistance = 0.15;  // of the boxes that become sets, in shares of the tolerance sum

// The sum of `values` over each set.
std::vector<double> sums(const Sets& sets, const std::vector<double>& values) {
  std::vector<double> out(sets.size());
  // Threads that wait for each other cost more than they save while all of it stays in the cache.
#pragma omp parallel for schedule(static) if (sets.elements.size() > 2'000'000)
  for (std::size_t k = 0; k < sets.size(); k++) {
    double sum = 0;
    for (auto r : sets[k]) sum += values[r];
    out[k] = sum;
  }
  return out;
}

// Weights of the elements, as large as possible on the whole, of which no set contains more than 1: a
// packing, the dual of the fractional set cover. Found by the primal-dual hybrid gradient method with
// diagonal steps (Pock and Chambolle, Diagonal preconditioning for first order primal-dual algorithms in
// convex optimization, 2011).
class Packing {
 public:
  std::vector<double> weights, choice;  // of the elements, and of the sets; a later call begins with them

  void improve(const Sets& sets, std::size_t elements, int steps) {
    const Sets of_element = transposed(sets, elements);
    weights.resize(elements), choice.resize(sets.size());
    std::vector<double> ahead = choice, mean(elements), best = weights;
    double best_value = value(sets, weights);
    double count = 0;
    for (int step = 1; step <= steps; step++) {
      const std::vector<double> covered = sums(of_element, ahead);
      for (std::size_t k = 0; k < elements; k++) {
        const double size = static_cast<double>(of_element[k].size());
        if (size > 0) weights[k] = std::max(0.0, weights[k] + (1 - covered[k]) / size);
      }
      const std::vector<double> gathered = sums(sets, weights);
      for (std::size_t k = 0; k < sets.size(); k++) {
        const double size = static_cast<double>(sets[k].size());
        if (!(size > 0)) continue;
        const double next = std::max(0.0, choice[k] + (gathered[k] - 1) / size);
        ahead[k] = 2 * next - choice[k], choice[k] = next;
      }
      count += 1;
      for (std::size_t k = 0; k < elements; k++) mean[k] += (weights[k] - mean[k]) / count;
      if (step % 25 != 0) continue;
      for (const std::vector<double>* w : {&weights, &mean})
        if (const double v = value(sets, *w); v > best_value) best_value = v, best = *w;
      if (step % 400 == 0) count = 0;
    }
    weights = best;
  }

 private:
  static double value(const Sets& sets, const std::vector<double>& weights) {
    const std::vector<double> gathered = sums(sets, weights);
    const double most = gathered.empty() ? 0 : *std::max_element(gathered.begin(), gathered.end());
    return most > 0 ? std::accumulate(weights.begin(), weights.end(), 0.0) / most : 0;
  }
};

// A box of places for a centre.
struct CenterBox : Cube {
  static constexpr std::size_t kMostWitnesses = 12;

  double reach = 0;                                // of a ball at the centre
  double most = 0;                                 // no ball with its centre in the box gathers more
  std::array<Point, kMostWitnesses> witness = {};  // points of the surface
  std::size_t witnesses = 0;

  void add(const Point& q, double apart) {
    for (std::size_t k = 0; k < witnesses; k++)
      if ((witness[k] - q).squaredNorm() <= apart * apart) return;
    if (witnesses < kMostWitnesses) witness[witnesses++] = q;
  }
};

class LowerBound {
 public:
  LowerBound(const Surface& surface, const LowerBoundOptions& options)
      : surface_(surface),
        options_(options),
        tolerance_sum_(options.protrusion + options.gap),
        farthest_(tolerance_sum_ + surface.half_thickness()) {}

  std::uint64_t run() {
    if (!(tolerance_sum_ > 0)) throw Error("a lower bound needs a tolerance above 0");
    if (surface_.mesh().triangles.empty()) return 0;
    if (!surface_.closed()) return 1;
    sample();
    const std::size_t begun = rows_.size();
    double best = 0;
    for (int round = 1; round <= kMostRounds; round++) {
      // Where a few balls do, each set has many points: then few steps are enough.
      const int affordable =
          std::max(50, static_cast<int>(kMostAdditions / static_cast<double>(rows_.elements.size() + 1)));
      packing_.improve(rows_, tree_.size(), std::min(affordable, round == 1 ? kFirstSteps : kLaterSteps));
      const double most = prove(std::max<std::size_t>(10000, options_.boxes * begun));
      const double sum = std::accumulate(packing_.weights.begin(), packing_.weights.end(), 0.0);
      if (!(most > 0)) break;
      best = std::max(best, sum / most * (1 - kRounding));
      if (most < kNearEnough) break;
      add_rows(begun);
    }
    return static_cast<std::uint64_t>(std::max(1.0, std::ceil(best)));
  }

 private:
  void sample() {
    SampleOptions sampling;
    sampling.tolerance_sum = tolerance_sum_, sampling.largest = options_.max_radius;
    const Samples samples = sample_surface(surface_, sampling);
    std::vector<Point> points;
    for (const CoverPoint& p : samples.coarse)
      if (points.size() < kMostPoints) points.push_back(p.point);
    tree_ = PointTree(std::move(points));
    std::vector<std::uint32_t> found;
    for (const Sample& s : samples.grown) {
      if (rows_.size() == kMostPoints) break;
      found.clear();
      tree_.find(s.ball.center, std::min(s.ball.radius + tolerance_sum_, options_.max_radius + options_.gap),
                 found);
      rows_.add(found);
    }
  }

  // Finds how far a ball with its centre in the middle covers the surface. Returns the nearest point.
  Point look(CenterBox& box) const {
    box.reach = std::min(tolerance_sum_ - surface_.certified_distance(box.center),
                         options_.max_radius + options_.gap);
    return surface_.nearest(box.center).point;
  }

  // May a ball with its centre c in the box cover x? Its reach is at most the tolerance sum, the distance
  // of c to any point q of the surface, and half of the thickness that a sheet has: in a sheet of thickness 0
  // and in a solid, c is no deeper than q is far. So f(c) = |x - c| - |q - c| must be at most that sum. Over
  // the box, f falls by no more than its gradient in the middle says, but for a second-order term: a unit
  // vector towards a point at a distance of at least a - t turns by at most 2 t / (2 a - t) when its foot is
  // moved by t.
  bool may_cover(const CenterBox& box, const Point& x) const {
    const double radius = box.radius(), limit = farthest_ * (1 + kRounding);
    const Vector to_x = x - box.center;
    const double a = to_x.norm();
    for (std::size_t k = 0; k < box.witnesses; k++) {
      const Vector to_q = box.witness[k] - box.center;
      const double b = to_q.norm();
      if (!(a > radius && b > radius)) continue;
      const Vector gradient = to_q / b - to_x / a;
      const double bend = radius * radius * (1 / (2 * a - radius) + 1 / (2 * b - radius));
      if (a - b - box.half * gradient.cwiseAbs().sum() - bend > limit) return false;
    }
    return true;
  }

  // The points that a ball with its centre somewhere in the box may cover. The reach of such a ball differs
  // from that in the middle by no more than its centre does.
  void find(const CenterBox& box, std::vector<std::uint32_t>& found) const {
    const double radius = box.radius();
    const double reach = (box.reach + radius) * (1 + kRounding) + kRounding * tolerance_sum_;
    found.clear();
    if (!(reach >= 0)) return;
    tree_.find(box.center, reach + radius, found);
    std::erase_if(found, [&](auto k) {
      const Point& x = tree_.points()[k];
      const Vector out = (x - box.center).cwiseAbs() - Vector::Constant(box.half);
      if (out.cwiseMax(0.0).squaredNorm() > reach * reach) return true;
      return (x - box.center).norm() > box.reach && !may_cover(box, x);
    });
  }

  void measure(CenterBox& box, std::vector<std::uint32_t>& found) const {
    find(box, found);
    box.most = 0;
    for (auto k : found) box.most += packing_.weights[k];
  }

  // Proves that no ball gathers more than the value returned. The boxes with the largest sums are split
  // first; those that are left when all may be looked at stay in boxes_.
  double prove(std::size_t most_boxes) {
    Box around = surface_.bounds();
    for (const Point& p : surface_.boundary().points) around.add(p);
    const auto smaller = [](const CenterBox& a, const CenterBox& b) { return a.most < b.most; };
    // In a hull, the reach is not bounded by the distance to points of the surface.
    const bool witnessed = !surface_.hull();
    boxes_.clear();
    CenterBox& root = boxes_.emplace_back();
    root.center = around.center(), root.half = 0.5 * (around.high - around.low).maxCoeff() + farthest_;
    root.most = std::accumulate(packing_.weights.begin(), packing_.weights.end(), 0.0);
    settled_.clear();
    for (std::size_t looked = 1; looked < most_boxes && !boxes_.empty();) {
      std::vector<CenterBox> parts;
      for (std::size_t k = 0; k < kBatch && !boxes_.empty();) {
        std::pop_heap(boxes_.begin(), boxes_.end(), smaller);
        if (boxes_.back().half > kSmallestBox * tolerance_sum_)
          cut(boxes_.back(), parts), k++;
        else
          settled_.push_back(boxes_.back());
        boxes_.pop_back();
      }
      std::vector<Point> nearest(parts.size());
#pragma omp parallel
      {
        std::vector<std::uint32_t> found;
#pragma omp for schedule(dynamic, 16)
        for (std::size_t k = 0; k < parts.size(); k++) nearest[k] = look(parts[k]);
#pragma omp for schedule(dynamic, 16)
        for (std::size_t k = 0; k < parts.size(); k++) {
          // Its own witness, then those of the box it was cut from, which it has already, and of its
          // neighbours.
          const CenterBox old = parts[k];
          parts[k].witnesses = 0;
          if (!witnessed) {
            measure(parts[k], found);
            continue;
          }
          parts[k].add(nearest[k], 0);
          const double apart = 0.1 * tolerance_sum_;
          for (std::size_t j = k / 8 * 8; j < k / 8 * 8 + 8; j++) parts[k].add(nearest[j], apart);
          for (std::size_t j = 0; j < old.witnesses; j++) parts[k].add(old.witness[j], apart);
          measure(parts[k], found);
        }
      }
      looked += parts.size();
      for (const CenterBox& part : parts)
        if (part.most > 0) boxes_.push_back(part), std::push_heap(boxes_.begin(), boxes_.end(), smaller);
    }
    boxes_.insert(boxes_.end(), settled_.begin(), settled_.end());
    std::sort(boxes_.begin(), boxes_.end(),
              [&](const CenterBox& a, const CenterBox& b) { return smaller(b, a); });
    return boxes_.empty() ? 0 : boxes_[0].most;
  }

  static void cut(const CenterBox& box, std::vector<CenterBox>& parts) {
    for (int corner = 0; corner < 8; corner++) {
      CenterBox& part = parts.emplace_back(box);
      static_cast<Cube&>(part) = box.eighth(corner);
    }
  }

  // The boxes with the largest sums become sets of the linear programme, so that its weights fit the boxes.
  // They lie apart: many near one place would say the same.
  void add_rows(std::size_t most) {
    std::vector<Point> centers;
    for (const CenterBox& box : boxes_) centers.push_back(box.center);
    const PointTree tree(centers);
    std::vector<char> gone(boxes_.size());
    std::vector<std::uint32_t> found;
    std::size_t added = 0;
    for (std::size_t k = 0; k < boxes_.size() && added < most; k++) {
      if (gone[k] || boxes_[k].half > kLargestRow * tolerance_sum_) continue;
      found.clear();
      tree.find(boxes_[k].center, kRowDistance * tolerance_sum_, found);
      for (auto other : found) gone[other] = 1;
      find(boxes_[k], found);
      rows_.add(found), added++;
    }
  }

  const Surface& surface_;
  const LowerBoundOptions& options_;
  const double tolerance_sum_;
  const double farthest_;  // no centre is farther from what its ball covers, but for its depth in a solid
  PointTree tree_;         // of the points with weights
  Sets rows_;              // points that one ball may cover, for many balls
  Packing packing_;
  std::vector<CenterBox> boxes_, settled_;
};

}  // namespace

std::uint64_t fewest_balls(const Surface& surface, const LowerBoundOptions& options) {
  return LowerBound(surface, options).run();
}

}  // namespace padder
