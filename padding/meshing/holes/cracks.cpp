// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/meshing/holes/cracks.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <map>
#include <unordered_map>
#include <utility>

#include "padding/meshing/holes/corner_tree.h"

namespace padder {
namespace {

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

std::vector<std::uint32_t> all_ends(const std::vector<DirectedEdge>& edges) {
  std::vector<std::uint32_t> ends;
  for (const DirectedEdge& e : edges) ends.push_back(e.from), ends.push_back(e.to);
  return ends;
}

// Takes the rims from `missing` that fit within the width, with no other border so near. These are holes, as
// that of a cone without its tip, and no cracks, though each of their edges runs beside all the others.
std::vector<DirectedEdge> take_pinholes(const Mesh& mesh, std::vector<DirectedEdge>& missing, double width) {
  constexpr std::size_t none = ~std::size_t(0), many = none - 1;
  std::unordered_map<std::uint32_t, std::size_t> after;  // the edge from a corner
  const CornerTree ends(mesh, all_ends(missing));
  for (std::size_t k = 0; k < missing.size(); k++)
    if (const auto [at, is_new] = after.emplace(missing[k].from, k); !is_new) at->second = many;
  std::vector<char> seen(missing.size(), 0), is_pinhole(missing.size(), 0);
  std::vector<std::uint32_t> near;
  for (std::size_t first = 0; first < missing.size(); first++) {
    std::vector<std::size_t> rim;
    Box box;
    std::size_t k = first;
    while (k < many && !seen[k]) {
      seen[k] = 1, rim.push_back(k), box.add(mesh.points[missing[k].from]);
      const auto next = after.find(missing[k].to);
      k = next == after.end() ? none : next->second;
    }
    if (k != first || rim.size() < 3 || box.diagonal() > 2 * width) continue;
    const Point middle = box.center();
    double radius = 0;
    for (const std::size_t e : rim) radius = std::max(radius, (mesh.points[missing[e].from] - middle).norm());
    near.clear();
    ends.tree.find(middle, radius + width, near);
    if (2 * radius <= width && near.size() == rim.size())
      for (const std::size_t e : rim) is_pinhole[e] = 1;
  }
  std::vector<DirectedEdge> pinholes, others;
  for (std::size_t k = 0; k < missing.size(); k++) (is_pinhole[k] ? pinholes : others).push_back(missing[k]);
  missing = std::move(others);
  return pinholes;
}

}  // namespace

double crack_limit(const RepairOptions& options, double diagonal) {
  const double share = options.tolerance > 0 ? kCrackShare * options.tolerance : diagonal;
  return std::min(kCrackWidth * diagonal, share);
}

std::vector<CrackTriangle> close_cracks(const Mesh& mesh, std::vector<DirectedEdge>& missing, double width) {
  const std::vector<DirectedEdge> pinholes = take_pinholes(mesh, missing, width);
  Needs needs;
  std::vector<std::uint32_t> begins;
  for (const DirectedEdge& e : missing) needs.add(e.from, e.to), begins.push_back(e.from);
  const auto [border, places, tree] = CornerTree(mesh, std::move(begins));
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
          if (all[j].vertex == to && all[j].at < all[k].at) all[j].on_way = all[k].on_way = true;
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
  missing.insert(missing.end(), pinholes.begin(), pinholes.end());
  return patch;
}

SplitEdges split_edges(const Mesh& mesh, const std::vector<std::uint32_t>& triangles,
                       const std::vector<DirectedEdge>& open, double width) {
  const CornerTree open_ends(mesh, all_ends(open));
  const std::vector<std::uint32_t>& ends = open_ends.corners;
  const std::vector<Point>& places = open_ends.places;
  const auto is_end = [&](std::uint32_t v) { return std::binary_search(ends.begin(), ends.end(), v); };
  SplitEdges out{mesh};
  std::unordered_map<std::uint64_t, std::vector<std::uint32_t>> on_edge;  // from its smaller vertex on
  std::vector<std::uint32_t> near;
  const std::vector<Side> sides = sides_of(mesh, triangles);
  for_edges(sides, [&](std::size_t begin, std::size_t end) {
    const auto e = ends_of(sides[begin].edge);
    if (!is_end(e[0]) || !is_end(e[1])) return;
    const Point& a = mesh.points[e[0]];
    const Vector along = mesh.points[e[1]] - a;
    near.clear();
    open_ends.tree.find(a + 0.5 * along, 0.5 * along.norm(), near);
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
        if (is_side[0]) found = on_edge.find(edge_of(c[0], c[1]));
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
  const auto [border, places, tree] = CornerTree(mesh, all_ends(missing));
  std::vector<std::uint32_t> to = numbered(mesh.points.size()), near;  // the first corner of those joined
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

}  // namespace padder
