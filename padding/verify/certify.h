// SPDX-License-Identifier: MIT
// The certificate: upper bounds for the protrusion and the gap of a union of balls against a surface. They
// are proved and not sampled; docs/tolerance.md has the proofs. Rounding may falsify them by about 1e-15 of
// the largest coordinate.
#pragma once
#include <optional>
#include <vector>

#include "padding/geometry/balls.h"
#include "padding/geometry/surface.h"
#include "padding/geometry/triangle.h"

namespace padder {

// How far balls can stand out of the body. With D as the distance of the centre to the surface, a ball stands
// out by at most radius - D if its centre is inside, and by at most radius + D if it is outside. The bound is
// negative for a ball that stays below the surface.
struct ProtrusionBound {
  double max = -std::numeric_limits<double>::infinity();  // over all balls
  bool proved = false;  // false for an open surface: it has no inside, so `max` is only an estimate
  // The number of balls whose centre lies outside the body. There are none in a sound cluster: either the
  // surface faces inward there, or the ball was made for another body.
  std::size_t outside = 0;
};

// Inside is where the winding number of the surface is above 0. This function checks itself whether the
// surface is closed, and trusts nothing else: it may intersect itself, overlap and be turned inside out. On
// an open surface, inside is below its normals. Costs a nearest-point query and a ray for each ball; runs on
// all threads.
ProtrusionBound protrusion_bound(const Surface& surface, const std::vector<Ball>& balls);

// Does the certificate count the centre of the ball as inside? So it does for any ball on an open surface.
bool has_centre_inside(const Surface& surface, const Ball& ball);

// A part of a triangle with what is known of the gap on it.
struct GapPart : TrianglePart {
  Point point = Point::Zero();  // of those looked at, the point with the largest signed gap
  double value = 0;             // that gap
  double bound = 0;             // proved: no point of the part has a larger gap
};

// The largest distance of a surface point to the union, between two bounds.
struct GapBound {
  double upper = 0;  // proved: no point lies farther out; the floor when all lies so far inside the union
  double lower = 0;  // attained at `point`, where it is above 0 and the floor
  Point point = Point::Zero();
};

// Branch and bound. The signed gap to one ball is a convex function, so its largest value over a part of a
// triangle is at a corner. The ball nearest to the centroid thus gives a bound for the part. Parts are
// bisected until upper <= floor or, where lower is above the floor, upper <= 1.001 * lower. `floor` says up
// to which size gaps need not be told apart: a tolerance, or 0 for the true maximum; one below 0 asks how
// deep inside the union the surface lies, up to so much. Always upper >= lower. An empty union has an
// infinite gap. Runs on all threads; the result does not depend on their number.
GapBound gap_bound(const Mesh& mesh, const BallSet& balls, double floor = 0);

// Returns the parts of the surface for which the proof that they lie within `bound` failed. An empty answer
// is the proof for the whole surface. A part is bisected as long as it is larger than `grain`, and below that
// as long as no point of it is known that fails, down to a size where only rounding is left. The order is
// that of the triangles, for any number of threads.
std::vector<GapPart> gap_failures(const Mesh& mesh, const BallSet& balls, double bound, double grain);

// The same for parts, as those that failed before: where balls are only added, what is proved stays proved.
// Gives up when more than `most` parts fail, and returns nothing then.
std::optional<std::vector<GapPart>> gap_failures(const std::vector<GapPart>& parts, const BallSet& balls,
                                                 double bound, double grain, std::size_t most);

// One part for each triangle.
std::vector<GapPart> whole_triangles(const Mesh& mesh);

}  // namespace padder
