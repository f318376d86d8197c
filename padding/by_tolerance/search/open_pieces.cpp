// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/search/open_pieces.h"

#include <algorithm>
#include <array>
#include <set>

#include "padding/by_tolerance/search/samples.h"
#include "padding/geometry/triangle.h"

namespace padder {

std::vector<GapPart> OpenPieces::failures(std::vector<Ball> balls, double grain) {
  const BallSet set(balls);
  if (state_.empty())
    cut(set);
  else
    reopen(balls);
  std::vector<GapPart> found = ask(set, grain);
  if (found.empty() && std::count(state_.begin(), state_.end(), State::stacked) > 0) {
    std::replace(state_.begin(), state_.end(), State::stacked, State::open);
    found = ask(set, grain);
  }
  last_ = std::move(balls);
  return found;
}

// Asks the open pieces, and closes those that are proved.
std::vector<GapPart> OpenPieces::ask(const BallSet& balls, double grain) {
  Mesh part;
  std::vector<std::uint32_t> piece;
  for (std::uint32_t k = 0; k < state_.size(); k++)
    if (state_[k] == State::open) piece.push_back(k), part.triangles.push_back(pieces_.triangles[k]);
  part.points.swap(pieces_.points);
  std::vector<GapPart> failures = gap_failures(part, balls, gap_, grain);
  part.points.swap(pieces_.points);
  for (const std::uint32_t k : piece) state_[k] = State::proved;
  for (GapPart& failure : failures) {
    const std::uint32_t k = piece[failure.triangle];
    state_[k] = State::open, failure.triangle = triangle_[k];
  }
  return failures;
}

// Bisects triangles until each piece is about as large as the ball nearest to it, as the certificate would.
void OpenPieces::cut(const BallSet& balls) {
  pieces_.points = mesh_.points;
  double smallest = std::numeric_limits<double>::infinity();
  for (const Ball& ball : balls.balls()) smallest = std::min(smallest, ball.radius);
  const double cell = 0.25 * (smallest + gap_);
  std::vector<TrianglePart> stack;
  FirstOfCell first_of_cell;
  for (std::uint32_t t = 0; t < mesh_.triangles.size(); t++) {
    const Vector normal = mesh_.area_normal(t);
    stack.push_back({mesh_.corners(t), t});
    for (bool whole = true; !stack.empty(); whole = false) {
      const TrianglePart part = stack.back();
      stack.pop_back();
      const double size = part.size();
      if (size > 2 * (smallest + gap_) && !balls.empty() &&
          size > 2 * (balls.balls()[balls.gap(part.centroid()).ball].radius + gap_)) {
        for (const TrianglePart& half : bisect(part)) stack.push_back(half);
        continue;
      }
      const auto first = static_cast<std::uint32_t>(pieces_.points.size());
      if (!whole) pieces_.points.insert(pieces_.points.end(), part.corner.begin(), part.corner.end());
      pieces_.triangles.push_back(whole ? mesh_.triangles[t] : std::array{first, first + 1, first + 2});
      const bool alone = size <= cell || first_of_cell.take(part.centroid(), normal, cell);
      state_.push_back(alone ? State::open : State::stacked);
      triangle_.push_back(t);
    }
  }
}

void OpenPieces::reopen(const std::vector<Ball>& balls) {
  const auto key = [](const Ball& b) {
    return std::array{b.center.x(), b.center.y(), b.center.z(), b.radius};
  };
  std::set<std::array<double, 4>> now;
  for (const Ball& ball : balls) now.insert(key(ball));
  std::vector<Ball> gone;
  for (const Ball& ball : last_)
    if (!now.contains(key(ball))) gone.push_back(ball);
  if (gone.empty()) return;
  const BallSet set(gone);
#pragma omp parallel for schedule(static) if (state_.size() > 4096)
  for (std::size_t k = 0; k < state_.size(); k++) {
    if (state_[k] != State::proved) continue;
    const TrianglePart piece{pieces_.corners(k)};
    if (set.any_contains(piece.centroid(), -(piece.radius() + gap_ + 1e-9))) state_[k] = State::open;
  }
}

}  // namespace padder
