// SPDX-License-Identifier: MIT
// Random input for property tests. A failure names the seed, so that it can be made again.
#pragma once
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <random>
#include <string>

#include "padding/asset/mesh.h"
#include "tests/padding/shapes.h"

namespace padder::shapes {

class RandomInput {
 public:
  explicit RandomInput(std::uint64_t seed)
      : engine_(seed), seed_(__FILE__, __LINE__, "seed " + std::to_string(seed)) {}
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  std::size_t below(std::size_t n) {
    return static_cast<std::size_t>(uniform(0, 1) * static_cast<double>(n));
  }
  Point in(const Box& box) {
    Point p;
    for (int axis = 0; axis < 3; axis++) p[axis] = uniform(box.low[axis], box.high[axis]);
    return p;
  }
  Point on(const Mesh& mesh, std::size_t t) {
    double u = uniform(0, 1), v = uniform(0, 1);
    if (u + v > 1) u = 1 - u, v = 1 - v;
    const Point& a = mesh.corner(t, 0);
    return a + u * (mesh.corner(t, 1) - a) + v * (mesh.corner(t, 2) - a);
  }
  Point point(double size = 1) { return {uniform(-size, size), uniform(-size, size), uniform(-size, size)}; }
  Vector direction() {
    std::normal_distribution<double> normal;
    return Vector(normal(engine_), normal(engine_), normal(engine_)).normalized();
  }
  Eigen::Matrix3d rotation() {
    return Eigen::AngleAxisd(uniform(0, 2 * std::numbers::pi), direction()).toRotationMatrix();
  }

 private:
  std::mt19937_64 engine_;
  ::testing::ScopedTrace seed_;
};

// A closed body without symmetry: a sphere whose radius swells and shrinks with a few random waves.
inline Mesh blob(RandomInput& random, int levels = 4) {
  Mesh mesh = sphere(levels);
  struct Wave {
    Vector k;
    double phase, height;
  };
  std::vector<Wave> waves;
  for (int w = 0; w < 5; w++)
    waves.push_back(
        {random.direction() * random.uniform(1, 4), random.uniform(0, 6), random.uniform(0.02, 0.1)});
  const Vector stretch(random.uniform(0.6, 1.4), random.uniform(0.6, 1.4), random.uniform(0.6, 1.4));
  for (Point& p : mesh.points) {
    double r = 1;
    for (const auto& w : waves) r += w.height * std::sin(w.k.dot(p) + w.phase);
    p = (r * p).cwiseProduct(stretch);
  }
  return mesh;
}

// Every corner moved by up to `off`.
inline Mesh roughened(Mesh mesh, double off, RandomInput& random) {
  for (Point& p : mesh.points) p += off * random.direction();
  return mesh;
}

// Triangles that are not joined, up to `spread` from the origin.
inline Mesh random_soup(RandomInput& random, int n, double spread, double size) {
  Mesh mesh;
  for (int k = 0; k < n; k++) {
    const Point at = random.point(spread);
    mesh.add({at + random.point(size), at + random.point(size), at + random.point(size)});
  }
  return mesh;
}

// Each triangle with corners of its own, moved by up to `off`.
inline Mesh with_corners_off(const Mesh& mesh, double off) {
  RandomInput random(1);
  Mesh out;
  for (std::size_t t = 0; t < mesh.triangles.size(); t++) {
    auto corners = mesh.corners(t);
    for (Point& p : corners) p += off * random.direction();
    out.add(corners);
  }
  return out;
}

}  // namespace padder::shapes
