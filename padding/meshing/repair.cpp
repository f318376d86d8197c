// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/meshing/repair.h"

#include <CGAL/Polygon_mesh_processing/border.h>
#include <CGAL/Polygon_mesh_processing/measure.h>
#include <CGAL/Polygon_mesh_processing/orient_polygon_soup.h>
#include <CGAL/Polygon_mesh_processing/orientation.h>
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Polygon_mesh_processing/repair_degeneracies.h>
#include <CGAL/Polygon_mesh_processing/repair_polygon_soup.h>
#include <CGAL/Polygon_mesh_processing/self_intersections.h>
#include <CGAL/Polygon_mesh_processing/stitch_borders.h>
#include <CGAL/Polygon_mesh_processing/triangulate_hole.h>

#include <Eigen/Geometry>
#include <algorithm>

#include "padding/asset/error.h"
#include "padding/meshing/cgal_mesh.h"
#include "padding/meshing/wrap.h"

namespace padder {
namespace {

namespace pmp = CGAL::Polygon_mesh_processing;

std::string count_of(std::size_t n, const std::string& one) {
  return std::to_string(n) + " " + one + (n == 1 ? "" : "s");
}

// Drops triangles without area. They carry no surface, and three points on a line would spoil the normals
// nearby.
Soup soup_with_area(const Mesh& mesh, Mesh& flat) {
  Soup soup;
  const double tiny = 1e-14 * std::pow(mesh.bounds().diagonal(), 2);
  for (const Point& p : mesh.points) soup.points.push_back(to_cgal(p));
  for (std::size_t t = 0; t < mesh.triangles.size(); t++) {
    const auto& c = mesh.triangles[t];
    if (mesh.area_normal(t).norm() > tiny)
      soup.triangles.push_back({c[0], c[1], c[2]});
    else
      flat.triangles.push_back(c);
  }
  if (!flat.triangles.empty()) flat.points = mesh.points;
  return soup;
}

std::size_t border_edges(const CgalMesh& mesh) {
  std::size_t n = 0;
  for (const auto e : mesh.edges()) n += mesh.is_border(e);
  return n;
}

struct Patches {
  std::size_t holes = 0;
  double area = 0;
};

Patches close_small_holes(CgalMesh& mesh, double longest_rim) {
  std::vector<CgalMesh::Halfedge_index> cycles;
  pmp::extract_boundary_cycles(mesh, std::back_inserter(cycles));
  Patches closed;
  for (const auto h : cycles) {
    double rim = 0;
    std::size_t edges = 0;
    for (const auto g : CGAL::halfedges_around_face(h, mesh)) {
      rim += std::sqrt(CGAL::squared_distance(mesh.point(mesh.source(g)), mesh.point(mesh.target(g))));
      edges++;
    }
    if (rim > longest_rim || edges > 500) continue;  // filling takes time cubic in the number of edges
    std::vector<CgalMesh::Face_index> patch;
    pmp::triangulate_hole(mesh, h, std::back_inserter(patch));
    closed.holes += !patch.empty();
    closed.area += pmp::area(patch, mesh);
  }
  return closed;
}

// Is it a terrain, nearly all of it seen from one side? A box without its lid is not: its normals cancel.
bool looks_like_sheet(const Mesh& mesh) {
  Vector sum = Vector::Zero();
  for (std::size_t t = 0; t < mesh.triangles.size(); t++) sum += mesh.area_normal(t);
  const double area = mesh.area();
  if (sum.norm() < 0.5 * area) return false;
  const Vector up = sum.normalized();
  double facing = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); t++) {
    const Vector a = mesh.area_normal(t);
    if (a.dot(up) > 0) facing += a.norm();
  }
  return facing > 0.999 * area;
}

Repaired as_given(Soup soup, const std::string& name) {
  pmp::merge_duplicate_points_in_polygon_soup(soup.points, soup.triangles);
  if (!pmp::is_polygon_soup_a_polygon_mesh(soup.triangles))
    throw Error(
        name +
        ": not a manifold, oriented mesh, so it cannot be padded without repair: leave out --repair never");
  CgalMesh mesh;
  pmp::polygon_soup_to_polygon_mesh(soup.points, soup.triangles, mesh);
  Repaired out;
  out.kind = CGAL::is_closed(mesh) ? BodyKind::solid : BodyKind::sheet;
  out.report = out.kind == BodyKind::solid ? "none (as given)"
                                           : "none (as given: an open sheet, padded below its normals)";
  out.mesh = from_cgal(mesh);
  return out;
}

// `soup` holds the triangles of the input that have an area.
Repaired repaired(Soup soup, const Mesh& input, const RepairOptions& options, const std::string& name) {
  if (soup.triangles.empty()) throw Error(name + ": no triangle has an area, so there is no surface to pad");
  const double diagonal = input.bounds().diagonal();
  if (options.mode == RepairMode::never) return as_given(std::move(soup), name);

  RepairReport report;
  if (const std::size_t flat = input.triangles.size() - soup.triangles.size())
    report.add("dropped " + count_of(flat, "triangle") + " without area");
  const std::size_t before = soup.triangles.size();
  pmp::repair_polygon_soup(soup.points, soup.triangles);
  if (soup.triangles.size() < before)
    report.add("dropped " + count_of(before - soup.triangles.size(), "duplicate triangle"));
  if (soup.triangles.empty()) throw Error(name + ": no triangle has an area, so there is no surface to pad");
  const Soup clean = soup;
  if (options.mode == RepairMode::wrap) return wrap(clean, options, diagonal, report, "as asked");

  if (!pmp::is_polygon_soup_a_polygon_mesh(soup.triangles))
    report.add(pmp::orient_polygon_soup(soup.points, soup.triangles) ? "oriented the triangles alike"
                                                                     : "split non-manifold edges");
  CgalMesh mesh;
  pmp::polygon_soup_to_polygon_mesh(soup.points, soup.triangles, mesh);
  pmp::stitch_borders(mesh);
  const Patches patches = close_small_holes(mesh, options.hole_size * diagonal);
  if (patches.holes > 0) report.add("closed " + count_of(patches.holes, "small hole"));

  // CGAL's exact predicates find self-intersections. They throw for degenerate faces, so these go first.
  bool degenerate = false;
  for (const auto f : mesh.faces()) degenerate |= pmp::is_degenerate_triangle_face(f, mesh);
  if (degenerate) degenerate = !pmp::remove_degenerate_faces(mesh);
  const std::size_t border = border_edges(mesh);
  const bool intersects = degenerate || pmp::does_self_intersect(mesh);

  if (border > 0) {
    const Mesh open = from_cgal(mesh);
    if (!intersects && looks_like_sheet(open)) {
      Repaired out;
      out.kind = BodyKind::sheet, out.mesh = open;
      report.add("an open sheet (" + count_of(border, "border edge") + "), padded below its normals");
      out.report = report.text();
      return out;
    }
    // With most edges open these are loose faces, and a wrap covers both sides of each. At the usual alpha
    // that takes a minute, so take a larger one.
    RepairOptions coarser = options;
    if (2 * border > mesh.number_of_edges() && options.alpha == 0) coarser.alpha = diagonal / 100;
    return wrap(clean, coarser, diagonal, report, "open: " + count_of(border, "border edge"));
  }
  if (intersects) return wrap(clean, options, diagonal, report, "self-intersecting");
  // Nested shells become cavities. Parts that lie apart all face outward.
  if (pmp::volume(mesh) < 0) report.add("turned inside out");
  pmp::orient_to_bound_a_volume(mesh);
  if (!(pmp::volume(mesh) > 1e-12 * std::pow(diagonal, 3)))
    return wrap(clean, options, diagonal, report, "without volume");
  Repaired out;
  out.mesh = from_cgal(mesh), out.report = report.text(), out.checked = true;
  out.filled = patches.holes, out.filled_area = patches.area;
  return out;
}

}  // namespace

Repaired repair(const Mesh& input, const RepairOptions& options, const std::string& name) {
  Mesh flat;
  Soup soup = soup_with_area(input, flat);
  Repaired out = repaired(std::move(soup), input, options, name);
  out.flat = std::move(flat);
  return out;
}

}  // namespace padder
