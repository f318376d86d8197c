// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/cull.h"

#include <algorithm>
#include <cmath>

#include "padding/asset/error.h"
#include "padding/by_tolerance/fill.h"
#include "padding/verify/union_shape.h"

namespace padder {
namespace {

constexpr double kLargestError = 0.5;    // of the diagonal: any ball inside the body covers everything
constexpr double kSmallestError = 2e-4;  // of the diagonal: a search for a count goes no lower
constexpr double kCoverDepth = 0.01;     // share of the protrusion, where no gap is allowed
// The search for a count goes down a ladder of tolerance sums in strides of so many rungs. Among few balls
// each rung counts, and some below the best are tried.
constexpr double kStride = 0.7;
constexpr int kRungs = 64, kRungsBelow = 8;
constexpr std::size_t kFewBalls = 32;
constexpr double kOfGuess = 0.35;  // the tolerance sum of few balls may be this share of its guess
// A cover is smoother than another one if its mean normal error is less than such a share of the other's.
constexpr double kSmoother = 0.98;
constexpr double kLargestRatio = 0.9;  // of a tolerance sum that is tried to be smoother to the one before
// No step to a smaller sum goes below this share: a cover of a sheet has ten times as many balls for it. A
// long step that is in vain is no chance.
constexpr double kSmallestRatio = 0.3, kLongStep = 0.6;
constexpr std::uint64_t kAnyCount = std::numeric_limits<std::uint64_t>::max();
// Half of what is promised. The other half is for errors of the estimate.
constexpr double kVolumeGoal = 0.005;

class CullSearch {
 public:
  CullSearch(const Surface& surface, const CullOptions& options)
      : surface_(surface), options_(options), diagonal_(surface.bounds().diagonal()) {}

  Culled run() {
    if (options_.only_protrusion && options_.only_gap) return each_by_itself();
    if (!(options_.tolerance > 0) && options_.max_spheres == 0)
      throw Error("neither a tolerance nor a number of spheres is given: give one of them");
    Culled culled;
    const bool mean = options_.balance == Balance::mean;
    double tolerance_sum = 2 * options_.tolerance;
    if (options_.max_spheres > 0) {
      const double least = mean ? 0 : tolerance_sum;
      tolerance_sum = tolerance_sum_for_count(options_.max_spheres, least);
      culled.within = !(options_.tolerance > 0) || tolerance_sum <= 2 * options_.tolerance;
    } else if (mean) {
      cover(tolerance_sum);
      covered_ = covers(cover_);
      tolerance_sum = tolerance_sum_for_count(cover_.balls.size() + cover_.balls.size() / 2, 0);
    }
    cover(tolerance_sum);
    // The bound on both errors from here on: the tolerance, or what the count allowed.
    bound_ = culled.within && options_.tolerance > 0 ? options_.tolerance : 0.5 * tolerance_sum;
    if (options_.smooth > 0) tolerance_sum = smoother(tolerance_sum);
    double dilation = 0.5 * tolerance_sum;
    if (options_.balance == Balance::volume) dilation = true_volume(tolerance_sum, culled);
    if (options_.balance == Balance::mean) dilation = smallest_means(tolerance_sum);
    culled.balls = dilated(dilation);
    culled.triangle = cover_.triangle;
    culled.protrusion = dilation, culled.gap = tolerance_sum_ - dilation;
    culled.open = cover_.open, culled.proved = cover_.proved;
    culled.within = culled.within || std::max(culled.protrusion, culled.gap) <= options_.tolerance;
    return culled;
  }

 private:
  CoverOptions cover_options(double protrusion, double gap) {
    CoverOptions options;
    options.protrusion = protrusion, options.gap = gap;
    options.min_radius = options_.min_radius, options.max_radius = options_.max_radius;
    options.effort = options_.effort;
    if (!options_.tell) return options;
    // Of one cover that is all; of a search, nobody knows how many covers it takes: each takes a part of what
    // is left.
    const bool one = options_.max_spheres == 0 && options_.smooth <= 0 && options_.balance == Balance::none;
    const double part = one ? 1 : options_.max_spheres > 0 ? 0.1 : 0.25, left = std::pow(1 - part, covers_);
    options.tell = [this, left, part](double share) { options_.tell(1 - left + left * part * share); };
    covers_++;
    return options;
  }

  Culled each_by_itself() {
    const double protrusion = *options_.only_protrusion, gap = *options_.only_gap;
    // Without a gap, the surface is covered a little deeper than it must be: the proof that the inside is
    // covered, too, would else have to look at the surface without end.
    const double depth = gap > 0 ? 0 : kCoverDepth * protrusion, moved = std::max(-gap, 0.0);
    const bool room = moved == 0 || protrusion > 2 * moved;  // else nothing is proved
    cover_ = cover_surface(surface_, cover_options(protrusion, (room ? gap : 0) - depth));
    Culled culled;
    culled.balls = cover_.balls, culled.triangle = cover_.triangle;
    culled.protrusion = protrusion, culled.gap = std::max(gap, 0.0);
    culled.open = cover_.open, culled.proved = cover_.proved;
    if (!(depth > 0) || !room || cover_.open.why != WhyOpen::nothing) return culled;
    FillOptions filling{.depth = depth * (1 - 1e-6), .protrusion = protrusion * (1 - kKeptBack)};
    filling.min_radius = options_.min_radius * (1 + kKeptBack);
    filling.max_radius = options_.max_radius * (1 - kKeptBack);
    filling.moved = moved;
    const Filled filled = fill_body(surface_, BallSet(cover_.balls), filling);
    culled.balls.insert(culled.balls.end(), filled.balls.begin(), filled.balls.end());
    culled.triangle.insert(culled.triangle.end(), filled.triangle.begin(), filled.triangle.end());
    culled.filled = filled.covered;
    return culled;
  }

  // Makes cover_ the cover for this tolerance sum, unless it is so already. One of many more balls than
  // `most_balls` may be unfinished.
  void cover(double tolerance_sum, std::uint64_t most_balls = kAnyCount) {
    if (tolerance_sum == tolerance_sum_) return;
    CoverOptions options = cover_options(0.5 * tolerance_sum, 0.5 * tolerance_sum);
    options.most_balls = most_balls;
    cover_ = cover_surface(surface_, options);
    tolerance_sum_ = tolerance_sum;
  }

  std::vector<Ball> dilated(double dilation) const {
    std::vector<Ball> balls = cover_.balls;
    for (Ball& ball : balls) ball.radius += dilation - 0.5 * tolerance_sum_;
    return balls;
  }

  // About the tolerance sum that so many balls can keep. It is right if the covered discs, each of the
  // area that one sphere must answer for, lay on a flat whose inner medial balls have the mean thickness. It
  // is rather too large, because small covers are found quickly.
  double guess_for(std::uint64_t count) const {
    const double area = surface_.mesh().area(),
                 r = std::abs(mass_properties(surface_.boundary()).volume) / area;
    const double disc2 = 0.5 * area / static_cast<double>(count);
    return std::sqrt(r * r + disc2) - r;
  }

  // As cover(), but goes back to the cover before where the new one has too many balls, or leaves surface
  // open that the one before covered, as a smallest radius may make it.
  enum class Outcome : std::uint8_t { kept, too_many, opens };
  Outcome cover_with_few(double tolerance_sum) {
    const Cover last = cover_;
    const double last_sum = tolerance_sum_;
    cover(tolerance_sum);
    const bool many = options_.max_spheres > 0 && cover_.balls.size() > options_.max_spheres;
    if (!many && (covers(cover_) || !covers(last))) return Outcome::kept;
    cover_ = last, tolerance_sum_ = last_sum;
    return many ? Outcome::too_many : Outcome::opens;
  }
  static bool covers(const Cover& cover) { return cover.open.why == WhyOpen::nothing; }

  // A small tolerance sum, but at least `least`, for which at most `count` balls suffice. The search goes
  // down a ladder of sums until there are too many balls, then halves the last stride. At last it tries some
  // rungs below, because the number of balls is not quite steady. The next rung depends on nothing but
  // whether there were too many balls on this one. So a larger count follows the same way, or leaves it for a
  // smaller sum: its result is never worse.
  double tolerance_sum_for_count(std::uint64_t count, double least) {
    least = std::max(least, 2 * kSmallestError * diagonal_);
    // Where the count is likely to be plenty, one cover says so.
    if (guess_for(count) < least) {
      cover(least);
      if (cover_.balls.size() <= count) return least;
    }
    const auto sum_of = [&](int rung) {
      return std::max(least, 2 * kLargestError * diagonal_ * std::pow(kStride, double(rung) / kRungs));
    };
    const auto enough = [&](int rung) {
      // With a smallest radius, what stays open is asked for.
      cover(sum_of(rung), options_.min_radius > 0 ? kAnyCount : count);
      // Few balls are no answer where a smallest radius leaves surface open: smaller sums only leave more.
      const bool in_vain = cover_.open.why == WhyOpen::min_radius && !(options_.tolerance > 0);
      if (cover_.balls.size() > count || in_vain || (covered_ && !covers(cover_))) return false;
      best_ = cover_;
      return true;
    };
    int good = -kRungs, bad = 0;  // the lowest rung that is known to be enough, and one that is not
    for (; enough(bad); bad += kRungs) {
      good = bad;
      if (sum_of(good) == least) break;
    }
    if (good < 0)
      throw Error(cover_.open.why == WhyOpen::min_radius
                      ? "no spheres as large as --min-radius cover it: use a smaller one"
                      : "no cover with so few spheres was found: allow more spheres");
    while (bad - good > 1 && !used_up(best_.balls.size(), count)) {
      const int middle = (good + bad) / 2;
      (enough(middle) ? good : bad) = middle;
    }
    const double few = kOfGuess * guess_for(kFewBalls);
    for (int rung = good + 1, last = good + kRungsBelow; rung <= last && sum_of(rung) > std::max(few, least);
         rung++)
      if (enough(rung)) good = rung;
    cover_ = best_, tolerance_sum_ = sum_of(good);
    return tolerance_sum_;
  }

  // A few balls more or less are a large step of the tolerance sum. Of many, so few are not worth the search.
  static bool used_up(std::size_t balls, std::uint64_t count) {
    return balls > kFewBalls && static_cast<double>(balls) >= 0.97 * static_cast<double>(count);
  }

  // Balls grow in number at least as the tolerance sum shrinks (docs/tolerance.md): to try less than this
  // share of it would make a cover that the count forbids, of up to hundreds of times as many balls.
  double least_ratio_for_count() const {
    if (options_.max_spheres == 0) return 0;
    return static_cast<double>(cover_.balls.size()) / static_cast<double>(options_.max_spheres);
  }

  // Shrinks the tolerance sum until the mean normal error is as asked or the count is used up: dents of the
  // union are as deep as the tolerance sum. Ends where smaller sums are no smoother, as in a thin plate, from
  // which balls of any size stand out alike, and goes back to the smoothest, which has fewer balls.
  double smoother(double tolerance_sum) {
    const double least = std::max(0.05 * tolerance_sum, 2 * kSmallestError * diagonal_);
    double smoothest = std::numeric_limits<double>::infinity(), smoothest_sum = tolerance_sum_;
    best_ = cover_;
    double last_ratio = 1;
    for (int step = 0, vain = 0; step < 6 && vain < 2 && cover_with_few(tolerance_sum) == Outcome::kept;
         step++) {
      const double error = union_shape(surface_, dilated(0.5 * tolerance_sum)).normal_error;
      vain += last_ratio < kLongStep ? 2 : 1;
      if (error <= options_.smooth || error < kSmoother * smoothest)
        smoothest = error, best_ = cover_, smoothest_sum = tolerance_sum, vain = 0;
      if (error <= options_.smooth || tolerance_sum <= least) break;
      // On a flat, the normal error grows with the root of the tolerance sum.
      const double ratio = 0.95 * options_.smooth / error;
      const double allowed = least_ratio_for_count();
      if (allowed > kLargestRatio) break;
      last_ratio = std::clamp(ratio * ratio, std::max(kSmallestRatio, allowed), kLargestRatio);
      tolerance_sum = std::max(least, tolerance_sum * last_ratio);
    }
    cover_ = best_, tolerance_sum_ = smoothest_sum;
    return tolerance_sum_;
  }

  // The smallest and the largest dilation that keep both bounds, and the radii that are allowed. The balls of
  // the cover, whose dilation is half of the tolerance sum, keep all of them.
  std::pair<double, double> allowed(double tolerance_sum) const {
    double least = tolerance_sum - bound_, most = std::min(bound_, tolerance_sum);
    const double half = 0.5 * tolerance_sum, smallest = options_.min_radius * (1 + kKeptBack),
                 largest = options_.max_radius * (1 - kKeptBack);
    for (const Ball& ball : cover_.balls) {
      least = std::max(least, half + std::min(smallest - ball.radius, 0.0));
      most = std::min(most, half + std::max(largest - ball.radius, 0.0));
    }
    return {least, most};
  }

  // Finds the largest tolerance sum for which the smallest allowed dilation still has at most the true
  // volume, then the dilation that has it. When the count forbids a smaller sum, the volume comes before the
  // tolerance.
  double true_volume(double& tolerance_sum, Culled& culled) {
    const double body = mass_properties(surface_.boundary()).volume;
    if (!(body > 0)) throw Error("the body has no volume to match: use --balance mean or none");
    const auto ratio = [&](double dilation) {
      return union_shape(surface_, dilated(dilation)).volume / body;
    };
    for (int step = 0; step < 6; step++) {
      const Outcome outcome = cover_with_few(tolerance_sum);
      if (outcome != Outcome::kept) tolerance_sum = tolerance_sum_, step = 5;
      if (outcome == Outcome::too_many) bound_ = tolerance_sum, culled.within = !(options_.tolerance > 0);
      const auto [least, most] = allowed(tolerance_sum);
      double low = least, high = most, at_low = ratio(low);
      if (at_low > 1 + kVolumeGoal && step < 5) {
        // Volume grows with the dilation about as fast as with the surface's area.
        const double surplus = (at_low - 1) * body / surface_.mesh().area();
        tolerance_sum = std::max(0.4 * tolerance_sum, tolerance_sum - 1.1 * surplus);
        continue;
      }
      if (at_low >= 1 - kVolumeGoal) return low;
      for (int halving = 0; halving < 12; halving++) {
        const double middle = 0.5 * (low + high);
        const double at_middle = ratio(middle);
        if (std::abs(at_middle - 1) < 0.2 * kVolumeGoal) return middle;
        (at_middle < 1 ? low : high) = middle;
      }
      return 0.5 * (low + high);
    }
    return 0.5 * tolerance_sum;
  }

  double smallest_means(double tolerance_sum) {
    cover(tolerance_sum);
    const auto [least, most] = allowed(tolerance_sum);
    double best = 0.5 * tolerance_sum, smallest = std::numeric_limits<double>::infinity();
    constexpr int steps = 16;
    for (int k = 0; k <= steps; k++) {
      const double dilation = least + (most - least) * k / steps;
      const UnionShape shape = union_shape(surface_, dilated(dilation));
      const double sum = shape.protrusion + shape.gap;
      if (sum < smallest) smallest = sum, best = dilation;
    }
    return best;
  }

  const Surface& surface_;
  const CullOptions& options_;
  const double diagonal_;
  Cover cover_, best_;
  double tolerance_sum_ = 0, bound_ = 0;
  bool covered_ = false;  // all of the surface, by the cover that the tolerance asks for
  int covers_ = 0;        // that were made
};

}  // namespace

void CullOptions::keep_back(double moved) {
  const auto lessen = [moved](double& error, double room) {
    if (room > 2 * moved) error -= moved;
  };
  lessen(tolerance, tolerance);
  if (!only_protrusion || !only_gap) return;
  lessen(*only_protrusion, *only_gap > 0 ? *only_gap : *only_protrusion);
  *only_gap > 0 ? lessen(*only_gap, *only_gap) : void(*only_gap -= moved);
}

Culled cull(const Surface& surface, const CullOptions& options) { return CullSearch(surface, options).run(); }

}  // namespace padder
