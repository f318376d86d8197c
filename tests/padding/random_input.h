// SPDX-License-Identifier: MIT
// Random input for property tests. Every test prints its seed, so that a failure can be made again.
#pragma once
#include <Eigen/Geometry>
#include <random>

#include "padding/asset/mesh.h"
#include "tests/padding/shapes.h"

namespace padder::shapes {

class RandomInput {
 public:
  explicit RandomInput(std::uint64_t seed) : engine_(seed) {}
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
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

// Triangles that are not joined, up to `spread` from the origin.
inline Mesh random_soup(RandomInput& random, int n, double spread, double size) {
  Mesh mesh;
  for (int k = 0; k < n; k++) {
    const Point at = random.point(spread);
    for (int j = 0; j < 3; j++) mesh.points.push_back(at + random.point(size));
    const auto v = static_cast<std::uint32_t>(3 * k);
    mesh.triangles.push_back({v, v + 1, v + 2});
  }
  return mesh;
}

// Each triangle with corners of its own, moved by up to `off`.
inline Mesh with_corners_off(const Mesh& mesh, double off) {
  RandomInput random(1);
  Mesh out;
  for (std::size_t t = 0; t < mesh.triangles.size(); t++) {
    const auto first = static_cast<std::uint32_t>(out.points.size());
    for (int k = 0; k < 3; k++) out.points.push_back(mesh.corner(t, k) + off * random.direction());
    out.triangles.push_back({first, first + 1, first + 2});
  }
  return out;
}

}  // namespace padder::shapes
