// SPDX-License-Identifier: GPL-3.0-or-later
// Isotropic remeshing to a Delaunay surface: the "meshing" step of section 2.3 of the paper.
#pragma once
#include <cstdint>

#include "padding/asset/mesh.h"

namespace padder {

// The triangles wanted.
struct RemeshOptions {
  double edge_length = 0;   // aimed at, in the mesh's unit; above 0
  double sharp_angle = 40;  // edges whose faces' normals differ by more are kept; degrees; 180 keeps none
  // Edges and triangles' heights under this share of the edge length are taken out (geometry/slivers.h)
  // before and after. For surfaces that were cut where they cross; 0: none.
  double slivers = 0;
};

// What remeshing reached. Shares are 0 to 1.
struct RemeshQuality {
  double min_angle_deg = 0;
  double share_under_20_deg = 0;  // triangles with an angle under 20 degrees
  double angles_under_20_deg = 0;
  // Those of them that no feature holds. A feature holds a triangle whose shortest edge joins two sharp
  // lines, or two ends of lines. If an angle is above 120 degrees, all three corners must lie on sharp lines.
  double free_angles_under_20_deg = 0;
  double share_non_delaunay = 0;  // of the edges neither sharp nor border: opposite angles sum to over 180
  double circumradius_max = 0;    // the sliver guard holds it under edge_length where the shape allows
  std::uint64_t sharp_edges = 0;  // kept
};

// The new surface, and how good its triangles are.
struct Remeshed {
  Mesh mesh;
  RemeshQuality quality;
};

// Runs CGAL's isotropic remeshing (Botsch and Kobbelt, A remeshing approach to multiresolution modeling,
// 2004) with sharp edges constrained, and once more around rows of long edges that it leaves beside each
// other. Then flips edges until the surface is Delaunay, collapses short edges of triangles with an angle
// under 20 degrees where no sharp line moves by more than a tenth of the edge length, and splits slivers: an
// obtuse triangle whose circumradius is larger than the edge length has its longest edge split at the foot of
// its height. So no triangle gets a sphere far larger than the others. New vertices lie on the input's
// surface, and where rows were broken on that of the first remesh.
//
// The mesh must be oriented. It may have a border, which is kept; where bodies touch in an edge or a point
// they are taken apart. Deterministic. Throws Error when edge_length is not positive or would make more than
// 2^31 triangles. Takes about 20 s for a million triangles in or out.
Remeshed remesh(const Mesh& mesh, const RemeshOptions& options);

// About how many triangles with edges of this length cover as much area. Throws Error as remesh() does.
std::uint64_t expected_triangles(const Mesh& mesh, double edge_length);

RemeshQuality measure_quality(const Mesh& mesh, double sharp_angle);

}  // namespace padder
