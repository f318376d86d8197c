// SPDX-License-Identifier: MIT
// Measures a cluster against the mesh it was made from: protrusion, gap, normals, coverage, volume.
#pragma once
#include <cstdint>
#include <vector>

#include "padding/asset/cluster.h"
#include "padding/geometry/balls.h"
#include "padding/geometry/repaired.h"
#include "padding/geometry/surface.h"

namespace padder {

// How closely to look.
struct AccuracyOptions {
  std::int64_t surface_samples = 20000;  // points on the input mesh
  // Points on the spheres: as many in all, and as many on each besides.
  std::int64_t ball_samples = 20000, samples_of_each_ball = 100;
  double floor = 0;  // gaps up to this size need not be told apart (gap_bound)
  // Where the mesh stands for a larger body: no point of the body's surface is farther from that of the mesh.
  // gap_bound has it added.
  double chord_error = 0;
};

// What measure() gives.
struct Measured {
  Accuracy accuracy;        // but for `certified`: what was asked for is not known here
  double volume_union = 0;  // of the balls, overlaps counted once
  double flat_gap = 0;      // the part of gap_bound that triangles without area have
  std::size_t outside = 0;  // the number of balls whose centre lies outside the body (ProtrusionBound)
};

// All lengths are in the mesh's unit and measured against `input`, the mesh as it was read. `body` is what
// repair made of it and says which side is inside. `body_surface` is the Surface that the balls were made on:
// of body.mesh with the sides of body.side(), and for a wrap the input with the wrap as its hull. The terms
// are cuRobo's where it has them:
//
// * protrusion: distance to the input mesh, over the outer surface of the union where it lies outside the
//   body;
// * gap: distance to the union, over the surface of the input mesh; 0 where it is covered;
// * coverage: share of the input's surface inside the union. Of a solid that repair made, it and the mean gap
//   are over the boundary of the body: with the patches over its holes, without what is buried in it;
// * normal error: angle between the outward normal of the union and that of the mesh at the nearest point,
//   over the outer surface of the union;
// * volume ratio: volume of the union over the body's. It is below 1 for a shell of spheres around a thick
//   part, whose middle stays empty.
//
// Means and 95th percentiles are weighted by area. Their points are spread evenly (a sequence of low
// discrepancy on the triangles, spirals of equal area on the spheres), without random numbers. With the
// default numbers of points, means are within 0.5 % and percentiles within 1 % of the largest value, angles
// within 1 degree, the coverage within 0.01 and the volume ratio within 2 % of what many times as many
// points give (docs/padding.md). A ball that alone stands out in a spot may be missed, but never in a bound.
//
// The maxima are proved upper bounds (padding/verify/certify.h) for every closed body. For a wrap, what it
// encloses counts as body, and the protrusion is at least what the wrap itself stands off. For a sheet only
// the gap is a bound. `proved_against` says which it was, found from the surface itself and not from `body`.
//
// Works on any balls, however they were made. The result does not depend on the number of threads.
Measured measure(const Mesh& input, const Repaired& body, const Surface& body_surface,
                 const std::vector<Ball>& balls, const AccuracyOptions& options = {});

}  // namespace padder
