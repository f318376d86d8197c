// SPDX-License-Identifier: GPL-3.0-or-later
// Converts between our flat arrays and CGAL's surface mesh. Only for sources that use CGAL: it takes seconds
// to compile.
#pragma once
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Surface_mesh.h>

#include <vector>

#include "padding/asset/mesh.h"

namespace padder {

using CgalKernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using CgalPoint = CgalKernel::Point_3;
using CgalMesh = CGAL::Surface_mesh<CgalPoint>;

inline CgalPoint to_cgal(const Point& p) { return {p.x(), p.y(), p.z()}; }
inline Point from_cgal(const CgalPoint& p) { return {p.x(), p.y(), p.z()}; }

// The mesh must be manifold and oriented.
inline CgalMesh to_cgal(const Mesh& mesh) {
  CgalMesh out;
  for (const Point& p : mesh.points) out.add_vertex(to_cgal(p));
  for (const auto& t : mesh.triangles)
    out.add_face(CgalMesh::Vertex_index(t[0]), CgalMesh::Vertex_index(t[1]), CgalMesh::Vertex_index(t[2]));
  return out;
}

// Triangles only; vertices that no face uses are left out.
inline Mesh from_cgal(const CgalMesh& mesh) {
  Mesh out;
  for (std::uint32_t v = 0; v < mesh.num_vertices(); v++)
    out.points.push_back(from_cgal(mesh.point(CgalMesh::Vertex_index(v))));
  for (const auto f : mesh.faces()) {
    auto& t = out.triangles.emplace_back();
    int k = 0;
    for (const auto v : mesh.vertices_around_face(mesh.halfedge(f))) t[k++] = v;
  }
  out.drop_unused_points();
  return out;
}

}  // namespace padder
