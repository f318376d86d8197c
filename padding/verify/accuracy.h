// SPDX-License-Identifier: MIT
// Measuring a cluster against the mesh it was made from: protrusion, gap, normals, coverage, volume.
#pragma once
#include <cstdint>
#include <vector>

#include "padding/asset/cluster.h"
#include "padding/geometry/balls.h"
#include "padding/geometry/surface.h"
#include "padding/meshing/repair.h"

namespace padder {

// How closely to look.
struct AccuracyOptions {
  std::int64_t surface_samples = 100000;  // points on the input mesh, at least one a triangle
  std::int64_t ball_samples = 300000;     // points on the spheres, shared among them, at least 48 each
  double floor = 0;                       // gaps up to here need not be told apart in the bound
};

// What measure() gives.
struct Measured {
  Accuracy accuracy;        // certified is left false: what was asked for is not known here
  double volume_union = 0;  // of the balls, overlaps counted once
  double buried = 0;  // share of the input's surface that lies inside the body, out of reach from outside
  std::size_t outside = 0;  // balls whose centre lies outside the body (ProtrusionBound)
};

// Lengths in the mesh's unit, all against `input`, the mesh as it was read; `body`, what repair made of it,
// only says which side is inside. `body_surface` is the Surface of body.mesh with the sides of body.side().
// The words, cuRobo's where it has them:
//
// * protrusion: over the outer surface of the union, where it stands outside the body: distance to the input
//   mesh;
// * gap: over the surface of the input mesh: distance to the union, 0 for what is covered;
// * coverage: share of the input's surface inside the union;
// * normal error: over the outer surface of the union: angle between its outward normal and that of the mesh
//   at the nearest point;
// * volume ratio: volume of the union over the body's. A shell of spheres around a thick part leaves its
//   middle empty: below 1.
//
// Means and 95th percentiles are weighted by area, from points spread evenly (area-stratified on triangles,
// spirals of equal area on spheres), no random numbers. The maxima are upper bounds where the body is the
// input's own surface, with patches or without (padding/verify/certify.h), and the largest of the samples,
// each sphere's outermost point among them, for a wrap; of a sheet only the gap is a bound. `proved_against`
// says which of these it was: the proof looks at the surface itself, not at what `body` says of it. For a
// wrap, input surface farther than twice its offset from the wrap cannot be touched from outside and is left
// out
// (`buried`). Works on any balls, however they were made. Same result for any number of threads.
Measured measure(const Mesh& input, const Repaired& body, const Surface& body_surface,
                 const std::vector<Ball>& balls, const AccuracyOptions& options = {});

}  // namespace padder
