// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/meshing/remesh.h"

#include <CGAL/Polygon_mesh_processing/connected_components.h>
#include <CGAL/Polygon_mesh_processing/detect_features.h>
#include <CGAL/Polygon_mesh_processing/orient_polygon_soup.h>
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Polygon_mesh_processing/remesh.h>
#include <CGAL/Polygon_mesh_processing/repair_degeneracies.h>
#include <CGAL/Polygon_mesh_processing/stitch_borders.h>
#include <CGAL/boost/graph/Euler_operations.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <deque>
#include <numbers>

#include "padding/asset/error.h"
#include "padding/geometry/indices.h"
#include "padding/geometry/slivers.h"
#include "padding/geometry/triangle.h"
#include "padding/meshing/cgal_mesh.h"

// CGAL 5.5's tangential relaxation asks for the edge of no halfedge where all faces at a vertex are
// degenerate, and then reads far outside its arrays. Calls on our mesh find this overload, which is no
// template, before CGAL's. Any edge will do: the vertex stays where it is, or moves within its line.
namespace CGAL {
inline SM_Edge_index edge(SM_Halfedge_index h, const padder::CgalMesh& mesh) {
  return mesh.edge(h.is_valid() ? h : SM_Halfedge_index(0));
}
}  // namespace CGAL

namespace padder {
namespace {

namespace pmp = CGAL::Polygon_mesh_processing;
using Vertex = CgalMesh::Vertex_index;
using Halfedge = CgalMesh::Halfedge_index;
using Edge = CgalMesh::Edge_index;
using SharpMap = CgalMesh::Property_map<Edge, bool>;

bool is_manifold(const Mesh& mesh) { return pmp::is_polygon_soup_a_polygon_mesh(mesh.triangles); }

// Bodies that touch along edges or in points are taken apart there.
CgalMesh manifold(const Mesh& input) {
  if (is_manifold(input)) return to_cgal(input);
  const Mesh apart = taken_apart(input);
  if (is_manifold(apart)) return to_cgal(apart);
  std::vector<std::vector<std::size_t>> triangles;
  for (const auto& t : apart.triangles) triangles.push_back({t[0], t[1], t[2]});
  std::vector<CgalPoint> points;
  for (const Point& p : apart.points) points.push_back(to_cgal(p));
  pmp::orient_polygon_soup(points, triangles);
  CgalMesh mesh;
  pmp::polygon_soup_to_polygon_mesh(points, triangles, mesh);
  pmp::stitch_borders(mesh);
  pmp::remove_degenerate_faces(mesh);
  return mesh;
}

SharpMap find_sharp_edges(CgalMesh& mesh, double angle) {
  SharpMap sharp = mesh.add_property_map<Edge, bool>("e:sharp", false).first;
  if (angle < 180) pmp::detect_sharp_edges(mesh, angle, sharp);
  return sharp;
}

using PartMap = CgalMesh::Property_map<CgalMesh::Face_index, std::size_t>;

// The parts between sharp edges. CGAL 5.5's remesher does not know a part all of whose faces are degenerate,
// and ends where it meets one: they go to a part beside it.
PartMap find_parts(CgalMesh& mesh, const SharpMap& sharp) {
  PartMap part = mesh.add_property_map<CgalMesh::Face_index, std::size_t>("f:part", 0).first;
  const std::size_t parts =
      pmp::connected_components(mesh, part, CGAL::parameters::edge_is_constrained_map(sharp));
  std::vector<char> known(parts, 0);
  for (const auto f : mesh.faces())
    if (!known[part[f]] && !pmp::is_degenerate_triangle_face(f, mesh)) known[part[f]] = 1;
  std::deque<Halfedge> open;  // out of faces of known parts into others
  const auto look_around = [&](CgalMesh::Face_index f) {
    for (const Halfedge h : mesh.halfedges_around_face(mesh.halfedge(f))) {
      const Halfedge twin = mesh.opposite(h);
      if (!mesh.is_border(twin) && !known[part[mesh.face(twin)]]) open.push_back(h);
    }
  };
  for (const auto f : mesh.faces())
    if (known[part[f]]) look_around(f);
  for (; !open.empty(); open.pop_front()) {
    const auto f = mesh.face(mesh.opposite(open.front()));
    if (known[part[f]]) continue;
    part[f] = part[mesh.face(open.front())];
    look_around(f);
  }
  return part;
}

Point at(const CgalMesh& mesh, Vertex v) { return from_cgal(mesh.point(v)); }

Triangle3 corners(const CgalMesh& mesh, Halfedge h) {  // the edge of h first
  return {at(mesh, mesh.source(h)), at(mesh, mesh.target(h)), at(mesh, mesh.target(mesh.next(h)))};
}

double length_of(const CgalMesh& mesh, Halfedge h) {
  return (at(mesh, mesh.target(h)) - at(mesh, mesh.source(h))).norm();
}

// The angle that faces h in its face.
double opposite_angle(const CgalMesh& mesh, Halfedge h) { return corners(mesh, h).angle(2); }

bool flippable(const CgalMesh& mesh, const SharpMap& sharp, Edge e) {
  if (mesh.is_border(e) || sharp[e]) return false;
  const Halfedge h = mesh.halfedge(e), g = mesh.opposite(h);
  const Vertex u = mesh.target(mesh.next(h)), v = mesh.target(mesh.next(g));
  return u != v && mesh.halfedge(u, v) == CgalMesh::null_halfedge();
}

// Does flipping h keep the surface from folding? Both new triangles must face the way the old ones do.
bool flip_keeps_shape(const CgalMesh& mesh, Halfedge h) {
  const Triangle3 old_a = corners(mesh, h), old_b = corners(mesh, mesh.opposite(h));
  const Triangle3 new_a{old_a.c, old_a.a, old_b.c}, new_b{old_a.c, old_b.c, old_a.b};
  const Vector before = old_a.area_normal() + old_b.area_normal();
  constexpr double cos_limit = 0.8;
  for (const Triangle3& t : {new_a, new_b}) {
    const Vector n = t.area_normal();
    if (n.dot(before) < cos_limit * n.norm() * before.norm() || n.norm() == 0) return false;
  }
  return true;
}

// Lawson's flips, on a surface in space. On a plane they come to an end. On a curved surface each flip
// changes the geometry, so their number is limited; measure_quality() reports the share of edges that are
// left.
void make_delaunay(CgalMesh& mesh, const SharpMap& sharp) {
  std::deque<Edge> work(mesh.edges().begin(), mesh.edges().end());
  std::size_t budget = 20 * mesh.number_of_edges();
  while (!work.empty() && budget-- > 0) {
    const Edge e = work.front();
    work.pop_front();
    if (mesh.is_removed(e) || !flippable(mesh, sharp, e)) continue;
    const Halfedge h = mesh.halfedge(e), g = mesh.opposite(h);
    if (opposite_angle(mesh, h) + opposite_angle(mesh, g) <= std::numbers::pi + 1e-9) continue;
    if (!flip_keeps_shape(mesh, h)) continue;
    for (const Halfedge k : {mesh.next(h), mesh.prev(h), mesh.next(g), mesh.prev(g)})
      work.push_back(mesh.edge(k));
    CGAL::Euler::flip_edge(h, mesh);
  }
}

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kSmallAngle = 20 * kDegree, kRowAngle = 25 * kDegree, kCapAngle = 120 * kDegree;

double least_angle(const Triangle3& t) { return std::min({t.angle(0), t.angle(1), t.angle(2)}); }

// Takes the start of a halfedge to its end where that makes thin triangles better, and neither moves a sharp
// line by more than a tenth of the length nor turns a face by more than 37 degrees.
class ThinCollapse {
 public:
  ThinCollapse(CgalMesh& mesh, SharpMap& sharp, double length)
      : mesh_(mesh), sharp_(sharp), length_(length) {}

  // The number of edges collapsed.
  std::size_t run() {
    std::size_t done = 0;
    const std::vector<CgalMesh::Face_index> faces(mesh_.faces().begin(), mesh_.faces().end());
    for (const auto f : faces) {
      if (mesh_.is_removed(f)) continue;
      Halfedge shortest = mesh_.halfedge(f);
      if (least_angle(corners(mesh_, shortest)) >= kSmallAngle) continue;
      for (const Halfedge h : mesh_.halfedges_around_face(shortest))
        if (length_of(mesh_, h) < length_of(mesh_, shortest)) shortest = h;
      for (const Halfedge h : {shortest, mesh_.opposite(shortest)})
        if (allowed(h)) {
          collapse(h), done++;
          break;
        }
    }
    if (done > 0) mesh_.collect_garbage();
    return done;
  }

 private:
  bool is_kept(Edge e) const { return sharp_[e] || mesh_.is_border(e); }

  bool allowed(Halfedge h) const {
    const Vertex from = mesh_.source(h), to = mesh_.target(h);
    if (!CGAL::Euler::does_satisfy_link_condition(mesh_.edge(h), mesh_)) return false;
    std::size_t kept = 0;
    Point before = at(mesh_, to);  // the vertex before `from` on a sharp line
    for (const Halfedge g : mesh_.halfedges_around_target(mesh_.opposite(h))) {
      if (!is_kept(mesh_.edge(g))) continue;
      kept++;
      if (mesh_.source(g) != to) before = at(mesh_, mesh_.source(g));
    }
    if (kept > 0) {
      if (kept != 2 || !is_kept(mesh_.edge(h))) return false;
      const Vector along = (at(mesh_, to) - before).normalized(), away = at(mesh_, from) - before;
      if (!((away - away.dot(along) * along).norm() < 0.1 * length_)) return false;
    }
    return improves(h);
  }

  bool improves(Halfedge h) const {
    const Vertex to = mesh_.target(h);
    double old_least = std::numbers::pi, new_least = std::numbers::pi;
    for (const Halfedge g : mesh_.halfedges_around_target(mesh_.opposite(h))) {
      if (mesh_.is_border(g)) continue;
      const Triangle3 old = corners(mesh_, g);  // from the source of g to the vertex that goes
      old_least = std::min(old_least, least_angle(old));
      if (mesh_.source(g) == to || mesh_.target(mesh_.next(g)) == to) continue;
      const Triangle3 now{old.a, at(mesh_, to), old.c};
      const Vector n = now.area_normal(), m = old.area_normal();
      constexpr double cos_limit = 0.8;
      if (!(n.dot(m) > cos_limit * n.norm() * m.norm()) || now.circumradius() > length_) return false;
      new_least = std::min(new_least, least_angle(now));
    }
    return new_least > old_least;
  }

  void collapse(Halfedge h) {
    const Vertex to = mesh_.target(h);
    std::vector<Vertex> sharp_to;  // of the edges that become one, one may be sharp
    for (const Halfedge side : {h, mesh_.opposite(h)}) {
      if (mesh_.is_border(side)) continue;
      if (sharp_[mesh_.edge(mesh_.next(side))] || sharp_[mesh_.edge(mesh_.prev(side))])
        sharp_to.push_back(mesh_.target(mesh_.next(side)));
    }
    const Point place = at(mesh_, to);
    const Vertex left = CGAL::Euler::collapse_edge(mesh_.edge(h), mesh_);
    mesh_.point(left) = to_cgal(place);
    for (const Vertex v : sharp_to) sharp_[mesh_.edge(mesh_.halfedge(left, v))] = true;
  }

  CgalMesh& mesh_;
  SharpMap& sharp_;
  const double length_;
};

// A triangle whose height is less than this share of the edge length stays: its parts would be as flat, and
// so on for ever.
constexpr double kFlatShare = 1e-3;

// Splits the longest edge of each obtuse triangle with too large a circumradius at the foot of its height.
std::size_t split_slivers(CgalMesh& mesh, SharpMap& sharp, double limit) {
  std::size_t splits = 0;
  const std::vector<CgalMesh::Face_index> faces(mesh.faces().begin(), mesh.faces().end());
  for (const auto f : faces) {
    Halfedge longest = mesh.halfedge(f);
    double length = 0;
    for (const Halfedge h : mesh.halfedges_around_face(mesh.halfedge(f))) {
      if (const double l = length_of(mesh, h); l > length) length = l, longest = h;
    }
    const Triangle3 t = corners(mesh, longest);
    const Vector e = t.b - t.a;
    if (t.circumradius() <= limit || !(2 * t.area_normal().norm() > kFlatShare * limit * e.norm())) continue;
    const double s = std::clamp((t.c - t.a).dot(e) / e.squaredNorm(), 0.1, 0.9);
    const bool was_sharp = sharp[mesh.edge(longest)];
    const Halfedge twin = mesh.opposite(longest);
    const Halfedge half = CGAL::Euler::split_edge(longest, mesh);  // source(longest) -> new vertex
    mesh.point(mesh.target(half)) = to_cgal(Point(t.a + s * e));
    sharp[mesh.edge(half)] = sharp[mesh.edge(longest)] = was_sharp;
    CGAL::Euler::split_face(half, mesh.next(longest), mesh);
    if (!mesh.is_border(twin)) {
      const Halfedge back = mesh.opposite(half);  // new vertex -> source; runs in the twin's face
      CGAL::Euler::split_face(mesh.prev(back), mesh.next(back), mesh);
    }
    splits++;
  }
  return splits;
}

// Sets the shares of angles. `kept[3 t + k]`: the edge from corner k of triangle t to the next is sharp or a
// border.
void count_small_angles(const Mesh& mesh, const std::vector<char>& kept, RemeshQuality& q) {
  std::vector<int> lines(mesh.points.size(), 0);  // twice the sharp edges of each point
  for (std::size_t k = 0; k < kept.size(); k++)
    if (kept[k])
      for (const std::size_t end : {k, k - k % 3 + (k + 1) % 3}) lines[mesh.triangles[end / 3][end % 3]]++;
  std::size_t small = 0, free = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); t++) {
    const Triangle3 tri{mesh.corner(t, 0), mesh.corner(t, 1), mesh.corner(t, 2)};
    std::size_t here = 0;
    int shortest = 0;
    bool cap = false;
    std::array<double, 3> length;
    for (int k = 0; k < 3; k++) {
      if (tri.angle(k) < kSmallAngle) here++;
      if (tri.angle(k) > kCapAngle) cap = true;
      length[k] = (mesh.corner(t, (k + 1) % 3) - mesh.corner(t, k)).norm();
      if (length[k] < length[shortest]) shortest = k;
    }
    if (here == 0) continue;
    const auto& c = mesh.triangles[t];
    const int u = lines[c[shortest]], v = lines[c[(shortest + 1) % 3]];
    const bool held = cap ? lines[c[0]] && lines[c[1]] && lines[c[2]]
                          : u && v && (!kept[3 * t + std::size_t(shortest)] || (u != 4 && v != 4));
    small += here, free += held ? 0 : here;
  }
  const double angles = 3 * double(mesh.triangles.size());
  q.angles_under_20_deg = double(small) / angles, q.free_angles_under_20_deg = double(free) / angles;
}

// Splits, collapses, flips, smooths and projects.
template <class Faces>
void make_even(const Faces& faces, CgalMesh& mesh, SharpMap& sharp, double length, int iterations) {
  pmp::isotropic_remeshing(faces, length, mesh,
                           CGAL::parameters::number_of_iterations(iterations)
                               .edge_is_constrained_map(sharp)
                               .face_patch_map(find_parts(mesh, sharp))
                               .protect_constraints(false)
                               .number_of_relaxation_steps(3));
  mesh.collect_garbage();
}

// Is the face of h thin, and not because its shortest edge joins two sharp lines? A cap, which is flat at one
// corner, has no short edge and is none of these.
bool is_in_row(const CgalMesh& mesh, const SharpMap& sharp, Halfedge h) {
  const Triangle3 t = corners(mesh, h);
  if (least_angle(t) >= kRowAngle || std::max({t.angle(0), t.angle(1), t.angle(2)}) > kCapAngle) return false;
  const Halfedge shortest = std::min({h, mesh.next(h), mesh.prev(h)}, [&](Halfedge a, Halfedge b) {
    return length_of(mesh, a) < length_of(mesh, b);
  });
  const auto lines = [&](Vertex v) {
    int count = 0;
    for (const Halfedge g : mesh.halfedges_around_target(mesh.halfedge(v)))
      count += sharp[mesh.edge(g)] || mesh.is_border(mesh.edge(g));
    return count;
  };
  const int u = lines(mesh.source(shortest)), v = lines(mesh.target(shortest));
  return sharp[mesh.edge(shortest)] ? u == 2 || v == 2 : u == 0 || v == 0;
}

// CGAL collapses no edge where that makes another longer than 4/3 of the length. So it leaves edges about as
// long as that side by side in rows, however close they are, as on the wall of a hole with many corners.
// Halves these, and makes the faces around them even once more.
void break_rows(CgalMesh& mesh, SharpMap& sharp, double length) {
  constexpr int rings = 2, iterations = 3;
  std::vector<Edge> rows;
  std::vector<char> close(mesh.num_vertices(), 0);
  for (const auto f : mesh.faces()) {
    if (!is_in_row(mesh, sharp, mesh.halfedge(f))) continue;
    for (const Halfedge h : mesh.halfedges_around_face(mesh.halfedge(f))) {
      close[mesh.target(h)] = 1;
      if (!sharp[mesh.edge(h)]) rows.push_back(mesh.edge(h));
    }
  }
  if (rows.empty()) return;
  sort_unique(rows);
  for (int ring = 0; ring < rings; ring++) {
    const std::vector<char> inner = close;
    for (const Edge e : mesh.edges()) {
      const Vertex u = mesh.vertex(e, 0), v = mesh.vertex(e, 1);
      if (inner[u] || inner[v]) close[u] = close[v] = 1;
    }
  }
  pmp::split_long_edges(rows, 0.8 * length, mesh, CGAL::parameters::edge_is_constrained_map(sharp));
  close.resize(mesh.num_vertices(), 1);
  std::vector<CgalMesh::Face_index> faces;
  for (const auto f : mesh.faces()) {
    const auto corners = mesh.vertices_around_face(mesh.halfedge(f));
    if (std::any_of(corners.begin(), corners.end(), [&](Vertex v) { return close[v] != 0; }))
      faces.push_back(f);
  }
  make_even(faces, mesh, sharp, length, iterations);
}

// The remesher splits all edges into pieces of the length, and then collapses what is short. Of slivers side
// by side it makes many times the pieces that are left at last, which takes minutes. So where there are that
// many, short edges are merged first.
Mesh with_slivers_merged(const Mesh& input, double length) {
  constexpr double most_pieces = 3;  // for each triangle before and after; parts of machines have up to 1.3
  double pieces = 0;
  for (std::size_t t = 0; t < input.triangles.size(); t++)
    for (int k = 0; k < 3; k++)
      pieces += 0.5 * (input.corner(t, (k + 1) % 3) - input.corner(t, k)).norm() / length;
  const double triangles = double(input.triangles.size()) + double(expected_triangles(input, length));
  // Edges of a quarter of the length and planes that move by a fiftieth of it do not show in the result.
  const auto thin = pieces > most_pieces * triangles ? with_short_edges_merged : with_thinned_fans;
  return thin(input, 0.25 * length, 0.02 * length);
}

}  // namespace

RemeshQuality measure_quality(const Mesh& mesh, double sharp_angle) {
  RemeshQuality q;
  if (mesh.triangles.empty()) return q;
  struct Side {
    std::uint64_t edge;
    std::size_t place;  // 3 t + k: from corner k of triangle t to the next
    double angle;       // that faces the edge
    Vector normal;
  };
  std::vector<Side> sides;
  q.min_angle_deg = 180;
  std::size_t under = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); t++) {
    const Triangle3 tri{mesh.corner(t, 0), mesh.corner(t, 1), mesh.corner(t, 2)};
    const Vector normal = tri.area_normal().normalized();
    for (int k = 0; k < 3; k++) {
      const auto u = mesh.triangles[t][k], v = mesh.triangles[t][(k + 1) % 3];
      sides.push_back({edge_of(u, v), 3 * t + std::size_t(k), tri.angle((k + 2) % 3), normal});
    }
    q.min_angle_deg = std::min(q.min_angle_deg, least_angle(tri) / kDegree);
    under += least_angle(tri) < kSmallAngle;
    q.circumradius_max = std::max(q.circumradius_max, tri.circumradius());
  }
  q.share_under_20_deg = double(under) / double(mesh.triangles.size());
  std::sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) { return a.edge < b.edge; });
  std::vector<char> kept(sides.size(), 1);  // by place: sharp or border
  std::size_t interior = 0, failed = 0;
  for (std::size_t k = 0; k + 1 < sides.size(); k++) {
    if (sides[k].edge != sides[k + 1].edge) continue;
    if (sides[k].normal.dot(sides[k + 1].normal) < std::cos(sharp_angle * kDegree)) {
      q.sharp_edges++;
    } else {
      interior++;
      failed += sides[k].angle + sides[k + 1].angle > std::numbers::pi + 1e-9;
      kept[sides[k].place] = kept[sides[k + 1].place] = 0;
    }
    k++;
  }
  q.share_non_delaunay = interior ? double(failed) / double(interior) : 0;
  count_small_angles(mesh, kept, q);
  return q;
}

std::uint64_t expected_triangles(const Mesh& mesh, double edge_length) {
  if (!(edge_length > 0)) throw Error("the edge length must be positive");
  const double expected = mesh.area() / (0.43 * edge_length * edge_length);
  if (expected > 2147483648.0)
    throw Error("edges of this length would make more than 2^31 triangles: use a greater edge length");
  return static_cast<std::uint64_t>(expected);
}

Remeshed remesh(const Mesh& input, const RemeshOptions& options) {
  const double length = options.edge_length;
  expected_triangles(input, length);  // throws where they are too many
  const double near = options.slivers * length;
  const Mesh thinned = with_slivers_merged(input, length);
  CgalMesh mesh = manifold(near > 0 ? without_slivers(thinned, near) : thinned);
  SharpMap sharp = find_sharp_edges(mesh, options.sharp_angle);
  constexpr int iterations = 5;
  make_even(mesh.faces(), mesh, sharp, length, iterations);
  break_rows(mesh, sharp, length);
  if (near > 0) {
    mesh = manifold(without_slivers(from_cgal(mesh), near));
    sharp = find_sharp_edges(mesh, options.sharp_angle);
  }
  make_delaunay(mesh, sharp);
  constexpr int thin_rounds = 5, split_rounds = 10;
  for (int round = 0; round < thin_rounds; round++) {
    if (ThinCollapse(mesh, sharp, length).run() == 0) break;
    make_delaunay(mesh, sharp);
  }
  for (int round = 0; round < split_rounds; round++) {
    if (split_slivers(mesh, sharp, length) == 0) break;
    make_delaunay(mesh, sharp);
  }
  Remeshed out;
  out.mesh = from_cgal(mesh);
  if (near > 0) out.mesh = without_slivers(out.mesh, near);
  out.quality = measure_quality(out.mesh, options.sharp_angle);
  return out;
}

}  // namespace padder
