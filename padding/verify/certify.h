// SPDX-License-Identifier: MIT
// The certificate: proved upper bounds of both errors of a union of balls against a surface. Not sampled.
// docs/tolerance.md has the proofs. All bounds hold up to rounding, about 1e-15 of the largest coordinate.
#pragma once
#include <vector>

#include "padding/geometry/balls.h"
#include "padding/geometry/surface.h"

namespace padder {

// How far a ball can stand out of the body: radius - D for a centre inside at the distance D from the
// surface, radius + D for a centre outside. No point of the ball outside the body lies farther from the
// surface; negative for a ball that stays below it.
struct ProtrusionBound {
  double max = -std::numeric_limits<double>::infinity();  // over all balls
  std::uint32_t ball = 0;                                 // where
  std::vector<double> each;                               // one a ball
  bool proved = false;      // false for an open surface: it has no inside, and `each` is only an estimate
  std::size_t outside = 0;  // balls whose centre lies outside the body, none in a sound cluster: the surface
                            // faces inward there, or the ball was never meant for it
};

// Inside is where the surface's winding number is above 0: the surface must be closed, which is looked at
// here, and may intersect itself, overlap and be turned inside out; nothing is taken on trust. A
// nearest-point query and a ray for each ball; runs on all threads. On an open surface, inside is below its
// normals.
ProtrusionBound protrusion_bound(const Surface& surface, const std::vector<Ball>& balls);

// A piece of a triangle, small enough to be judged by itself.
struct Cell {
  std::array<Point, 3> corner;
  std::uint32_t triangle = 0;   // of the mesh
  Point point = Point::Zero();  // the point of the cell with the largest signed gap that was looked at
  double value = 0;             // that gap
  double bound = 0;             // proved: no point of the cell has a larger gap

  Point centroid() const { return (corner[0] + corner[1] + corner[2]) / 3; }
  double size() const;  // longest edge
};

// The largest distance of a surface point to the union.
struct GapBound {
  double upper = 0;  // proved: no point lies farther out; 0 when all is inside the union
  double lower = 0;  // attained at `point`
  Point point = Point::Zero();
  std::uint32_t triangle = 0;  // that the point lies on
};

// Branch and bound: a ball's gap is a convex function, so its largest value over a cell is at a corner; the
// best ball at the centroid gives each cell a bound, and cells are bisected until upper <= floor or, where
// lower is above the floor, upper <= lower * (1 + relative). `floor`: gaps up to here need not be told apart
// (a tolerance; 0 for the true maximum). upper >= lower always. An empty union has an infinite gap. Runs on
// all threads; the result does not depend on their number.
GapBound gap_bound(const Mesh& mesh, const BallSet& balls, double floor = 0, double relative = 1e-3);

// The cells that could not be proved to lie within `bound`: an empty answer is the proof that all do. A cell
// is bisected as long as it is larger than `grain` or no point of it is known that fails, down to a size
// below which only rounding is left. In the order of the triangles, whatever the number of threads.
std::vector<Cell> gap_failures(const Mesh& mesh, const BallSet& balls, double bound, double grain);

}  // namespace padder
