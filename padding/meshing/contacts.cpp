// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/meshing/contacts.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>

#include "padding/meshing/cgal_mesh.h"

namespace padder {
namespace {

using Corners = std::array<std::uint32_t, 3>;

std::uint64_t edge_of(std::uint32_t u, std::uint32_t v) {
  return std::uint64_t(std::min(u, v)) << 32 | std::max(u, v);
}

int axis_across(const Mesh& mesh, std::uint32_t t) {
  int axis;
  mesh.area_normal(t).cwiseAbs().maxCoeff(&axis);
  return axis;
}

// The exact predicates, on the points of a mesh.
class Signs {
 public:
  explicit Signs(const Mesh& mesh) : mesh_(mesh) {}
  const Mesh& mesh() const { return mesh_; }

  // Is d above the plane through a, b, c (1), below (-1) or in it (0)?
  int side(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) const {
    return static_cast<int>(CGAL::orientation(at(a), at(b), at(c), at(d)));
  }
  // How a, b, c turn where `drop` is left out of their coordinates, which rounds nothing.
  int turn(int drop, std::uint32_t a, std::uint32_t b, std::uint32_t c) const {
    return static_cast<int>(CGAL::orientation(flat(drop, a), flat(drop, b), flat(drop, c)));
  }
  // Where is v, a point in the plane of t: the place as in MeetingPoint, or -1 outside?
  int place(std::uint32_t t, int drop, std::uint32_t v) const {
    const Corners& c = mesh_.triangles[t];
    for (int k = 0; k < 3; k++)
      if (c[k] == v) return k;
    int low = 1, high = -1, edge = -1;
    for (int k = 0; k < 3; k++) {
      const int s = turn(drop, c[k], c[(k + 1) % 3], v);
      low = std::min(low, s), high = std::max(high, s);
      if (s == 0) edge = 3 + k;
    }
    return low < 0 && high > 0 ? -1 : edge < 0 ? 6 : edge;
  }

 private:
  CgalPoint at(std::uint32_t v) const { return to_cgal(mesh_.points[v]); }
  CgalKernel::Point_2 flat(int drop, std::uint32_t v) const {
    const Point& p = mesh_.points[v];
    return {p[(drop + 1) % 3], p[(drop + 2) % 3]};
  }
  const Mesh& mesh_;
};

// Compares one pair after another and collects what it finds.
class PairTest {
 public:
  explicit PairTest(const Mesh& mesh) : signs_(mesh), mesh_(mesh) {}

  // Returns whether the triangles meet. Then their cuts are in `found`.
  bool meet(std::uint32_t s, std::uint32_t t, Contacts& found) {
    const Corners &a = mesh_.triangles[s], &b = mesh_.triangles[t];
    int shared = 0;
    for (const auto v : b) shared += std::count(a.begin(), a.end(), v) > 0;
    std::array<int, 3> above_s, above_t;
    if (!straddles(a, b, above_s)) return false;
    if (above_s == std::array{0, 0, 0}) return overlap(s, t, found);
    if (shared >= 2) return false;
    if (!straddles(b, a, above_t)) return false;
    std::vector<std::array<MeetingPoint, 2>> points;  // of each the place in s and in t
    add_corners(s, t, above_t, false, points), add_corners(t, s, above_s, true, points);
    add_crossings(s, t, above_t, false, points), add_crossings(t, s, above_s, true, points);
    const auto is_shared = [](const auto& p) { return p[0].is_vertex() && p[0].place < 3 && p[1].place < 3; };
    if (std::all_of(points.begin(), points.end(), is_shared)) return false;
    found.cuts.push_back({s, {points.front()[0], points.back()[0]}});
    found.cuts.push_back({t, {points.front()[1], points.back()[1]}});
    return true;
  }

 private:
  using Points = std::vector<std::array<MeetingPoint, 2>>;

  // On which side of triangle a lie the corners of b? False if all that a does not share lie strictly on one
  // side: then b has no more than these in the plane of a.
  bool straddles(const Corners& a, const Corners& b, std::array<int, 3>& side) const {
    int low = 2, high = -2;
    for (int k = 0; k < 3; k++) {
      side[k] = 0;
      if (std::count(a.begin(), a.end(), b[k]) > 0) continue;
      side[k] = signs_.side(a[0], a[1], a[2], b[k]);
      low = std::min(low, side[k]), high = std::max(high, side[k]);
    }
    return low > 1 || (low <= 0 && high >= 0);
  }

  static void add(Points& points, MeetingPoint point, int place_own, int place_other, bool swapped) {
    std::array<MeetingPoint, 2> both = {point, point};
    both[swapped].place = place_own, both[!swapped].place = place_other;
    for (const auto& p : points)
      if (p[0].same(point)) return;
    points.push_back(both);
  }

  // The corners of `own` that lie in `other`.
  void add_corners(std::uint32_t own, std::uint32_t other, const std::array<int, 3>& above, bool swapped,
                   Points& points) const {
    const int drop = axis_across(mesh_, other);
    for (int k = 0; k < 3; k++) {
      if (above[k] != 0) continue;
      const auto v = mesh_.triangles[own][k];
      const int place = signs_.place(other, drop, v);
      if (place >= 0) add(points, {v, MeetingPoint::kNoOther}, k, place, swapped);
    }
  }

  // The inner points of edges of `own` that lie in `other`, but for its corners.
  void add_crossings(std::uint32_t own, std::uint32_t other, const std::array<int, 3>& above, bool swapped,
                     Points& points) const {
    const Corners &c = mesh_.triangles[own], &o = mesh_.triangles[other];
    for (int k = 0; k < 3; k++) {
      if (above[k] * above[(k + 1) % 3] >= 0) continue;
      const auto u = c[k], v = c[(k + 1) % 3];
      int low = 1, high = -1, zeros = 0, edge = 0;
      for (int i = 0; i < 3; i++) {
        const int s = signs_.side(u, v, o[i], o[(i + 1) % 3]);
        low = std::min(low, s), high = std::max(high, s);
        if (s == 0) zeros++, edge = i;
      }
      if ((low < 0 && high > 0) || zeros > 1) continue;
      const std::uint64_t e = edge_of(u, v), f = edge_of(o[edge], o[(edge + 1) % 3]);
      if (zeros == 0)
        add(points, {e, MeetingPoint::kTriangle + other}, 3 + k, 6, swapped);
      else
        add(points, {std::min(e, f), std::max(e, f)}, 3 + k, 3 + edge, swapped);
    }
  }

  // Both triangles lie in one plane.
  bool overlap(std::uint32_t s, std::uint32_t t, Contacts& found) const {
    const int drop = axis_across(mesh_, s);
    if (!areas_meet(s, t, drop) || !areas_meet(t, s, drop)) return false;
    found.overlaps.push_back({s, t});
    cut_by_edges(s, t, drop, found), cut_by_edges(t, s, drop, found);
    return true;
  }

  // False if an edge of s has all of t on its other side.
  bool areas_meet(std::uint32_t s, std::uint32_t t, int drop) const {
    const Corners &a = mesh_.triangles[s], &b = mesh_.triangles[t];
    const int way = signs_.turn(drop, a[0], a[1], a[2]);
    for (int k = 0; k < 3; k++) {
      int most = -1;
      for (const auto v : b) most = std::max(most, way * signs_.turn(drop, a[k], a[(k + 1) % 3], v));
      if (most <= 0) return false;
    }
    return true;
  }

  // Cuts s by the parts of the edges of t that lie in it.
  void cut_by_edges(std::uint32_t s, std::uint32_t t, int drop, Contacts& found) const {
    const Corners &a = mesh_.triangles[s], &b = mesh_.triangles[t];
    for (int k = 0; k < 3; k++) {
      const auto u = b[k], v = b[(k + 1) % 3];
      const Vector along = mesh_.points[v] - mesh_.points[u];
      std::vector<std::pair<double, MeetingPoint>> on;
      const auto add_vertex = [&](std::uint32_t w, int place) {
        if (place >= 0)
          on.push_back({along.dot(mesh_.points[w] - mesh_.points[u]), {w, MeetingPoint::kNoOther, place}});
      };
      add_vertex(u, signs_.place(s, drop, u)), add_vertex(v, signs_.place(s, drop, v));
      std::array<int, 3> side;
      for (int i = 0; i < 3; i++) side[i] = a[i] == u || a[i] == v ? 0 : signs_.turn(drop, u, v, a[i]);
      for (int i = 0; i < 3; i++) {
        const auto p = a[i], q = a[(i + 1) % 3];
        if (side[i] == 0 && p != u && p != v) {
          const double at = along.dot(mesh_.points[p] - mesh_.points[u]);
          if (at > 0 && at < along.squaredNorm()) add_vertex(p, i);
        }
        if (side[i] * side[(i + 1) % 3] >= 0) continue;
        if (signs_.turn(drop, p, q, u) * signs_.turn(drop, p, q, v) >= 0) continue;
        const std::uint64_t e = edge_of(p, q), f = edge_of(u, v);
        const Vector across = mesh_.points[q] - mesh_.points[p];
        const double x = std::abs(double(along.cross(mesh_.points[p] - mesh_.points[u]).norm())),
                     y = std::abs(double(along.cross(mesh_.points[q] - mesh_.points[u]).norm()));
        const Point meet = mesh_.points[p] + across * (x + y > 0 ? x / (x + y) : 0.5);
        on.push_back({along.dot(meet - mesh_.points[u]), {std::min(e, f), std::max(e, f), 3 + i}});
      }
      if (on.size() < 2) continue;
      const auto [first, last] = std::minmax_element(
          on.begin(), on.end(), [](const auto& x, const auto& y) { return x.first < y.first; });
      found.cuts.push_back({s, {first->second, last->second}});
    }
  }

  Signs signs_;
  const Mesh& mesh_;
};

// Calls look(s, t) for all pairs s < t whose boxes touch, neither flat; stops a triangle's pairs when it
// returns true.
template <class Look>
void for_pairs(const Surface& surface, std::uint32_t s, const std::vector<char>& flat, Look&& look) {
  if (flat[s]) return;
  Box box;
  const Mesh& mesh = surface.mesh();
  for (int k = 0; k < 3; k++) box.add(mesh.corner(s, k));
  surface.visit(box, [&](std::uint32_t t) {
    if (t <= s || flat[t]) return;
    for (int axis = 0; axis < 3; axis++) {
      const double x = mesh.corner(t, 0)[axis], y = mesh.corner(t, 1)[axis], z = mesh.corner(t, 2)[axis];
      if (std::min({x, y, z}) > box.high[axis] || std::max({x, y, z}) < box.low[axis]) return;
    }
    look(t);
  });
}

std::vector<char> flat_ones(const Mesh& mesh) {
  std::vector<char> flat(mesh.triangles.size());
#pragma omp parallel for
  for (std::size_t t = 0; t < flat.size(); t++) flat[t] = is_flat(mesh, static_cast<std::uint32_t>(t));
  return flat;
}

}  // namespace

bool is_flat(const Mesh& mesh, std::uint32_t t) {
  const Point &a = mesh.corner(t, 0), &b = mesh.corner(t, 1), &c = mesh.corner(t, 2);
  const double longest2 = std::max({(b - a).squaredNorm(), (c - a).squaredNorm(), (c - b).squaredNorm()});
  return !(2 * mesh.area_normal(t).norm() > 1e-14 * longest2);
}

Contacts find_contacts(const Surface& surface, std::size_t limit) {
  const std::vector<char> flat = flat_ones(surface.mesh());
  constexpr std::size_t block = 256;
  const std::size_t n = flat.size(), blocks = (n + block - 1) / block;
  std::vector<Contacts> parts(blocks);
  std::atomic<std::size_t> found = 0;
#pragma omp parallel for schedule(dynamic, 1)
  for (std::size_t b = 0; b < blocks; b++) {
    PairTest test(surface.mesh());
    for (std::size_t s = b * block; s < std::min(n, (b + 1) * block) && found <= limit; s++) {
      // The tree gives the triangles in its own order.
      std::vector<std::uint32_t> near;
      for_pairs(surface, static_cast<std::uint32_t>(s), flat, [&](std::uint32_t t) { near.push_back(t); });
      const std::size_t before = parts[b].pairs.size();
      for (const auto t : near) {
        if (parts[b].pairs.size() - before > limit) break;
        if (test.meet(static_cast<std::uint32_t>(s), t, parts[b]))
          parts[b].pairs.push_back({static_cast<std::uint32_t>(s), t});
      }
      found += parts[b].pairs.size() - before;
    }
  }
  Contacts all;
  all.too_many = found > limit;
  if (all.too_many) return all;
  for (Contacts& part : parts) {
    all.cuts.insert(all.cuts.end(), part.cuts.begin(), part.cuts.end());
    all.overlaps.insert(all.overlaps.end(), part.overlaps.begin(), part.overlaps.end());
    all.pairs.insert(all.pairs.end(), part.pairs.begin(), part.pairs.end());
  }
  return all;
}

bool any_contact(const Surface& surface) {
  const std::vector<char> flat = flat_ones(surface.mesh());
  std::atomic<bool> found = false;
#pragma omp parallel for schedule(dynamic, 64)
  for (std::size_t s = 0; s < flat.size(); s++) {
    if (found) continue;
    PairTest test(surface.mesh());
    Contacts unused;
    for_pairs(surface, static_cast<std::uint32_t>(s), flat, [&](std::uint32_t t) {
      if (!found && test.meet(static_cast<std::uint32_t>(s), t, unused)) found = true;
    });
  }
  return found;
}

}  // namespace padder
