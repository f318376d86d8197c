// SPDX-License-Identifier: GPL-3.0-or-later
// A mesh that is drawn from a seed: unions of boxes, balls, rings and tetrahedra, whole or damaged in the
// ways in which files are damaged.
#pragma once
#include <algorithm>
#include <string>

#include "tests/padding/random_input.h"

namespace padder::audit {

class RandomMesh {
 public:
  explicit RandomMesh(std::uint64_t seed) : random_(seed) {
    const int parts = 1 + below(3);
    const bool lattice = chance(0.4);  // faces that coincide, edges that meet
    for (int k = 0; k < parts; k++) place(lattice);
    // With numbers of its own: what the other seeds give stays.
    if (shapes::RandomInput other(~seed); other.uniform(0, 1) < 0.15) place_cells(other);
    for (int k = below(5); k > 0 && !chance(0.3); k--) damage();
    if (chance(0.1)) stretch();
    if (chance(0.1)) to_other_numbers();
  }
  const Mesh& mesh() const { return mesh_; }
  const std::string& story() const { return story_; }
  int below(int n) { return std::min(n - 1, static_cast<int>(random_.uniform(0, n))); }
  bool chance(double p) { return random_.uniform(0, 1) < p; }

 private:
  void tell(const std::string& what) { story_ += (story_.empty() ? "" : ", ") + what; }

  Mesh part() {
    switch (below(4)) {
      case 0:
        tell("box");
        return shapes::box({-1, -1, -1}, {1, 1, 1}, 1 + below(3));
      case 1:
        tell("ball");
        return shapes::sphere(below(2));
      case 2:
        tell("ring");
        return shapes::torus(1, random_.uniform(0.2, 0.9), 6 + below(8), 4 + below(5));
      default:
        tell("tetrahedron");
        return {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}}};
    }
  }

  void place(bool lattice) {
    Mesh made = part();
    const Eigen::Matrix3d turn = lattice ? Eigen::Matrix3d(Eigen::Matrix3d::Identity()) : random_.rotation();
    const auto length = [&] { return lattice ? 0.5 * (1 + below(3)) : random_.uniform(0.3, 1.5); };
    const Vector size(length(), length(), chance(0.1) ? 1e-3 : length());
    const Point at = lattice ? Point(below(3), below(3), below(2)) : random_.point(1.2);
    for (Point& p : made.points) p = turn * p.cwiseProduct(size) + at;
    const bool inward = chance(0.1);
    if (inward) tell("inward");
    mesh_.add(inward ? shapes::turned_over(std::move(made)) : made);
  }

  // Boxes that share walls, whose triangles face either way.
  void place_cells(shapes::RandomInput& other) {
    tell("cells");
    const Vector size(other.uniform(0.3, 1), other.uniform(0.3, 1), other.uniform(0.3, 1));
    const Eigen::Matrix3d turn = other.rotation();
    const Point at = other.point(0.8);
    for (int k = 0; k < 8; k++) {
      if (other.uniform(0, 1) < 0.3) continue;
      const Point low(k % 2, k / 2 % 2, k / 4);
      mesh_.add(shapes::box(low, low + Vector(1, 1, 1)));
      for (std::size_t v = mesh_.points.size() - 8; v < mesh_.points.size(); v++)
        mesh_.points[v] = turn * mesh_.points[v].cwiseProduct(size) + at;
    }
    const bool either_way = other.uniform(0, 1) < 0.7;
    for (auto& t : mesh_.triangles)
      if (either_way && other.uniform(0, 1) < 0.5) std::swap(t[1], t[2]);
  }

  std::size_t any() { return static_cast<std::size_t>(below(static_cast<int>(mesh_.triangles.size()))); }
  int some() { return 1 + below(1 + static_cast<int>(mesh_.triangles.size()) / 10); }

  void damage() {
    switch (below(8)) {
      case 0:
        tell("holes");
        for (int k = some(); k > 0 && mesh_.triangles.size() > 2; k--)
          mesh_.triangles.erase(mesh_.triangles.begin() + static_cast<std::ptrdiff_t>(any()));
        break;
      case 1:
        tell("turned triangles");
        for (int k = some(); k > 0; k--) {
          auto& t = mesh_.triangles[any()];
          std::swap(t[0], t[1]);
        }
        break;
      case 2:
        tell("triangles twice");
        for (int k = some(); k > 0; k--) mesh_.triangles.push_back(mesh_.triangles[any()]);
        break;
      case 3:
        tell("apart");
        apart(chance(0.5) ? 0 : std::pow(10, random_.uniform(-12, -2)));
        break;
      case 4:
        tell("shaken");
        for (Point& p : mesh_.points) p += random_.point(std::pow(10, random_.uniform(-12, -1)));
        break;
      case 5:
        tell("T-junctions");
        for (int k = some(); k > 0; k--) cut(any());
        break;
      case 6:
        tell("without area");
        for (int k = some(); k > 0; k--) {
          const auto t = mesh_.triangles[any()];
          mesh_.triangles.push_back({t[0], t[1], chance(0.5) ? t[0] : t[1]});
        }
        break;
      default:
        tell("loose triangles");
        for (int k = 1 + below(4); k > 0; k--)
          mesh_.add({random_.point(1.5), random_.point(1.5), random_.point(1.5)});
    }
  }

  // Each triangle gets points of its own, off by up to `width`.
  void apart(double width) {
    std::vector<Point> points;
    for (auto& t : mesh_.triangles)
      for (std::uint32_t& v : t) {
        points.push_back(mesh_.points[v] + random_.point(width));
        v = static_cast<std::uint32_t>(points.size() - 1);
      }
    mesh_.points = std::move(points);
  }

  // A point on an edge, which the neighbour does not know.
  void cut(std::size_t at) {
    const auto [a, b, c] = mesh_.triangles[at];
    const auto middle = static_cast<std::uint32_t>(mesh_.points.size());
    const double u = random_.uniform(0, 1);
    mesh_.points.push_back((1 - u) * mesh_.points[a] + u * mesh_.points[b]);
    mesh_.triangles[at] = {a, middle, c};
    mesh_.triangles.push_back({middle, b, c});
  }

  void stretch() {
    tell("stretched");
    const double by = std::pow(10, random_.uniform(-2, 2));
    for (Point& p : mesh_.points) p.x() *= by;
  }

  void to_other_numbers() {
    const double scale = std::pow(10, random_.uniform(-30, 30)), shift = std::pow(10, random_.uniform(0, 7));
    tell("other numbers");
    for (Point& p : mesh_.points) p = scale * (p + shift * Vector(1, -1, 2));
  }

  shapes::RandomInput random_;
  Mesh mesh_;
  std::string story_;
};

}  // namespace padder::audit
