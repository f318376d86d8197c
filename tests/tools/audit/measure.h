// SPDX-License-Identifier: GPL-3.0-or-later
// Measures a cluster against its mesh once more, by other means than padding/verify. Random points and no
// branch and bound, CGAL's AABB tree instead of our hierarchy, solid angles and rays instead of signed
// crossings, all balls instead of a tree of them. It knows nothing of what repair did.
//
// * The gap is that of points spread over the triangles by their area, and of all corners and points of
//   edges.
// * The protrusion is that of points on the spheres that no other sphere covers, and of each sphere's points
//   on both sides of its centre along the way to the nearest triangle.
//
// A point is in the open if the winding number of the raw triangles is below 1/2 there (Jacobson, Kavan,
// Sorkine-Hornung, 2013: it also serves for open meshes) and a ray from it meets no triangle: pieces may be
// turned inside out, and nothing touches what is sealed. Only points in the open are judged. A point of the
// surface is judged if either side of it is in the open.
//
// SURFACE is for a mesh whose holes were filled: what `pad --tolerance 1% --write-mesh` wrote (the surface of
// a depth ratio is remeshed: it cuts corners, and points inside the body seem open). Its triangles off the
// input are patches. They bound the body, too: distances are to the nearer of input and patch, and winding
// numbers are those of SURFACE. The area of those farther off than 1e-4 of the diagonal (nearer ones close
// cracks) is printed, so that it can be compared with what the report names.
#pragma once
#include "padding/asset/cluster.h"
#include "padding/asset/mesh.h"

namespace padder::audit {

// Lengths, areas and volumes are in the mesh's unit.
struct Measured {
  double protrusion = 0, gap = 0;                    // of points in the open
  double gap_anywhere = 0;                           // of all points, those that nothing touches as well
  double patch_area = 0;                             // of what `surface` adds to the mesh
  bool protrusion_holds = false, gap_holds = false;  // are these within what the cluster reports?

  bool holds() const { return protrusion_holds && gap_holds; }
};

// `surface` may be null. Its corners may lie up to `moved` off those of the mesh: triangles no farther off do
// not count in patch_area. Takes time that grows with the points, the triangles and the spheres.
Measured measure(const Mesh& mesh, const Mesh* surface, const Cluster& cluster, int points, unsigned seed,
                 double moved = 0);

// Of the raw triangles' inside, at density 1; by 1,048,576 lines, and by 16,384 where the mesh is open: there
// the volume has about half a percent of noise.
struct MassInside {
  double volume = 0;
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();  // about the centre of mass
};
MassInside mass_inside(const Mesh& mesh, unsigned seed);

}  // namespace padder::audit
