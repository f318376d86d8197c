// SPDX-License-Identifier: GPL-3.0-or-later
// Flat regions of a boolean's result, cut anew without the traces of the operands.
#include <CGAL/Constrained_Delaunay_triangulation_2.h>
#include <CGAL/Constrained_triangulation_face_base_2.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/orient_polygon_soup.h>
#include <CGAL/Polygon_mesh_processing/orientation.h>
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Polygon_mesh_processing/self_intersections.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/Triangulation_face_base_with_info_2.h>
#include <CGAL/Triangulation_vertex_base_with_info_2.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <map>
#include <numeric>

#include "assets/solid.h"
#include "padding/asset/error.h"

namespace padder::assets {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Vertices = CGAL::Triangulation_vertex_base_with_info_2<std::uint32_t, Kernel>;
using Faces =
    CGAL::Constrained_triangulation_face_base_2<Kernel,
                                                CGAL::Triangulation_face_base_with_info_2<int, Kernel>>;
using Delaunay =
    CGAL::Constrained_Delaunay_triangulation_2<Kernel, CGAL::Triangulation_data_structure_2<Vertices, Faces>,
                                               CGAL::No_constraint_intersection_tag>;
using Edge = std::pair<std::uint32_t, std::uint32_t>;

constexpr std::uint32_t kNone = 0xffffffff;

struct Plane {
  Vector normal;
  Point on;
  double distance(const Point& p) const { return std::abs(normal.dot(p - on)); }
};

class FlatRegions {
 public:
  FlatRegions(const Mesh& mesh, double tolerance) : mesh_(mesh), tolerance_(tolerance) {
    for (std::uint32_t f = 0; f < mesh.triangles.size(); f++)
      for (std::size_t k = 0; k < 3; k++) face_[{mesh.triangles[f][k], mesh.triangles[f][(k + 1) % 3]}] = f;
  }

  Mesh run() {
    find_patches();
    find_borders();
    Mesh out;
    out.points = mesh_.points;
    for (std::uint32_t p = 0; p < planes_.size(); p++) fill(p, out);
    return out;
  }

 private:
  // Connected faces in one plane, grown from the largest face that is left: its normal is the best known.
  void find_patches() {
    const std::size_t n = mesh_.triangles.size();
    std::vector<std::uint32_t> order(n);
    std::iota(order.begin(), order.end(), 0);
    std::vector<double> areas;
    for (std::size_t f = 0; f < n; f++) areas.push_back(mesh_.area_normal(f).norm());
    std::ranges::stable_sort(order, [&](std::uint32_t a, std::uint32_t b) { return areas[a] > areas[b]; });
    patch_.assign(n, kNone);
    for (const std::uint32_t seed : order) {
      if (patch_[seed] != kNone) continue;
      const Plane plane = {mesh_.area_normal(seed).normalized(), mesh_.corner(seed, 0)};
      const std::uint32_t id = static_cast<std::uint32_t>(planes_.size());
      planes_.push_back(plane);
      std::vector<std::uint32_t> open = {seed};
      patch_[seed] = id;
      while (!open.empty()) {
        const std::uint32_t f = open.back();
        open.pop_back();
        for (std::size_t k = 0; k < 3; k++) {
          const std::uint32_t g = face_.at({mesh_.triangles[f][(k + 1) % 3], mesh_.triangles[f][k]});
          if (patch_[g] != kNone || !in_plane(g, plane)) continue;
          patch_[g] = id;
          open.push_back(g);
        }
      }
    }
  }

  bool in_plane(std::uint32_t f, const Plane& plane) const {
    double longest = 0;
    for (int k = 0; k < 3; k++) {
      if (plane.distance(mesh_.corner(f, k)) > tolerance_) return false;
      longest = std::max(longest, (mesh_.corner(f, k) - mesh_.corner(f, (k + 1) % 3)).norm());
    }
    const Vector area = mesh_.area_normal(f);  // of a sliver it means nothing
    return area.norm() < 2 * tolerance_ * longest || area.dot(plane.normal) > 0.999 * area.norm();
  }

  // The edges between patches, without the vertices at which a straight one was split.
  void find_borders() {
    std::map<std::uint32_t, std::vector<std::uint32_t>> at;  // neighbours along borders
    for (const auto& [edge, f] : face_)
      if (patch_[f] != patch_[face_.at({edge.second, edge.first})]) at[edge.first].push_back(edge.second);
    std::vector<bool> gone(mesh_.points.size(), false);
    const auto straight = [&](std::uint32_t a, const std::vector<std::uint32_t>& between, std::uint32_t b) {
      const Vector along = mesh_.points[b] - mesh_.points[a];
      return std::ranges::all_of(between, [&](std::uint32_t v) {
        const Vector to = mesh_.points[v] - mesh_.points[a];
        const double s = to.dot(along) / along.squaredNorm();
        return s > 0 && s < 1 && (to - s * along).norm() < tolerance_;
      });
    };
    // From every vertex that must stay along each border, as far as one straight edge reaches.
    std::map<Edge, bool> walked;
    const auto corner = [&](std::uint32_t v) {
      return at[v].size() != 2 || !straight(at[v][0], {v}, at[v][1]);
    };
    for (const auto& [start, neighbours] : at) {
      if (!corner(start)) continue;
      for (const std::uint32_t first : neighbours) {
        if (walked[{start, first}]) continue;
        std::uint32_t begin = start, previous = start, v = first;
        std::vector<std::uint32_t> between;
        walked[{start, first}] = true;
        while (!corner(v)) {
          const std::uint32_t next = at[v][0] == previous ? at[v][1] : at[v][0];
          between.push_back(v);
          if (!straight(begin, between, next))
            between.clear(), begin = v;
          else
            gone[v] = true;
          previous = v, v = next;
        }
        walked[{v, previous}] = true;
      }
    }
    for (const auto& [edge, f] : face_) {  // directed: patch f lies to the left
      const std::uint32_t p = patch_[f];
      if (p == patch_[face_.at({edge.second, edge.first})] || gone[edge.first]) continue;
      std::uint32_t previous = edge.first, v = edge.second;
      while (gone[v]) {
        const std::uint32_t next = at[v][0] == previous ? at[v][1] : at[v][0];
        previous = v, v = next;
      }
      borders_[p].push_back({edge.first, v});
    }
  }

  // Constrained Delaunay triangles between the borders of a patch.
  void fill(std::uint32_t p, Mesh& out) {
    Eigen::Index drop;
    planes_[p].normal.cwiseAbs().maxCoeff(&drop);
    const bool flip = planes_[p].normal[drop] < 0;
    const Eigen::Index u = (drop + 1) % 3, v = (drop + 2) % 3;
    Delaunay triangulation;
    std::map<std::uint32_t, Delaunay::Vertex_handle> place;
    const auto insert = [&](std::uint32_t k) {
      auto& handle = place[k];
      if (handle != Delaunay::Vertex_handle()) return handle;
      handle = triangulation.insert({mesh_.points[k][u], mesh_.points[k][v]});
      handle->info() = k;
      return handle;
    };
    try {
      for (const auto& [a, b] : borders_[p]) triangulation.insert_constraint(insert(a), insert(b));
    } catch (const Delaunay::Intersection_of_constraints_exception&) {
      throw Error("two edges of a flat face cross: change a dimension");
    }
    // Inside is what an odd number of borders parts from infinity.
    for (const auto f : triangulation.all_face_handles()) f->info() = -1;
    std::vector<std::pair<Delaunay::Face_handle, int>> open = {{triangulation.infinite_face(), 0}};
    for (std::size_t at = 0; at < open.size(); at++) {
      const auto [f, depth] = open[at];
      if (f->info() != -1) continue;
      std::vector<Delaunay::Face_handle> same = {f};
      while (!same.empty()) {
        const auto g = same.back();
        same.pop_back();
        if (g->info() != -1) continue;
        g->info() = depth;
        for (int k = 0; k < 3; k++) {
          if (g->neighbor(k)->info() != -1) continue;
          if (triangulation.is_constrained({g, k}))
            open.push_back({g->neighbor(k), depth + 1});
          else
            same.push_back(g->neighbor(k));
        }
      }
    }
    for (const auto f : triangulation.finite_face_handles()) {
      if (f->info() % 2 == 0) continue;
      std::array<std::uint32_t, 3> t = {f->vertex(0)->info(), f->vertex(1)->info(), f->vertex(2)->info()};
      if (flip) std::swap(t[1], t[2]);
      out.triangles.push_back(t);
    }
  }

  const Mesh& mesh_;
  double tolerance_;
  std::map<Edge, std::uint32_t> face_;  // to the left of a directed edge
  std::vector<std::uint32_t> patch_;    // of each face
  std::vector<Plane> planes_;           // of each patch
  std::map<std::uint32_t, std::vector<Edge>> borders_;
};

void check_solid(const Mesh& mesh) {
  std::vector<Kernel::Point_3> points;
  std::vector<std::vector<std::size_t>> faces;
  for (const Point& p : mesh.points) points.emplace_back(p.x(), p.y(), p.z());
  for (const auto& t : mesh.triangles) faces.push_back({t[0], t[1], t[2]});
  namespace pmp = CGAL::Polygon_mesh_processing;
  CGAL::Surface_mesh<Kernel::Point_3> surface;
  bool good = pmp::is_polygon_soup_a_polygon_mesh(faces);
  if (good) pmp::polygon_soup_to_polygon_mesh(points, faces, surface);
  if (!good || !CGAL::is_closed(surface) || pmp::does_self_intersect(surface) ||
      !pmp::does_bound_a_volume(surface) || mass_properties(mesh).volume <= 0)
    throw Error("these dimensions do not give a closed solid without self-intersections: change one of them");
}

}  // namespace

namespace {

// Points in order of their coordinates, faces in order of their points: CGAL's order changes from run to run.
Mesh sorted(const Mesh& mesh) {
  std::vector<std::uint32_t> order, place(mesh.points.size(), kNone);
  for (const auto& t : mesh.triangles)
    for (const auto v : t) {
      if (place[v] == kNone) order.push_back(v);
      place[v] = 0;
    }
  std::ranges::sort(order, [&](std::uint32_t a, std::uint32_t b) {
    return std::ranges::lexicographical_compare(mesh.points[a], mesh.points[b]);
  });
  Mesh out;
  for (const auto v : order)
    place[v] = static_cast<std::uint32_t>(out.points.size()), out.points.push_back(mesh.points[v]);
  for (const auto& t : mesh.triangles) {
    std::array<std::uint32_t, 3> u = {place[t[0]], place[t[1]], place[t[2]]};
    std::rotate(u.begin(), std::ranges::min_element(u), u.end());
    out.triangles.push_back(u);
  }
  std::ranges::sort(out.triangles);
  return out;
}

}  // namespace

Mesh finished(const Mesh& mesh, int decimals) {
  const Mesh grid = sorted(rounded(mesh, decimals));
  const Mesh solid = sorted(rounded(FlatRegions(grid, 2 * std::pow(10, -decimals)).run(), decimals));
  check_solid(solid);
  return solid;
}

}  // namespace padder::assets
