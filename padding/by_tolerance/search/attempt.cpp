// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/search/attempt.h"

#include <array>
#include <numeric>

#include "padding/by_tolerance/search/block_search.h"

namespace padder {
namespace {

// How far from the place of a chosen ball, in turn: share of the radius of the disc that it covers.
constexpr std::array step_sizes = {0.2, 0.3};
// Balls that were tried stay to be chosen from while there are at most so many for each chosen one, and in
// all.
constexpr std::size_t most_tried = 40, most_tried_in_all = 400'000;

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
  const std::size_t n = chosen.size() * static_cast<std::size_t>(places);
  const std::uint64_t round = Random(++seed).next();
  std::vector<std::vector<Candidate>> tried_at(n);
#pragma omp parallel for schedule(dynamic, 16) if (n > 64)
  for (std::size_t k = 0; k < n; k++) {
    const Candidate& c = problem.candidates()[chosen[k / static_cast<std::size_t>(places)]];
    Random random(round + k);
    grower.try_place(c, step_sizes[k % 2] * grower.covered_disc(c), random, tried_at[k]);
  }
  std::vector<Candidate> fresh;
  for (const auto& candidates : tried_at) fresh.insert(fresh.end(), candidates.begin(), candidates.end());
  const std::size_t tried = problem.candidates().size();
  if (tried > most_tried_in_all || tried > most_tried * chosen.size()) {
    problem.keep(chosen);
    std::iota(chosen.begin(), chosen.end(), 0u);
  }
  problem.add({}, fresh);
}

}  // namespace padder
