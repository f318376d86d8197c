// SPDX-License-Identifier: MIT
// Meshes with a closed form, for tests.
#pragma once
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "padding/asset/mesh.h"

namespace padder::shapes {

// Axis-aligned box from `low` to `high`, each face an n x n grid of two triangles a cell.
inline Mesh box(const Point& low, const Point& high, int n = 1) {
  Mesh mesh;
  std::map<std::array<int, 3>, std::uint32_t> index;
  const auto vertex = [&](std::array<int, 3> g) {
    const auto [at, fresh] = index.try_emplace(g, static_cast<std::uint32_t>(mesh.points.size()));
    if (fresh) mesh.points.push_back(low + Vector(g[0], g[1], g[2]).cwiseProduct(high - low) / n);
    return at->second;
  };
  for (int axis = 0; axis < 3; axis++)
    for (int side = 0; side < 2; side++)
      for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
          const auto corner = [&](int di, int dj) {
            std::array<int, 3> g;
            g[axis] = side * n, g[(axis + 1) % 3] = i + di, g[(axis + 2) % 3] = j + dj;
            return vertex(g);
          };
          const auto a = corner(0, 0), b = corner(1, 0), c = corner(1, 1), d = corner(0, 1);
          if (side)
            mesh.triangles.push_back({a, b, c}), mesh.triangles.push_back({a, c, d});
          else
            mesh.triangles.push_back({a, c, b}), mesh.triangles.push_back({a, d, c});
        }
  return mesh;
}

// One of the six faces of a unit cube, an n x n grid.
inline Mesh face_of_cube(int face, int n) {
  Mesh cube = box({0, 0, 0}, {1, 1, 1}, n);
  std::erase_if(cube.triangles, [&](const auto& t) {
    for (const auto v : t)
      if (cube.points[v][face / 2] != double(face % 2)) return true;
    return false;
  });
  return cube;
}

// Sphere of radius 1 around the origin: an octahedron whose triangles are split in four `levels` times.
inline Mesh sphere(int levels) {
  Mesh mesh{{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}},
            {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}}};
  for (int level = 0; level < levels; level++) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middles;
    const auto middle = [&](std::uint32_t u, std::uint32_t v) {
      const auto [at, fresh] = middles.try_emplace({std::min(u, v), std::max(u, v)},
                                                   static_cast<std::uint32_t>(mesh.points.size()));
      if (fresh) mesh.points.push_back((mesh.points[u] + mesh.points[v]).normalized());
      return at->second;
    };
    std::vector<std::array<std::uint32_t, 3>> finer;
    for (const auto [a, b, c] : mesh.triangles) {
      const auto ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    }
    mesh.triangles = std::move(finer);
  }
  return mesh;
}

// Number k of n points on a circle around z, at this height.
inline Point on_circle(double k, double n, double radius = 1, double z = 0) {
  const double angle = 2 * std::numbers::pi * k / n;
  return {radius * std::cos(angle), radius * std::sin(angle), z};
}
// Area of a regular polygon with n corners on a circle.
inline double polygon_area(int n, double radius) {
  return 0.5 * n * radius * radius * std::sin(2 * std::numbers::pi / n);
}

// Adds two triangles on four points, given in turn.
inline void add_quad(Mesh& mesh, std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
  mesh.triangles.push_back({a, b, c}), mesh.triangles.push_back({a, c, d});
}

// Torus around z: tube of radius `minor` about a circle of radius `major`, n x m quads.
inline Mesh torus(double major, double minor, int n, int m) {
  Mesh mesh;
  for (int i = 0; i < n; i++)
    for (int j = 0; j < m; j++) {
      const double v = 2 * std::numbers::pi * j / m;
      mesh.points.push_back(on_circle(i, n, major + minor * std::cos(v), minor * std::sin(v)));
      const auto at = [&](int k, int l) { return static_cast<std::uint32_t>((k % n) * m + l % m); };
      add_quad(mesh, at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
    }
  return mesh;
}

// A grid of n x m quads, whose corners are at(i, j) for i from 0 to n and j from 0 to m.
template <class At>
Mesh grid(int n, int m, const At& at) {
  Mesh mesh;
  for (int i = 0; i <= n; i++)
    for (int j = 0; j <= m; j++) mesh.points.push_back(at(i, j));
  const auto index = [&](int i, int j) { return static_cast<std::uint32_t>(i * (m + 1) + j); };
  for (int i = 0; i < n; i++)
    for (int j = 0; j < m; j++)
      add_quad(mesh, index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1));
  return mesh;
}
// Two triangles, or 2 n^2, on the square [0, side]^2 at z = 0, seen from above.
inline Mesh square(double side, int n = 1) {
  return grid(n, n, [&](int i, int j) { return Point(side * i / n, side * j / n, 0); });
}

// A cone of height 1 on a base of radius 1, each of n triangles around its middle: the tip, which is point 0,
// and the origin, which is point 1. The rim is bent up and down n / 4 times by `bend`.
inline Mesh cone(std::uint32_t n, double bend = 0) {
  Mesh mesh{{{0, 0, 1}, {0, 0, 0}}, {}};
  for (std::uint32_t k = 0; k < n; k++) {
    mesh.points.push_back(on_circle(k, n, 1, k % 4 < 2 ? bend : 0));
    const std::uint32_t a = 2 + k, b = 2 + (k + 1) % n;
    mesh.triangles.push_back({0, a, b}), mesh.triangles.push_back({1, b, a});
  }
  return mesh;
}

// A plate of length 1, cut into n strips of this width.
inline Mesh strips(std::uint32_t n, double width, double height) {
  Mesh mesh;
  const std::uint32_t m = 2 * (n + 1), e = 2 * n;
  for (const double z : {0.0, height})
    for (std::uint32_t k = 0; k <= n; k++)
      for (const double x : {0.0, 1.0}) mesh.points.push_back({x, k * width, z});
  for (std::uint32_t a = 0; a < e; a += 2) {
    add_quad(mesh, a, a + 2, a + 3, a + 1), add_quad(mesh, m + a, m + a + 1, m + a + 3, m + a + 2);
    add_quad(mesh, a, m + a, m + a + 2, a + 2), add_quad(mesh, a + 1, a + 3, m + a + 3, m + a + 1);
  }
  add_quad(mesh, 0, 1, m + 1, m), add_quad(mesh, e, m + e, m + e + 1, e + 1);
  return mesh;
}

// Every point p at where(p), which is a Point.
template <class Where>
Mesh mapped(Mesh mesh, const Where& where) {
  for (Point& p : mesh.points) p = where(Point(p));
  return mesh;
}
inline Mesh moved(const Mesh& mesh, const Vector& by) {
  return mapped(mesh, [&](const Point& p) -> Point { return p + by; });
}
inline Mesh moved(const Mesh& mesh, const Eigen::Matrix3d& turn, const Vector& by) {
  return mapped(mesh, [&](const Point& p) -> Point { return turn * p + by; });
}
inline Mesh scaled(const Mesh& mesh, double by) {  // about the origin
  return mapped(mesh, [&](const Point& p) -> Point { return by * p; });
}

// Moved and scaled: the middle of the bounding box at the origin, its diagonal 1.
inline Mesh unit(const Mesh& mesh) {
  const Box box = mesh.bounds();
  return mapped(mesh, [&](const Point& p) -> Point { return (p - box.center()) / box.diagonal(); });
}

// Copies of a sheet side by side, from z = 0 up to just below the height.
inline Mesh stack(const Mesh& sheet, int copies, double height) {
  Mesh mesh;
  for (int k = 0; k < copies; k++) mesh.add(moved(sheet, {0, 0, height * k / copies}));
  return mesh;
}

// The triangles of both.
inline Mesh joined(Mesh mesh, const Mesh& more) {
  mesh.add(more);
  return mesh;
}

// Without the triangles for which all corners satisfy `gone`.
template <class Gone>
Mesh without(Mesh mesh, const Gone& gone) {
  std::erase_if(mesh.triangles, [&](const auto& t) {
    return std::all_of(t.begin(), t.end(), [&](auto v) { return gone(mesh.points[v]); });
  });
  return mesh;
}

inline Mesh turned_over(Mesh mesh) {
  for (auto& t : mesh.triangles) std::swap(t[1], t[2]);
  return mesh;
}

// Two triangles in a plane across y, from `a` to `b` in x and z. They bound nothing.
inline Mesh fin(const Point& a, const Point& b) {
  return {{{a.x(), a.y(), a.z()}, {b.x(), a.y(), a.z()}, {b.x(), a.y(), b.z()}, {a.x(), a.y(), b.z()}},
          {{0, 1, 2}, {0, 2, 3}}};
}

inline double volume(const Mesh& mesh) { return mass_properties(mesh).volume; }
inline bool in_box(const Point& p, const Point& low, const Point& high) {
  return (p.array() > low.array()).all() && (p.array() < high.array()).all();
}

// Has each directed edge exactly one partner in the other direction?
inline bool closed_manifold(const Mesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  for (const auto& t : mesh.triangles)
    for (int k = 0; k < 3; k++) edges[{t[k], t[(k + 1) % 3]}]++;
  for (const auto& [edge, times] : edges)
    if (const auto back = edges.find({edge.second, edge.first});
        times != 1 || back == edges.end() || back->second != 1)
      return false;
  return true;
}

// The winding number of a closed surface, by brute force: the sum of the solid angles of its triangles seen
// from p, over 4 pi (Van Oosterom and Strackee, The solid angle of a plane triangle, 1983). Needs no ray, no
// tree and no normals at edges.
inline double winding(const Mesh& mesh, const Point& p) {
  double sum = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); t++) {
    const Vector a = mesh.corner(t, 0) - p, b = mesh.corner(t, 1) - p, c = mesh.corner(t, 2) - p;
    const double x = a.norm(), y = b.norm(), z = c.norm();
    sum += 2 * std::atan2(a.dot(b.cross(c)), x * y * z + a.dot(b) * z + b.dot(c) * x + c.dot(a) * y);
  }
  return sum / (4 * std::numbers::pi);
}

}  // namespace padder::shapes
