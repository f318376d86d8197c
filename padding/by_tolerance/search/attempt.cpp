// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/search/attempt.h"

#include <algorithm>
#include <array>
#include <iterator>

#include "padding/by_tolerance/search/block_search.h"
#include "padding/geometry/indices.h"

namespace padder {
namespace {

// How far from the place of a chosen ball, in turn: share of the radius of the disc that it covers.
constexpr std::array kStepSizes = {0.25, 0.4};
// Balls that were tried stay to be chosen from while there are at most so many for each chosen one, and in
// all.
constexpr std::size_t kMostTried = 20, kMostTriedInAll = 400'000;

}  // namespace

std::vector<Candidate> Attempt::chosen_candidates() const {
  std::vector<Candidate> candidates;
  for (auto k : chosen) candidates.push_back(problem.candidates()[k]);
  return candidates;
}

std::vector<Ball> Attempt::balls() const {
  std::vector<Ball> balls;
  for (auto k : chosen) balls.push_back(problem.candidates()[k].ball);
  return balls;
}

void Attempt::solve(double steps) {
  const Sets sets = problem.sets();
  const std::size_t n = problem.points().size();
  chosen = complete(sets, n, chosen);
  if (!(steps > 0)) return;
  const BlockSearch search{.steps = steps, .seed = ++seed};
  if (chosen.size() <= search.block) {
    SetCover cover(sets, n);
    cover.greedy(chosen);
    cover.improve(static_cast<std::uint64_t>(steps * static_cast<double>(chosen.size())), search.seed);
    chosen = cover.best();
    return;
  }
  std::vector<Point> centers;
  for (const Candidate& c : problem.candidates()) centers.push_back(c.ball.center);
  chosen = improve_in_blocks(sets, n, centers, chosen, search);
}

void Attempt::try_places(const BallGrower& grower, int places) {
  const std::size_t tried = problem.candidates().size();
  if (tried > kMostTriedInAll || tried > kMostTried * chosen.size()) {
    problem.keep(chosen);
    chosen = numbered(chosen.size());
  }
  try_places(grower, places, numbered(chosen.size()));
}

// `around`: places in `chosen`.
void Attempt::try_places(const BallGrower& grower, int places, const std::vector<std::uint32_t>& around) {
  const std::size_t n = around.size() * static_cast<std::size_t>(places);
  const std::uint64_t round = Random(++seed).next();
  std::vector<std::vector<Candidate>> tried_at(n);
#pragma omp parallel for schedule(dynamic, 16) if (n > 64)
  for (std::size_t k = 0; k < n; k++) {
    const Candidate& c = problem.candidates()[chosen[around[k / static_cast<std::size_t>(places)]]];
    Random random(round + k);
    grower.try_place(c, kStepSizes[k % 2] * grower.covered_disc(c), random, tried_at[k]);
  }
  std::vector<Candidate> fresh;
  for (const auto& candidates : tried_at) fresh.insert(fresh.end(), candidates.begin(), candidates.end());
  problem.add({}, fresh);
}

// The places in `chosen` of the balls that share a point with a candidate that covers an open point.
std::vector<std::uint32_t> Attempt::beside_open_points() const {
  enum : char { open, covered, near };
  std::vector<char> state(problem.points().size(), open);
  for (const auto k : chosen)
    for (const auto r : problem.covered(k)) state[r] = covered;
  for (std::uint32_t k = 0; k < problem.candidates().size(); k++) {
    const std::vector<std::uint32_t>& points = problem.covered(k);
    if (std::none_of(points.begin(), points.end(), [&](auto r) { return state[r] == open; })) continue;
    for (const auto r : points)
      if (state[r] == covered) state[r] = near;
  }
  std::vector<std::uint32_t> beside;
  for (std::uint32_t k = 0; k < chosen.size(); k++) {
    const std::vector<std::uint32_t>& points = problem.covered(chosen[k]);
    if (std::any_of(points.begin(), points.end(), [&](auto r) { return state[r] == near; }))
      beside.push_back(k);
  }
  return beside;
}

std::vector<char> Attempt::repair(const BallGrower& grower, int places, double steps) {
  const std::vector<std::uint32_t> beside = beside_open_points();
  try_places(grower, places, beside);
  std::vector<std::uint32_t> kept = chosen, moved, result;
  for (std::size_t k = beside.size(); k-- > 0;) kept.erase(kept.begin() + beside[k]);
  std::sort(kept.begin(), kept.end());
  const Sets sets = problem.sets();
  const std::size_t n = problem.points().size();
  chosen = complete(sets, n, chosen);
  std::set_intersection(kept.begin(), kept.end(), chosen.begin(), chosen.end(), std::back_inserter(result));
  std::set_difference(chosen.begin(), chosen.end(), kept.begin(), kept.end(), std::back_inserter(moved));
  std::vector<Point> centers;
  for (const Candidate& c : problem.candidates()) centers.push_back(c.ball.center);
  moved = improve_in_blocks(sets, n, centers, moved, {.steps = steps, .seed = ++seed}, result);
  std::vector<char> fresh(result.size(), 0);
  result.insert(result.end(), moved.begin(), moved.end());
  fresh.resize(result.size(), 1);
  chosen.swap(result);
  return fresh;
}

}  // namespace padder
