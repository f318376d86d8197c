// SPDX-License-Identifier: MIT
// The whole library padder::cover in one call: a closed mesh and a tolerance in, the fewest spheres that keep
// the tolerance out, with a proof that they do. It needs Eigen and nothing of CGAL or assimp. For mesh files
// that need repair, for open surfaces, counts and levels of detail see pad() in padding/pad.h.
#pragma once
#include <optional>
#include <string>

#include "padding/asset/cluster.h"
#include "padding/geometry/length.h"

namespace padder {

// All of it may be left out.
struct CoverMeshOptions {
  std::string name = "mesh";      // the part's name, in the cluster and in error messages
  std::string unit;               // "m", "cm", "mm", "in", or "": unknown; only stored in the cluster
  Length min_radius, max_radius;  // not given: no limit
  // Each error by itself; what is not given is the tolerance, which may be left out (Length()) where both
  // are. A gap of Length::of(0) covers the body and not only its surface; a protrusion of 0 leaves all
  // spheres inside it.
  std::optional<Length> protrusion, gap;
  int effort = 1;  // 0 to 3: a longer search finds fewer spheres, up to about 10 % each step
};

// What the mesh must be:
// * closed: triangles share vertices by their indices, and along every edge their directions cancel. Every
//   closed, oriented manifold is. The mesh may consist of several parts, and it may intersect itself.
// * oriented: counter-clockwise seen from outside. Inside is where the winding number is above 0.
// * of any size, at any place, in any unit.
//
// What the cluster holds, in the mesh's own frame and unit:
// * the spheres, and for each the triangle of the mesh that it was grown from;
// * the mass properties of the body at density 1;
// * the accuracy. accuracy.certified says that this is proved: no sphere stands out of the body by more than
//   the tolerance (protrusion_max), and no point of the surface lies outside the union of the spheres by more
//   (gap_max); with a gap of 0, no point of the body does. It is false only if a radius limit left some of
//   the surface open, if a part of the mesh faces inward, or if, with a protrusion of 0, no sphere inside the
//   body comes near enough, as where two of its sides lie on each other. docs/tolerance.md has the proofs.
//
// The same mesh and options give the same cluster bit for bit, for any number of threads.
//
// Throws Error, which begins with options.name, for a mesh without triangles or without volume, an index out
// of range, a point that is not finite, an open or inside-out mesh, a tolerance, radius or effort out of
// range. Throws Error, too, for a tolerance so small that the surface would have to be cut into more than 20
// million parts.
//
// Cost: time grows with the number of spheres and runs on all threads. Half the tolerance takes two to four
// times as many spheres. Memory stays below about 2 GB.
Cluster cover_mesh(const Mesh& mesh, const Length& tolerance, const CoverMeshOptions& options = {});

}  // namespace padder
