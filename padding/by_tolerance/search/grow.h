// SPDX-License-Identifier: MIT
// Grows the balls that may be chosen for a cover.
#pragma once
#include <optional>

#include "padding/by_tolerance/search/cover_problem.h"
#include "padding/by_tolerance/search/room.h"
#include "padding/geometry/random.h"
#include "padding/geometry/surface.h"

namespace padder {

// What the balls of a cover must keep. Lengths are in the surface's unit.
struct BallLimits {
  double protrusion, gap;         // of the cover
  double tolerance_sum;           // of both
  double min_radius;              // of a ball
  double largest_inner_distance;  // of its centre
};

// A ball that may be chosen is an inner medial ball, dilated by the whole protrusion. Keeps a reference to
// the surface.
class BallGrower {
 public:
  BallGrower(const Surface& surface, const BallLimits& limits)
      : surface_(surface), limits_(limits), room_(surface, limits.min_radius - limits.protrusion) {}

  // No ball inside of the body is large enough to be chosen.
  bool none_fits() const { return room_.none(); }

  // The medial ball that touches p, on this triangle. `guess` is about its radius, or 0; `inner` is a ball
  // nearby that lies inside (medial.h). Where that is too small to be chosen, as in a sharp edge that no ball
  // may stand out of, it is a larger ball that covers p, if one was found.
  Ball medial(const Point& p, std::uint32_t triangle, double guess = 0, const Ball& inner = {}) const;
  // Adds this medial ball of p, dilated, unless it is too small.
  void propose(const Point& p, std::uint32_t triangle, const Ball& medial,
               std::vector<Candidate>& candidates) const;
  // Adds the ball of a random place beside that of a candidate, at most `most` away along each axis.
  void try_place(const Candidate& beside, double most, Random& random,
                 std::vector<Candidate>& candidates) const;
  // The radius of the disc that a candidate covers on a flat.
  double covered_disc(const Candidate& candidate) const {
    return padder::covered_disc(candidate.inner_distance, limits_.tolerance_sum);
  }
  const Surface& surface() const { return surface_; }
  const BallLimits& limits() const { return limits_; }

 private:
  bool too_narrow(const Point& q, const Vector& normal, double tolerance) const;
  std::optional<Ball> ball_beside(const Point& p, std::uint32_t triangle) const;
  // May this inner ball be chosen, dilated?
  bool allows(const Ball& inner) const {
    const double radius = inner.radius + limits_.protrusion;
    return radius > 0 && radius >= limits_.min_radius;
  }

  const Surface& surface_;
  const BallLimits limits_;
  const Room room_;  // for the inner balls that min_radius allows
};

}  // namespace padder
