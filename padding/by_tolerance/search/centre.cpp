// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/search/centre.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace padder {
namespace {

// Sweeps over all balls, and places that are tried in each, half of them nearby.
constexpr int kSweeps = 3, kSweepPlaces = 16;
constexpr double kStep = 0.2, kSweepDecay = 0.8;  // share of the covered disc's radius; for each sweep

// How many of the chosen balls cover each point.
class CoverCounts {
 public:
  explicit CoverCounts(const Attempt& attempt)
      : problem_(attempt.problem), count_(problem_.points().size()), open_(count_.size()) {
    for (const auto k : attempt.chosen) add(k);
  }

  std::uint32_t operator[](std::uint32_t point) const { return count_[point]; }
  std::size_t open() const { return open_; }

  // Puts one candidate in the place of another, unless more points would be open then. Returns the chosen
  // one.
  std::uint32_t exchange(std::uint32_t old, std::uint32_t fresh) {
    const std::size_t before = open_;
    add(fresh), remove(old);
    if (open_ <= before) return fresh;
    add(old), remove(fresh);
    return old;
  }

 private:
  void add(std::uint32_t candidate) {
    for (const auto r : problem_.covered(candidate)) open_ -= count_[r]++ == 0;
  }
  void remove(std::uint32_t candidate) {
    for (const auto r : problem_.covered(candidate)) open_ += --count_[r] == 0;
  }

  const CoverProblem& problem_;
  std::vector<std::uint32_t> count_;
  std::size_t open_;
};

// The best place for a ball that must cover its own points, if one is better than where it is.
std::optional<Candidate> centred(const CoverProblem& problem, const BallGrower& grower, Candidate ball,
                                 const std::vector<std::uint32_t>& own, double step_size,
                                 std::uint64_t seed) {
  const auto least_depth = [&](const Candidate& candidate, double enough) {
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < own.size() && least > enough; k++)
      least = std::min(least, problem.depth(candidate, problem.points()[own[k]]));
    return least;
  };
  double depth = least_depth(ball, -std::numeric_limits<double>::infinity());
  bool moved = false;
  Random random(seed);
  const double most = step_size * grower.covered_disc(ball);
  std::vector<Candidate> tried;
  for (int k = 0; k < kSweepPlaces; k++) {
    tried.clear();
    grower.try_place(ball, 2 * k < kSweepPlaces ? most : 0.4 * most, random, tried);
    const double there = tried.empty() ? depth : least_depth(tried[0], depth);
    if (there > depth) depth = there, ball = tried[0], moved = true;
  }
  if (!moved) return std::nullopt;
  return ball;
}

// One sweep over the balls. Returns how many points stay open.
std::size_t sweep(Attempt& attempt, const BallGrower& grower, const std::vector<char>& always,
                  double step_size) {
  CoverProblem& problem = attempt.problem;
  const BallLimits& limits = grower.limits();
  CoverCounts counts(attempt);
  const std::size_t n = attempt.chosen.size();
  std::vector<std::vector<std::uint32_t>> own(n);
  const BallSet set(attempt.balls());
  for (std::uint32_t r = 0; r < problem.points().size(); r++) {
    if (counts[r] > 0) continue;
    const BallGap nearest = set.gap(problem.points()[r].point, limits.gap + 0.25 * limits.tolerance_sum);
    if (std::isfinite(nearest.value)) own[nearest.ball].push_back(r);
  }
  const std::uint64_t round = Random(++attempt.seed).next();
  std::vector<std::optional<Candidate>> better(n);
#pragma omp parallel for schedule(dynamic, 16) if (n > 32)
  for (std::size_t k = 0; k < n; k++) {
    if (!always[k] && own[k].empty()) continue;
    for (const auto r : problem.covered(attempt.chosen[k]))
      if (counts[r] == 1) own[k].push_back(r);
    if (!own[k].empty())
      better[k] =
          centred(problem, grower, problem.candidates()[attempt.chosen[k]], own[k], step_size, round + k);
  }
  std::vector<Candidate> fresh;
  for (const auto& candidate : better)
    if (candidate) fresh.push_back(*candidate);
  auto next = static_cast<std::uint32_t>(problem.candidates().size());
  problem.add({}, fresh);
  // One after the other: two balls that leave a point which both cover would open it.
  for (std::size_t k = 0; k < n; k++)
    if (better[k]) attempt.chosen[k] = counts.exchange(attempt.chosen[k], next++);
  return counts.open();
}

}  // namespace

std::size_t centre(Attempt& attempt, const BallGrower& grower, const std::vector<char>& always) {
  const bool some = std::count(always.begin(), always.end(), 1) > 0;
  std::size_t open = 1;
  double step_size = kStep;
  for (int k = 0; k < kSweeps && (some || open > 0); k++, step_size *= kSweepDecay)
    open = sweep(attempt, grower, always, step_size);
  return open;
}

}  // namespace padder
