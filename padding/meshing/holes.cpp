// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/meshing/holes.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <numeric>
#include <set>
#include <unordered_map>

#include "padding/geometry/point_tree.h"
#include "padding/input/polygon.h"

namespace padder {
namespace {

constexpr std::size_t kLongRim = 300;  // the time for the least area grows with the cube of the rim
constexpr double kThinRing = 2e-3;     // width of the ring between copies, as a share of the rim's length
constexpr double kFlatRim = 0.02;      // distance from the plane across it, as a share of its length

// How often each directed edge is missing. An edge and its opposite cancel.
class Needs {
 public:
  void add(std::uint32_t from, std::uint32_t to) {
    const auto opposite = count_.find({to, from});
    if (opposite == count_.end())
      count_[{from, to}]++;
    else if (--opposite->second == 0)
      count_.erase(opposite);
  }
  bool has(std::uint32_t from, std::uint32_t to) const { return count_.count({from, to}) > 0; }
  // Calls visit(to) for each missing edge from `from`.
  template <class Visit>
  void visit_from(std::uint32_t from, Visit&& visit) const {
    for (auto it = count_.lower_bound({from, 0}); it != count_.end() && it->first.first == from; ++it)
      visit(it->first.second);
  }
  std::vector<DirectedEdge> list() const {
    std::vector<DirectedEdge> all;
    for (const auto& [edge, n] : count_)
      for (int k = 0; k < n; k++) all.push_back({edge.first, edge.second});
    return all;
  }

 private:
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> count_;
};

// The patch of least area over a polygon, by dynamic programming (Barequet and Sharir, Filling gaps in the
// boundary of a polyhedron, 1995): the best over points i to j is a triangle (i, k, j) with the best on
// either side of it. CGAL's triangulate_hole_polyline looks for small angles between triangles first, and
// closed an open seam by a patch through the middle of the body.
void least_area(const std::vector<Point>& polygon, Triangles& out) {
  const std::size_t n = polygon.size();
  std::vector<double> best(n * n, 0);
  std::vector<std::uint32_t> middle(n * n, 0);
  for (std::size_t length = 2; length < n; length++)
    for (std::size_t i = 0, j = length; j < n; i++, j++) {
      double least = std::numeric_limits<double>::infinity();
      for (std::size_t k = i + 1; k < j; k++) {
        const double area = best[i * n + k] + best[k * n + j] +
                            (polygon[k] - polygon[i]).cross(polygon[j] - polygon[i]).norm();
        if (area < least) least = area, middle[i * n + j] = static_cast<std::uint32_t>(k);
      }
      best[i * n + j] = least;
    }
  std::vector<std::array<std::size_t, 2>> open = {{0, n - 1}};
  while (!open.empty()) {
    const auto [i, j] = open.back();
    open.pop_back();
    if (j - i < 2) continue;
    const std::uint32_t k = middle[i * n + j];
    out.push_back({static_cast<std::uint32_t>(i), k, static_cast<std::uint32_t>(j)});
    open.push_back({i, k}), open.push_back({k, j});
  }
}

// A rim that lies about in a plane.
struct FlatRim {
  std::vector<Point> points;
  Vector area = Vector::Zero();  // twice, along the normal
  double most_off = 0;           // from the plane: what lies off it by less counts as in it

  FlatRim(const Mesh& mesh, const std::vector<std::uint32_t>& rim) {
    for (const auto v : rim) points.push_back(mesh.points[v]);
    for (std::size_t k = 1; k + 1 < points.size(); k++)
      area += (points[k] - points[0]).cross(points[k + 1] - points[0]);
    most_off = kFlatRim * rim_length(mesh, rim);
  }
  bool lies_in_plane(const Point& p) const {
    return std::abs(area.normalized().dot(p - points[0])) <= most_off;
  }
  bool is_flat() const {
    return area.norm() > 0 &&
           std::all_of(points.begin(), points.end(), [&](const Point& p) { return lies_in_plane(p); });
  }
  // Does the rim run round the point, as seen along its normal?
  bool surrounds(const Point& p) const {
    double turn = 0;
    const Vector n = area.normalized();
    for (std::size_t k = 0; k < points.size(); k++) {
      const Vector a = points[k] - p, b = points[(k + 1) % points.size()] - p;
      turn += std::atan2(n.dot(a.cross(b)), a.dot(b) - n.dot(a) * n.dot(b));
    }
    return std::abs(turn) > std::numbers::pi;
  }
  bool surrounds(const FlatRim& other) const {
    return area.norm() > other.area.norm() &&
           std::abs(area.dot(other.area)) > 0.99 * area.norm() * other.area.norm() &&
           std::all_of(other.points.begin(), other.points.end(),
                       [&](const Point& p) { return lies_in_plane(p) && surrounds(p); });
  }
};

}  // namespace

std::vector<Ring> find_rings(const Mesh& mesh, const std::vector<std::vector<std::uint32_t>>& rims) {
  constexpr std::size_t most_rims = 1000;  // each is compared with each; a soup has more
  std::vector<Ring> rings;
  if (rims.size() > most_rims) return rings;
  std::vector<FlatRim> flat;
  std::vector<char> is_flat;
  for (const auto& rim : rims) flat.emplace_back(mesh, rim), is_flat.push_back(flat.back().is_flat());
  for (std::size_t inner = 0; inner < rims.size(); inner++) {
    if (!is_flat[inner]) continue;
    std::size_t outer = rims.size();  // the smallest one around it
    for (std::size_t k = 0; k < rims.size(); k++)
      if (is_flat[k] && (outer == rims.size() || flat[k].area.norm() < flat[outer].area.norm()) &&
          flat[k].surrounds(flat[inner]))
        outer = k;
    if (outer == rims.size()) continue;
    double least = std::numeric_limits<double>::infinity();
    Ring ring{outer, inner, {}, flat[outer].area.dot(flat[inner].area) > 0};
    for (const auto a : rims[outer])
      for (const auto b : rims[inner])
        if (const double away = (mesh.points[b] - mesh.points[a]).norm(); away < least)
          least = away, ring.bridge = {a, b};
    if (ring.alike && least < kThinRing * rim_length(mesh, rims[inner])) continue;
    rings.push_back(ring);
  }
  return rings;
}

void join_rims(std::vector<std::vector<std::uint32_t>>& rims, const std::array<std::uint32_t, 2>& bridge) {
  std::array<std::size_t, 2> at = {rims.size(), rims.size()};
  for (std::size_t k = 0; k < rims.size(); k++)
    for (std::size_t end = 0; end < 2; end++)
      if (std::find(rims[k].begin(), rims[k].end(), bridge[end]) != rims[k].end()) at[end] = k;
  if (at[0] == at[1] || at[0] == rims.size() || at[1] == rims.size()) return;
  for (std::size_t end = 0; end < 2; end++) {
    auto& rim = rims[at[end]];
    std::rotate(rim.begin(), std::find(rim.begin(), rim.end(), bridge[end]), rim.end());
    rim.push_back(bridge[end]);
  }
  rims[at[0]].insert(rims[at[0]].end(), rims[at[1]].begin(), rims[at[1]].end());
  rims.erase(rims.begin() + static_cast<std::ptrdiff_t>(at[1]));
}

std::vector<CrackTriangle> close_cracks(const Mesh& mesh, std::vector<DirectedEdge>& missing, double width) {
  Needs needs;
  std::vector<std::uint32_t> border;
  for (const DirectedEdge& e : missing) needs.add(e.from, e.to), border.push_back(e.from);
  std::sort(border.begin(), border.end());
  border.erase(std::unique(border.begin(), border.end()), border.end());
  std::vector<Point> places;
  for (const auto v : border) places.push_back(mesh.points[v]);
  const PointTree tree(places);
  std::vector<CrackTriangle> patch;
  std::vector<std::uint32_t> near;
  for (const DirectedEdge& e : missing) {
    if (!needs.has(e.from, e.to)) continue;
    const Point &a = mesh.points[e.from], &b = mesh.points[e.to];
    const Vector along = b - a;
    near.clear();
    tree.find(0.5 * (a + b), 0.5 * along.norm() + width, near);
    struct Beside {
      double at, away;  // along the edge, 0 to 1, and from it
      std::uint32_t vertex;
      bool on_way = false;
    };
    std::vector<Beside> all = {{0, 0, e.from}};
    for (const auto k : near) {
      const auto v = border[k];
      if (v == e.from || v == e.to) continue;
      const double at = std::clamp(along.dot(places[k] - a) / along.squaredNorm(), 0.0, 1.0);
      const double away = (places[k] - a - at * along).norm();
      if (away <= width) all.push_back({at, away, v});
    }
    if (all.size() == 1) continue;
    std::sort(all.begin() + 1, all.end(), [](const Beside& x, const Beside& y) {
      return x.at != y.at ? x.at < y.at : x.vertex < y.vertex;
    });
    all.push_back({1, 0, e.to});
    // The way goes over the ends of border edges that run the other way beside this one. Other points lie
    // near its ends, where corners of many triangles do; a way over these would need an edge for each.
    for (std::size_t k = 1; k < all.size(); k++)
      needs.visit_from(all[k].vertex, [&](std::uint32_t to) {
        for (std::size_t j = 0; j < k; j++)
          if (all[j].vertex == to) all[j].on_way = all[k].on_way = true;
      });
    all.front().on_way = all.back().on_way = true;
    std::vector<std::uint32_t> way;
    double most = 0;
    for (const Beside& one : all)
      if (one.on_way) way.push_back(one.vertex), most = std::max(most, one.away);
    // Worth it only if the way runs along another border.
    bool meets = false;
    for (std::size_t k = 0; k + 1 < way.size(); k++) meets |= needs.has(way[k + 1], way[k]);
    if (!meets) continue;
    for (std::size_t k = way.size() - 1; k >= 2; k--) {
      const std::uint32_t u = way[0], v = way[k], w = way[k - 1];
      patch.push_back({{u, v, w}, most});
      needs.add(v, u), needs.add(w, v), needs.add(u, w);  // what the triangle has is no longer missing
    }
  }
  missing = needs.list();
  return patch;
}

SplitEdges split_edges(const Mesh& mesh, const std::vector<std::uint32_t>& triangles,
                       const std::vector<DirectedEdge>& open, double width) {
  std::vector<std::uint32_t> ends;
  for (const DirectedEdge& e : open) ends.push_back(e.from), ends.push_back(e.to);
  std::sort(ends.begin(), ends.end());
  ends.erase(std::unique(ends.begin(), ends.end()), ends.end());
  const auto is_end = [&](std::uint32_t v) { return std::binary_search(ends.begin(), ends.end(), v); };
  std::vector<Point> places;
  for (const auto v : ends) places.push_back(mesh.points[v]);
  const PointTree tree(places);
  SplitEdges out{mesh};
  std::unordered_map<std::uint64_t, std::vector<std::uint32_t>> on_edge;  // from its smaller vertex on
  std::vector<std::uint32_t> near;
  const std::vector<Side> sides = sides_of(mesh, triangles);
  for_edges(sides, [&](std::size_t begin, std::size_t end) {
    const std::array e = {static_cast<std::uint32_t>(sides[begin].edge >> 32),
                          static_cast<std::uint32_t>(sides[begin].edge)};
    if (!is_end(e[0]) || !is_end(e[1])) return;
    const Point& a = mesh.points[e[0]];
    const Vector along = mesh.points[e[1]] - a;
    near.clear();
    tree.find(a + 0.5 * along, 0.5 * along.norm(), near);
    std::vector<std::pair<double, std::uint32_t>> found;
    for (const auto k : near) {
      const double at = along.dot(places[k] - a) / along.squaredNorm(),
                   away = (places[k] - a - at * along).norm();
      bool corner = ends[k] == e[0] || ends[k] == e[1];  // of a triangle with this edge
      for (std::size_t s = begin; s < end; s++)
        for (const auto v : mesh.triangles[sides[s].triangle]) corner |= v == ends[k];
      // What lies near an end belongs to that.
      const double length = along.norm();
      if (corner || away > width || at * length <= width || (1 - at) * length <= width) continue;
      found.emplace_back(at, ends[k]), out.farthest = std::max(out.farthest, away);
    }
    if (found.empty()) return;
    std::sort(found.begin(), found.end());
    for (const auto& [at, v] : found) on_edge[sides[begin].edge].push_back(v);
  });
  out.count = on_edge.size();
  // Only sides of the triangle itself are split, or rounding might lead round in a circle.
  struct Part {
    Corners corners;
    std::array<bool, 3> is_side;  // the edge behind each corner
  };
  std::vector<Corners> cut;
  std::vector<Part> left;
  for (const auto t : triangles) {
    left.push_back({mesh.triangles[t], {true, true, true}});
    while (!left.empty()) {
      auto [c, is_side] = left.back();
      left.pop_back();
      auto found = on_edge.end();
      for (int k = 0; k < 3 && found == on_edge.end(); k++) {
        std::rotate(c.begin(), c.begin() + 1, c.end()),
            std::rotate(is_side.begin(), is_side.begin() + 1, is_side.end());
        if (is_side[0])
          found = on_edge.find(std::uint64_t(std::min(c[0], c[1])) << 32 | std::max(c[0], c[1]));
      }
      if (found == on_edge.end()) {
        cut.push_back(c);
        continue;
      }
      std::vector<std::uint32_t> way = found->second;
      if (c[0] > c[1]) std::reverse(way.begin(), way.end());
      way.insert(way.begin(), c[0]), way.push_back(c[1]);
      for (std::size_t k = 1; k < way.size(); k++)
        left.push_back(
            {{way[k - 1], way[k], c[2]}, {false, is_side[1] && k + 1 == way.size(), is_side[2] && k == 1}});
    }
  }
  std::vector<char> listed(mesh.triangles.size(), 0);
  for (const auto t : triangles) listed[t] = 1;
  out.mesh.triangles.clear();
  for (std::size_t t = 0; t < listed.size(); t++)
    if (!listed[t]) out.mesh.triangles.push_back(mesh.triangles[t]);
  out.mesh.triangles.insert(out.mesh.triangles.end(), cut.begin(), cut.end());
  return out;
}

JoinedCorners join_corners(const Mesh& soup, const Mesh& mesh, const std::vector<DirectedEdge>& missing,
                           double width) {
  std::vector<std::uint32_t> border;
  for (const DirectedEdge& e : missing) border.push_back(e.from), border.push_back(e.to);
  std::sort(border.begin(), border.end());
  border.erase(std::unique(border.begin(), border.end()), border.end());
  std::vector<Point> places;
  for (const auto v : border) places.push_back(mesh.points[v]);
  const PointTree tree(places);
  std::vector<std::uint32_t> to(mesh.points.size()), near;  // the first corner of those joined with it
  std::iota(to.begin(), to.end(), 0u);
  std::vector<char> taken(border.size(), 0);
  for (std::uint32_t k = 0; k < border.size(); k++) {
    if (taken[k]) continue;
    near.clear();
    tree.find(places[k], width, near);
    for (const auto other : near)
      if (!taken[other]) taken[other] = 1, to[border[other]] = border[k];
  }
  for (const auto& t : mesh.triangles)
    if (to[t[0]] == to[t[1]] || to[t[1]] == to[t[2]] || to[t[2]] == to[t[0]])
      for (const auto v : t) to[v] = v;
  // Of many corners that are off at random, the mean is off least.
  std::unordered_map<std::uint32_t, std::pair<Point, std::size_t>> sums;
  for (const auto v : border) {
    auto& [sum, count] = sums.try_emplace(to[v], Point::Zero(), 0).first->second;
    sum += mesh.points[v], count++;
  }
  const auto less = [](const Point& a, const Point& b) {
    return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
  };
  std::map<Point, Point, decltype(less)> moved(less);
  JoinedCorners out{soup};
  for (const auto v : border) {
    const auto& [sum, count] = sums.at(to[v]);
    if (count < 2) continue;
    const Point mean = sum / double(count);
    moved.emplace(mesh.points[v], mean), out.count++;
    out.farthest = std::max(out.farthest, (mesh.points[v] - mean).norm());
  }
  for (Point& p : out.mesh.points)
    if (const auto found = moved.find(p); found != moved.end()) p = found->second;
  return out;
}

std::vector<std::vector<std::uint32_t>> trace_rims(const Mesh& mesh,
                                                   const std::vector<std::uint32_t>& triangles,
                                                   const std::vector<DirectedEdge>& missing) {
  std::unordered_map<std::uint32_t, std::vector<std::uint32_t>> ways;  // from a vertex
  std::unordered_map<std::uint32_t, Vector> normals;
  for (const DirectedEdge& e : missing) ways[e.from].push_back(e.to), normals[e.from] = Vector::Zero();
  for (const auto t : triangles)
    for (const auto v : mesh.triangles[t])
      if (const auto n = normals.find(v); n != normals.end()) n->second += mesh.area_normal(t);

  // Takes the way on from `at` that is first when turning from the way back, with the hole on the left.
  const auto take = [&](std::uint32_t from, std::uint32_t at) {
    auto& on = ways[at];
    std::size_t best = 0;
    double least = 10;
    const Vector n = normals[at].normalized(), back = mesh.points[from] - mesh.points[at];
    for (std::size_t k = 0; on.size() > 1 && k < on.size(); k++) {
      const Vector d = mesh.points[on[k]] - mesh.points[at];
      double angle = -std::atan2(n.dot(back.cross(d)), back.dot(d) - n.dot(back) * n.dot(d));
      if (angle <= 1e-9) angle += 2 * std::numbers::pi;
      if (angle < least) least = angle, best = k;
    }
    const std::uint32_t to = on[best];
    on.erase(on.begin() + static_cast<std::ptrdiff_t>(best));
    return to;
  };

  std::vector<std::vector<std::uint32_t>> rims;
  for (const DirectedEdge& first : missing) {
    auto& start = ways[first.from];
    if (start.empty()) continue;
    std::vector<std::uint32_t> path = {first.from};
    std::unordered_map<std::uint32_t, std::size_t> place = {{first.from, 0}};
    std::uint32_t from = first.from, at = start.back();
    start.pop_back();
    while (true) {
      const auto seen = place.find(at);
      if (seen != place.end()) {  // the path closes a loop
        const auto begin = path.begin() + static_cast<std::ptrdiff_t>(seen->second);
        if (path.end() - begin >= 3) rims.emplace_back(begin, path.end());
        for (auto it = begin + 1; it != path.end(); ++it) place.erase(*it);
        path.erase(begin + 1, path.end());
        if (path.size() == 1) break;
        from = path[path.size() - 2];
      } else {
        place[at] = path.size(), path.push_back(at);
        from = path[path.size() - 2];
      }
      if (ways[at].empty()) break;  // only if the edges do not balance
      at = take(from, at);
    }
  }
  return rims;
}

double rim_length(const Mesh& mesh, const std::vector<std::uint32_t>& rim) {
  double length = 0;
  for (std::size_t k = 0; k < rim.size(); k++)
    length += (mesh.points[rim[(k + 1) % rim.size()]] - mesh.points[rim[k]]).norm();
  return length;
}

Triangles fill_rim(const Mesh& mesh, const std::vector<std::uint32_t>& rim) {
  std::vector<Point> polygon;
  for (const auto v : rim) polygon.push_back(mesh.points[v]);
  Vector normal = Vector::Zero();
  for (std::size_t k = 1; k + 1 < polygon.size(); k++)
    normal += (polygon[k] - polygon[0]).cross(polygon[k + 1] - polygon[0]);
  double low = 0, high = 0;
  for (const Point& p : polygon) {
    const double d = normal.normalized().dot(p - polygon[0]);
    low = std::min(low, d), high = std::max(high, d);
  }
  Triangles out;
  const bool ring = std::set<std::uint32_t>(rim.begin(), rim.end()).size() < rim.size();
  if (rim.size() > 3 && rim.size() <= kLongRim && (ring || !(high - low <= kFlatRim * rim_length(mesh, rim))))
    least_area(polygon, out);
  else
    triangulate_polygon(polygon, out);
  for (auto& t : out)
    for (auto& v : t) v = rim[v];
  return out;
}

double solid_angle(const Mesh& mesh, const std::array<std::uint32_t, 3>& t, const Point& p) {
  const Vector a = mesh.points[t[0]] - p, b = mesh.points[t[1]] - p, c = mesh.points[t[2]] - p;
  const double x = a.norm(), y = b.norm(), z = c.norm();
  const double below = x * y * z + a.dot(b) * z + b.dot(c) * x + c.dot(a) * y;
  return std::atan2(a.dot(b.cross(c)), below) / (2 * std::numbers::pi);
}

}  // namespace padder
