// SPDX-License-Identifier: MIT
// A cover that is being looked for.
#pragma once
#include <cstdint>
#include <vector>

#include "padding/by_tolerance/search/cover_problem.h"
#include "padding/by_tolerance/search/grow.h"

namespace padder {

// The points to cover, the balls to choose from, and those that are chosen.
struct Attempt {
  CoverProblem problem;
  std::vector<std::uint32_t> chosen;  // indices of candidates
  std::uint64_t seed;                 // of all random numbers from here on

  std::vector<Candidate> chosen_candidates() const;
  std::vector<Ball> balls() const;

  // Chooses the fewest candidates, beginning with those that are chosen. `steps` counts exchanges of the
  // local search for each ball; with 0 balls are only added where a point is open, and dropped where none
  // needs them.
  void solve(double steps);

  // Adds candidates at so many places around each chosen ball. Those that were tried before stay, unless they
  // have become too many: then all but the chosen ones are dropped first.
  void try_places(const BallGrower& grower, int places);

  // Covers the points that are open by moving the balls around them, and adds a ball only where that fails:
  // tries so many places around each of these balls, and searches among them. The others stay. Returns for
  // each chosen ball whether it was one of these. Costs little where few points are open.
  std::vector<char> repair(const BallGrower& grower, int places, double steps);

 private:
  std::vector<std::uint32_t> beside_open_points() const;
  void try_places(const BallGrower& grower, int places, const std::vector<std::uint32_t>& around);
};

}  // namespace padder
