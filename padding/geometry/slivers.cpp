// SPDX-License-Identifier: MIT
#include "padding/geometry/slivers.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "padding/geometry/indices.h"
#include "padding/geometry/triangle.h"

namespace padder {
namespace {

constexpr std::uint32_t kFan = 500;  // faces at the tip of a fan; 10,000 take the remesher half a minute

class Collapse {
 public:
  Collapse(const Mesh& mesh, double near) : mesh_(mesh), near_(near), around_(mesh.points.size()) {
    alive_.assign(mesh.triangles.size(), 1);
    for (std::uint32_t t = 0; t < mesh.triangles.size(); t++) {
      const Corners& c = mesh.triangles[t];
      if (c[0] == c[1] || c[1] == c[2] || c[2] == c[0]) alive_[t] = 0;
      for (const auto v : c) around_[v].push_back(t);
    }
  }

  Mesh run() {
    // A round may make new slivers out of the neighbours of old ones, each time fewer.
    constexpr int most_rounds = 20;
    for (int round = 0; round < most_rounds; round++) {
      const bool merged = merge_short_edges(), split = split_at_apexes();
      cancel_layers();
      if (!merged && !split) break;
    }
    return collect();
  }

  // Merges the edges under `longest` that face a point of at least so many triangles, where no plane moves by
  // more than `most`.
  Mesh merge_where_flat(double longest, double most, std::uint32_t least_faces) {
    while (merge_rims(longest, most, least_faces)) {
    }
    return collect();
  }

 private:
  // An edge, or a triangle, by the key that says when its turn is.
  struct Turn {
    double key;
    std::uint32_t a, b;
    bool operator<(const Turn& o) const { return key != o.key ? key < o.key : a != o.a ? a < o.a : b < o.b; }
  };

  bool merge_short_edges() {
    std::vector<Turn> edges;
    for (std::uint32_t t = 0; t < mesh_.triangles.size(); t++) {
      if (!alive_[t]) continue;
      // A flat triangle with an edge a little longer would hand its flatness round the ends of that edge.
      const double most = height(t) < near_ ? 2 * near_ : near_;
      for (int k = 0; k < 3; k++) {
        const auto u = mesh_.triangles[t][k], v = mesh_.triangles[t][(k + 1) % 3];
        const double length = (mesh_.points[u] - mesh_.points[v]).norm();
        if (length < most) edges.push_back({length, std::min(u, v), std::max(u, v)});
      }
    }
    return merge_all(std::move(edges), std::numeric_limits<double>::infinity());
  }

  bool merge_rims(double longest, double most, std::uint32_t least_faces) {
    std::vector<std::uint32_t> faces(mesh_.points.size(), 0);
    for (std::uint32_t t = 0; t < mesh_.triangles.size(); t++)
      for (const auto v : mesh_.triangles[t]) faces[v] += alive_[t];
    std::vector<Turn> rims;
    for (std::uint32_t t = 0; t < mesh_.triangles.size(); t++)
      for (int k = 0; k < 3 && alive_[t]; k++) {
        if (faces[mesh_.triangles[t][k]] < least_faces) continue;
        const auto u = mesh_.triangles[t][(k + 1) % 3], v = mesh_.triangles[t][(k + 2) % 3];
        const double length = (mesh_.points[u] - mesh_.points[v]).norm();
        if (length < longest) rims.push_back({length, std::min(u, v), std::max(u, v)});
      }
    return merge_all(std::move(rims), most);
  }

  // Merges each edge into the end that costs less, if that is less than `most`.
  bool merge_all(std::vector<Turn> edges, double most) {
    std::sort(edges.begin(), edges.end());
    bool any = false;
    std::vector<char> gone(mesh_.points.size(), 0);
    for (const Turn& e : edges) {
      if (gone[e.a] || gone[e.b]) continue;  // the next round looks at what the edge has become
      const double a_goes = cost(e.a, e.b), b_goes = cost(e.b, e.a);
      if (!(std::min(a_goes, b_goes) < most)) continue;
      const auto [kept, left] = a_goes < b_goes ? std::pair{e.b, e.a} : std::pair{e.a, e.b};
      if (std::isfinite(most) && makes_layers(left, kept)) continue;
      gone[left] = 1, any = true;
      merge(left, kept);
    }
    return any;
  }

  // How far the planes around v are from the point `to`, which is to take its place.
  double cost(std::uint32_t v, std::uint32_t to) const {
    double most = 0;
    for (const auto t : around_[v]) {
      if (!alive_[t] || !has(t, v) || height(t) < near_) continue;
      const Vector n = mesh_.area_normal(t);
      most = std::max(most, std::abs(n.dot(mesh_.points[to] - mesh_.points[v])) / n.norm());
    }
    return most;
  }

  // Would a triangle lie on another one, if `from` became `to`?
  bool makes_layers(std::uint32_t from, std::uint32_t to) const {
    std::vector<Corners> there;
    const auto sorted = [](Corners c) {
      std::sort(c.begin(), c.end());
      return c;
    };
    for (const auto t : around_[to])
      if (alive_[t] && has(t, to) && !has(t, from)) there.push_back(sorted(mesh_.triangles[t]));
    std::sort(there.begin(), there.end());
    return std::any_of(around_[from].begin(), around_[from].end(), [&](std::uint32_t t) {
      if (!alive_[t] || !has(t, from) || has(t, to)) return false;
      Corners c = mesh_.triangles[t];
      std::replace(c.begin(), c.end(), from, to);
      return std::binary_search(there.begin(), there.end(), sorted(c));
    });
  }

  void merge(std::uint32_t from, std::uint32_t to) {
    for (const auto t : around_[from]) {
      if (!alive_[t] || !has(t, from)) continue;
      Corners& c = mesh_.triangles[t];
      std::replace(c.begin(), c.end(), from, to);
      if (c[0] == c[1] || c[1] == c[2] || c[2] == c[0])
        alive_[t] = 0;
      else
        around_[to].push_back(t);
    }
    around_[from].clear();
  }

  // The corner across the longest edge is (longest + 2) % 3.
  int longest_edge(std::uint32_t t) const { return TrianglePart{mesh_.corners(t), t}.longest_edge().second; }

  double height(std::uint32_t t) const {
    const int k = longest_edge(t);
    const double length = (mesh_.corner(t, (k + 1) % 3) - mesh_.corner(t, k)).norm();
    return length > 0 ? 2 * mesh_.area_normal(t).norm() / length : 0;
  }

  // The triangle with the longest edge first. What lies beyond that edge is then no flat triangle with a
  // longer edge, whose parts would be these again, and so on in turns.
  bool split_at_apexes() {
    std::vector<Turn> flat;
    for (std::uint32_t t = 0; t < mesh_.triangles.size(); t++) {
      if (!alive_[t] || !(height(t) < near_)) continue;
      const int k = longest_edge(t);
      flat.push_back({-(mesh_.corner(t, (k + 1) % 3) - mesh_.corner(t, k)).norm(), t, 0});
    }
    std::sort(flat.begin(), flat.end());
    bool any = false;
    for (const Turn& f : flat) {
      const std::uint32_t t = f.a;
      if (!alive_[t] || !(height(t) < near_)) continue;
      const int k = longest_edge(t);
      const Corners c = mesh_.triangles[t];
      const std::uint32_t a = c[k], b = c[(k + 1) % 3], apex = c[(k + 2) % 3];
      alive_[t] = 0, any = true;
      const std::vector<std::uint32_t> beyond = around_[a];
      for (const auto s : beyond) {
        if (!alive_[s]) continue;
        if (!has(s, a) || !has(s, b)) continue;
        if (!has(s, apex))
          split(s, a, b, apex);
        else
          alive_[s] = 0;  // the same triangle once more
      }
    }
    return any;
  }

  bool has(std::uint32_t t, std::uint32_t v) const {
    const Corners& c = mesh_.triangles[t];
    return c[0] == v || c[1] == v || c[2] == v;
  }

  // Splits the edge from a to b of triangle s at the point v.
  void split(std::uint32_t s, std::uint32_t a, std::uint32_t b, std::uint32_t v) {
    Corners other = mesh_.triangles[s];
    std::replace(mesh_.triangles[s].begin(), mesh_.triangles[s].end(), b, v);
    std::replace(other.begin(), other.end(), a, v);
    around_[v].push_back(s);
    for (const auto u : other) around_[u].push_back(static_cast<std::uint32_t>(mesh_.triangles.size()));
    mesh_.triangles.push_back(other), alive_.push_back(1);
  }

  // Equal triangles that face apart cancel.
  void cancel_layers() {
    struct Layer {
      Corners sorted;
      std::uint32_t triangle;
      bool even;
    };
    std::vector<Layer> layers;
    for (std::uint32_t t = 0; t < mesh_.triangles.size(); t++) {
      if (!alive_[t]) continue;
      Corners c = mesh_.triangles[t];
      std::rotate(c.begin(), std::min_element(c.begin(), c.end()), c.end());
      const bool even = c[1] < c[2];
      std::sort(c.begin(), c.end());
      layers.push_back({c, t, even});
    }
    std::sort(layers.begin(), layers.end(), [](const Layer& a, const Layer& b) {
      return a.sorted != b.sorted ? a.sorted < b.sorted : a.triangle < b.triangle;
    });
    for (std::size_t k = 0, end; k < layers.size(); k = end) {
      int sum = 0;
      for (end = k; end < layers.size() && layers[end].sorted == layers[k].sorted; end++)
        sum += layers[end].even ? 1 : -1;
      const bool even = sum > 0;
      sum = std::abs(sum);
      for (std::size_t i = k; i < end; i++) alive_[layers[i].triangle] = layers[i].even == even && sum-- > 0;
    }
  }

  Mesh collect() const {
    Mesh out;
    out.points = mesh_.points;
    for (std::uint32_t t = 0; t < mesh_.triangles.size(); t++)
      if (alive_[t]) out.triangles.push_back(mesh_.triangles[t]);
    out.drop_unused_points();
    return out;
  }

  Mesh mesh_;
  const double near_;
  std::vector<std::vector<std::uint32_t>> around_;  // the triangles of each point, and some that are gone
  std::vector<char> alive_;
};

// A triangle at an edge, seen along it.
struct Page {
  std::uint64_t edge;
  std::uint32_t triangle;
  bool forward;  // it runs from the smaller index to the larger
  double angle;  // around the edge, counter-clockwise; set where the edge has more than two pages
};

double angle_around(const Mesh& mesh, const Page& page) {
  const auto [from, to] = ends_of(page.edge);
  std::uint32_t third = 0;
  for (const auto v : mesh.triangles[page.triangle])
    if (v != from && v != to) third = v;
  const Vector axis = (mesh.points[to] - mesh.points[from]).normalized();
  Vector x = axis.unitOrthogonal();
  const Vector d = mesh.points[third] - mesh.points[from];
  return std::atan2(axis.cross(x).dot(d), x.dot(d));
}

}  // namespace

Mesh without_slivers(const Mesh& mesh, double near) { return Collapse(mesh, near).run(); }

Mesh with_thinned_fans(const Mesh& mesh, double longest, double most) {
  std::vector<std::uint32_t> faces(mesh.points.size(), 0);
  for (const auto& t : mesh.triangles)
    for (const auto v : t)
      if (++faces[v] >= kFan) return Collapse(mesh, 0).merge_where_flat(longest, most, kFan);
  return mesh;
}

Mesh with_short_edges_merged(const Mesh& mesh, double longest, double most) {
  return Collapse(mesh, 0).merge_where_flat(longest, most, 0);
}

Mesh taken_apart(const Mesh& mesh) {
  std::vector<Page> pages;
  pages.reserve(3 * mesh.triangles.size());
  for (std::uint32_t t = 0; t < mesh.triangles.size(); t++)
    for (int k = 0; k < 3; k++) {
      const auto u = mesh.triangles[t][k], v = mesh.triangles[t][(k + 1) % 3];
      pages.push_back({edge_of(u, v), t, u < v, 0});
    }
  std::sort(pages.begin(), pages.end(), [](const Page& a, const Page& b) {
    return a.edge != b.edge ? a.edge < b.edge : a.triangle < b.triangle;
  });
  // Corners that stay together have one root.
  std::vector<std::uint32_t> parent = numbered(3 * mesh.triangles.size());
  const auto join_pages = [&](const Page& a, const Page& b) {
    for (const auto v : ends_of(a.edge))
      join(parent, corner_with(mesh.triangles, a.triangle, v), corner_with(mesh.triangles, b.triangle, v));
  };
  for (std::size_t k = 0, end; k < pages.size(); k = end) {
    for (end = k; end < pages.size() && pages[end].edge == pages[k].edge;) end++;
    if (end - k == 2 && pages[k].forward != pages[k + 1].forward) join_pages(pages[k], pages[k + 1]);
    if (end - k <= 2) continue;
    const auto first = pages.begin() + static_cast<std::ptrdiff_t>(k),
               last = pages.begin() + static_cast<std::ptrdiff_t>(end);
    for (auto page = first; page != last; ++page) page->angle = angle_around(mesh, *page);
    std::sort(first, last, [](const Page& a, const Page& b) {
      return a.angle != b.angle ? a.angle < b.angle : a.triangle < b.triangle;
    });
    // The body lies on the far side of a page that runs backward, and on the near side of one that runs
    // forward.
    for (std::size_t i = k; i < end; i++) {
      const Page &a = pages[i], &b = pages[i + 1 < end ? i + 1 : k];
      if (!a.forward && b.forward) join_pages(a, b);
    }
  }
  Mesh out;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); t++) {
    for (const Point& p : mesh.corners(t)) out.points.push_back(p);
    out.triangles.push_back({root_of(parent, 3 * t), root_of(parent, 3 * t + 1), root_of(parent, 3 * t + 2)});
  }
  out.drop_unused_points();
  return out;
}

}  // namespace padder
