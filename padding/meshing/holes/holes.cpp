// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/meshing/holes/holes.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>
#include <span>
#include <unordered_map>

#include "padding/input/polygon.h"

namespace padder {
namespace {

constexpr std::size_t kLongRim = 300;  // the time for the least area grows with the cube of the rim
constexpr double kThinRing = 2e-3;     // width of the ring between copies, as a share of the rim's length
constexpr double kSmallHoles = 0.5;    // radius of the holes of a tire, as a share of its own halfway between
constexpr double kFlatRim = 0.02;      // distance from the plane across it, as a share of its length

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

// The patch over a polygon whose points up to `end` go round one rim, and whose other points round the other:
// triangles between the two, each with the shorter of the two edges that it may have.
void zip(const std::vector<Point>& polygon, std::size_t end, Triangles& out) {
  std::size_t i = 0, j = polygon.size() - 1;
  while (i < end || j > end + 1) {
    const bool first = j == end + 1 || (i < end && (polygon[i + 1] - polygon[j]).norm() <
                                                       (polygon[i] - polygon[j - 1]).norm());
    const std::size_t k = first ? i + 1 : j - 1;
    out.push_back(
        {static_cast<std::uint32_t>(i), static_cast<std::uint32_t>(k), static_cast<std::uint32_t>(j)});
    (first ? i : j) = k;
  }
}

std::vector<Point> points_of(const Mesh& mesh, const std::vector<std::uint32_t>& rim) {
  std::vector<Point> points;
  for (const auto v : rim) points.push_back(mesh.points[v]);
  return points;
}

// Twice the area that a polygon encloses, along the normal.
Vector area_vector(std::span<const Point> polygon) {
  Vector area = Vector::Zero();
  for (std::size_t k = 1; k + 1 < polygon.size(); k++)
    area += (polygon[k] - polygon[0]).cross(polygon[k + 1] - polygon[0]);
  return area;
}

// A rim and the plane across it.
struct FlatRim {
  std::vector<Point> points;
  Point middle = Point::Zero();
  Vector area = Vector::Zero();  // twice, along the normal
  double most_off = 0;           // from the plane: what lies off it by less counts as in it
  bool is_flat = false;

  FlatRim(const Mesh& mesh, const std::vector<std::uint32_t>& rim) : points(points_of(mesh, rim)) {
    for (const Point& p : points) middle += p / double(points.size());
    area = area_vector(points);
    most_off = kFlatRim * rim_length(mesh, rim);
    is_flat = area.norm() > 0 &&
              std::all_of(points.begin(), points.end(), [&](const Point& p) { return lies_in_plane(p); });
  }
  bool lies_in_plane(const Point& p) const {
    return std::abs(area.normalized().dot(p - points[0])) <= most_off;
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
  // Does each lie behind the other, about along one axis?
  bool faces_away_from(const FlatRim& other) const {
    return area.dot(other.area) < -0.9 * area.norm() * other.area.norm() &&
           area.dot(other.middle - middle) < 0 && other.area.dot(middle - other.middle) < 0 &&
           surrounds(other.middle) && other.surrounds(middle);
  }
};

constexpr std::size_t kMostRims = 1000;  // each is compared with each; a soup has more

std::vector<FlatRim> flat_rims(const Mesh& mesh, const std::vector<std::vector<std::uint32_t>>& rims) {
  std::vector<FlatRim> flat;
  for (const auto& rim : rims) flat.emplace_back(mesh, rim);
  return flat;
}

// Are both holes small in the piece that has them, as those of a wide tire are? Each is less than half as
// wide as the piece halfway between them, and they lie closer to each other than that is wide from its axis.
bool are_small_holes(const Mesh& mesh, const std::vector<std::uint32_t>& triangles, const FlatRim& a,
                     const FlatRim& b) {
  const Point halfway = (a.middle + b.middle) / 2;
  const double between = (b.middle - a.middle).norm();
  const Vector axis = (b.middle - a.middle) / between;
  const auto from_axis = [&](const Point& p) { return axis.cross(p - halfway).norm(); };
  double rim = 0, room = std::numeric_limits<double>::infinity();
  for (const FlatRim* one : {&a, &b})
    for (const Point& p : one->points) rim = std::max(rim, from_axis(p));
  for (const auto t : triangles)
    for (int k = 0; k < 3; k++) {
      const Point &p = mesh.corner(t, k), &q = mesh.corner(t, (k + 1) % 3);
      const double x = axis.dot(p - halfway), y = axis.dot(q - halfway);
      if ((x < 0) != (y < 0)) room = std::min(room, from_axis(p + x / (x - y) * (q - p)));
    }
  return std::isfinite(room) && rim < kSmallHoles * room && between < room;
}

std::array<std::uint32_t, 2> nearest_points(const Mesh& mesh, const std::vector<std::uint32_t>& one,
                                            const std::vector<std::uint32_t>& other) {
  std::array<std::uint32_t, 2> nearest{};
  double least = std::numeric_limits<double>::infinity();
  for (const auto a : one)
    for (const auto b : other)
      if (const double away = (mesh.points[b] - mesh.points[a]).norm(); away < least)
        least = away, nearest = {a, b};
  return nearest;
}

}  // namespace

std::vector<Ring> find_rings(const Mesh& mesh, const std::vector<std::vector<std::uint32_t>>& rims) {
  std::vector<Ring> rings;
  if (rims.size() > kMostRims) return rings;
  const std::vector<FlatRim> flat = flat_rims(mesh, rims);
  for (std::size_t inner = 0; inner < rims.size(); inner++) {
    if (!flat[inner].is_flat) continue;
    std::size_t outer = rims.size();  // the smallest one around it
    for (std::size_t k = 0; k < rims.size(); k++)
      if (flat[k].is_flat && (outer == rims.size() || flat[k].area.norm() < flat[outer].area.norm()) &&
          flat[k].surrounds(flat[inner]))
        outer = k;
    if (outer == rims.size()) continue;
    const Ring ring{outer, inner, nearest_points(mesh, rims[outer], rims[inner]),
                    flat[outer].area.dot(flat[inner].area) > 0};
    const double least = (mesh.points[ring.bridge[1]] - mesh.points[ring.bridge[0]]).norm();
    if (ring.alike && least < kThinRing * rim_length(mesh, rims[inner])) continue;
    rings.push_back(ring);
  }
  return rings;
}

std::vector<std::array<std::uint32_t, 2>> find_bands(const Mesh& mesh,
                                                     const std::vector<std::vector<std::uint32_t>>& rims,
                                                     const std::vector<std::uint32_t>& piece,
                                                     const PieceTriangles& triangles_of) {
  struct Band {
    double seen;  // the solid angle of both holes from halfway between them
    std::size_t a, b;
  };
  std::vector<Band> bands;
  if (rims.size() > kMostRims) return {};
  const std::vector<FlatRim> flat = flat_rims(mesh, rims);
  const auto solid_angle_of = [&](const std::vector<std::uint32_t>& rim, const Point& from) {
    double sum = 0;
    for (std::size_t k = 1; k + 1 < rim.size(); k++)
      sum += solid_angle(mesh, {rim[0], rim[k], rim[k + 1]}, from);
    return sum;
  };
  for (std::size_t a = 0; a < rims.size(); a++)
    for (std::size_t b = 0; b < a; b++) {
      if (piece[a] == ~0u || piece[a] != piece[b] || !flat[a].is_flat || !flat[b].is_flat ||
          !flat[a].faces_away_from(flat[b]))
        continue;
      const Point halfway = (flat[a].middle + flat[b].middle) / 2;
      const double seen = solid_angle_of(rims[a], halfway) + solid_angle_of(rims[b], halfway);
      if (1 - seen < 0.5 || are_small_holes(mesh, triangles_of.at(piece[a]), flat[a], flat[b]))
        bands.push_back({seen, a, b});
    }
  std::stable_sort(bands.begin(), bands.end(),
                   [](const Band& one, const Band& other) { return one.seen > other.seen; });
  std::vector<char> taken(rims.size());
  std::vector<std::array<std::uint32_t, 2>> bridges;
  for (const Band& band : bands) {
    if (taken[band.a] || taken[band.b]) continue;
    taken[band.a] = taken[band.b] = true;
    bridges.push_back(nearest_points(mesh, rims[band.a], rims[band.b]));
  }
  return bridges;
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
  const std::vector<Point> polygon = points_of(mesh, rim);
  const std::size_t distinct = std::set<std::uint32_t>(rim.begin(), rim.end()).size();
  const bool one = distinct == rim.size(), two = distinct + 2 == rim.size();
  // Where two were joined, the plane is that across the first.
  const auto end = static_cast<std::size_t>(std::find(rim.begin() + 1, rim.end(), rim[0]) - rim.begin());
  const Vector normal = area_vector(std::span(polygon).first(two ? end : polygon.size())).normalized();
  double low = 0, high = 0;
  for (const Point& p : polygon) {
    const double d = normal.dot(p - polygon[0]);
    low = std::min(low, d), high = std::max(high, d);
  }
  const bool is_flat = high - low <= kFlatRim * rim_length(mesh, rim);
  Triangles out;
  if (two && !(is_flat && rim.size() <= kLongRim))
    zip(polygon, end, out);
  else if (rim.size() > 3 && rim.size() <= kLongRim && !(one && is_flat))
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
