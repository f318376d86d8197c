// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/meshing/cells/outer_cells.h"

#include <CGAL/Constrained_Delaunay_triangulation_2.h>
#include <CGAL/Triangulation_face_base_with_info_2.h>
#include <CGAL/Triangulation_vertex_base_with_info_2.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <set>

#include "padding/geometry/indices.h"
#include "padding/meshing/cgal_mesh.h"

namespace padder {
namespace {

struct VertexInfo {
  std::uint32_t index = ~0u;
};
struct FaceInfo {
  int region = -1;
};
using VertexBase = CGAL::Triangulation_vertex_base_with_info_2<VertexInfo, CgalKernel>;
using FaceBase =
    CGAL::Triangulation_face_base_with_info_2<FaceInfo, CgalKernel,
                                              CGAL::Constrained_triangulation_face_base_2<CgalKernel>>;
using Triangulation = CGAL::Constrained_Delaunay_triangulation_2<
    CgalKernel, CGAL::Triangulation_data_structure_2<VertexBase, FaceBase>, CGAL::Exact_predicates_tag>;
using Flat = Triangulation::Point;

class TriangleCutter {
 public:
  TriangleCutter(const Mesh& mesh, std::uint32_t t, const std::vector<Point>& points, double near)
      : corners_(mesh.triangles[t]),
        points_(points),
        origin_(mesh.corner(t, 0)),
        normal_(mesh.area_normal(t)),
        near_(near) {
    normal_.cwiseAbs().maxCoeff(&drop_);
    u_ = (drop_ + 1) % 3, v_ = (drop_ + 2) % 3;
    if (normal_[drop_] < 0) std::swap(u_, v_);
  }

  TrianglePieces run(const std::array<std::vector<std::uint32_t>, 3>& rim, std::span<const TriangleCut> cuts,
                     std::size_t limit) {
    std::vector<std::uint32_t> round;
    for (int k = 0; k < 3; k++) {
      out_.rim_of[k] = static_cast<std::uint32_t>(round.size());
      round.push_back(corners_[k]);
      round.insert(round.end(), rim[k].begin(), rim[k].end());
    }
    std::vector<Triangulation::Vertex_handle> handles;
    for (const auto v : round) handles.push_back(insert(v));
    for (std::size_t k = 0; k < round.size(); k++) constrain(handles[k], handles[(k + 1) % round.size()]);
    std::vector<std::uint32_t> all = round;
    for (const TriangleCut& cut : cuts)
      for (const auto v : cut.point) insert(v), all.push_back(v);
    sort_unique(all);
    std::set<std::array<std::uint32_t, 2>> done;
    for (const TriangleCut& cut : cuts) {
      if (on_one_edge(cut) || cut.point[0] == cut.point[1]) continue;
      const std::vector<std::uint32_t> way = way_of(cut, all);
      for (std::size_t k = 0; k + 1 < way.size(); k++)
        if (done.insert({std::min(way[k], way[k + 1]), std::max(way[k], way[k + 1])}).second)
          constrain(insert(way[k]), insert(way[k + 1]));
      if (triangulation_.number_of_vertices() > all.size() &&
          triangulation_.number_of_vertices() - all.size() > limit) {
        out_.too_many = true;
        return std::move(out_);
      }
    }
    collect();
    for (std::size_t k = 0; k < round.size(); k++)
      out_.rim.push_back(region_beside(handles[k], handles[(k + 1) % round.size()]));
    return std::move(out_);
  }

 private:
  static bool on_one_edge(const TriangleCut& cut) {
    return cut.runs_along(0) || cut.runs_along(1) || cut.runs_along(2);
  }

  // The region to the left of the edge from a to b.
  std::uint32_t region_beside(Triangulation::Vertex_handle a, Triangulation::Vertex_handle b) const {
    Triangulation::Face_handle f;
    int k;
    if (a == b || !triangulation_.is_edge(a, b, f, k)) return TrianglePieces::kNone;
    if (f->vertex(Triangulation::ccw(k)) != a) f = f->neighbor(k);
    const int region = f->info().region;
    return region < 0 ? TrianglePieces::kNone : static_cast<std::uint32_t>(region);
  }

  // The points that the cut runs through, from one end to the other. Cuts on one line, which rounding has
  // moved a little apart, then have the same parts; where these would cross, the place would mean nothing.
  std::vector<std::uint32_t> way_of(const TriangleCut& cut, const std::vector<std::uint32_t>& all) const {
    const Point &a = points_[cut.point[0]], &b = points_[cut.point[1]];
    const Vector along = b - a;
    std::vector<std::pair<double, std::uint32_t>> on = {{0, cut.point[0]}, {1, cut.point[1]}};
    for (const auto v : all) {
      if (v == cut.point[0] || v == cut.point[1]) continue;
      const double at = along.dot(points_[v] - a) / along.squaredNorm();
      if (at > 0 && at < 1 && (points_[v] - a - at * along).squaredNorm() <= near_ * near_)
        on.push_back({at, v});
    }
    std::sort(on.begin(), on.end());
    std::vector<std::uint32_t> way;
    for (const auto& [at, v] : on) way.push_back(v);
    return way;
  }

  Triangulation::Vertex_handle insert(std::uint32_t v) {
    const auto handle = triangulation_.insert(Flat(points_[v][u_], points_[v][v_]));
    // Of points that round to the same place the first gives its name.
    if (handle->info().index == ~0u) handle->info().index = v;
    return handle;
  }

  void constrain(Triangulation::Vertex_handle a, Triangulation::Vertex_handle b) {
    if (a != b) triangulation_.insert_constraint(a, b);
  }

  Point lift(const Flat& p) const {
    Point out;
    out[u_] = p.x(), out[v_] = p.y();
    out[drop_] = origin_[drop_] -
                 (normal_[u_] * (p.x() - origin_[u_]) + normal_[v_] * (p.y() - origin_[v_])) / normal_[drop_];
    return out;
  }

  // Is it a part of the surface, and no sliver between an edge and a rounded point on it?
  bool real(Triangulation::Face_handle f) const {
    if (triangulation_.is_infinite(f)) return false;
    Point corner[3];
    for (int k = 0; k < 3; k++) corner[k] = lift(f->vertex(k)->point());
    double longest = 0;
    for (int k = 0; k < 3; k++) longest = std::max(longest, (corner[(k + 1) % 3] - corner[k]).norm());
    return (corner[1] - corner[0]).cross(corner[2] - corner[0]).norm() > near_ * longest;
  }

  std::uint32_t name(Triangulation::Vertex_handle v) {
    if (v->info().index == ~0u) {
      v->info().index = TrianglePieces::kFresh | static_cast<std::uint32_t>(out_.fresh.size());
      out_.fresh.push_back(lift(v->point()));
    }
    return v->info().index;
  }

  void collect() {
    std::vector<Triangulation::Face_handle> stack;
    for (auto f = triangulation_.finite_faces_begin(); f != triangulation_.finite_faces_end(); ++f) {
      if (f->info().region >= 0 || !real(f)) continue;
      const int region = static_cast<int>(out_.places.size());
      Point place = Point::Zero();
      double best = -1;
      stack.push_back(f), f->info().region = region;
      while (!stack.empty()) {
        const auto g = stack.back();
        stack.pop_back();
        out_.faces.push_back({name(g->vertex(0)), name(g->vertex(1)), name(g->vertex(2))});
        out_.region.push_back(static_cast<std::uint32_t>(region));
        const Point a = lift(g->vertex(0)->point()), b = lift(g->vertex(1)->point()),
                    c = lift(g->vertex(2)->point());
        // The point should be far from the rim of the region: the face with the largest inscribed circle.
        const double inner = (b - a).cross(c - a).norm() / ((b - a).norm() + (c - b).norm() + (a - c).norm());
        if (inner > best) best = inner, place = (a + b + c) / 3;
        for (int k = 0; k < 3; k++) {
          const auto next = g->neighbor(k);
          if (g->is_constrained(k) || next->info().region >= 0 || !real(next)) continue;
          next->info().region = region, stack.push_back(next);
        }
      }
      out_.places.push_back(place), out_.room.push_back(best);
    }
  }

  const std::array<std::uint32_t, 3>& corners_;
  const std::vector<Point>& points_;
  const Point origin_;
  const Vector normal_;
  const double near_;
  Eigen::Index drop_ = 0, u_ = 0, v_ = 0;
  Triangulation triangulation_;
  TrianglePieces out_;
};

}  // namespace

TrianglePieces cut_triangle(const Mesh& mesh, std::uint32_t t, const std::vector<Point>& points,
                            const std::array<std::vector<std::uint32_t>, 3>& rim,
                            std::span<const TriangleCut> cuts, double near, std::size_t limit) {
  return TriangleCutter(mesh, t, points, near).run(rim, cuts, limit);
}

}  // namespace padder
