// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/meshing/holes/cracks.h"

#include <gtest/gtest.h>

#include "padding/geometry/indices.h"
#include "tests/padding/shapes.h"

namespace padder {
namespace {

// A cone without its tip, open where that was, in a circle of this radius. Its points are numbered round the
// circle or against it.
Mesh open_cone(double radius, bool against) {
  constexpr std::uint32_t n = 36;
  Mesh mesh;
  const auto corner = [&](std::uint32_t k) { return n + (against ? n - 1 - k % n : k % n); };
  mesh.points.resize(2 * n + 1, Point::Zero());
  for (std::uint32_t k = 0; k < n; k++) {
    mesh.points[k] = shapes::on_circle(k, n), mesh.points[corner(k)] = shapes::on_circle(k, n, radius, 1);
    shapes::add_quad(mesh, k, (k + 1) % n, corner(k + 1), corner(k));
    mesh.triangles.push_back({(k + 1) % n, k, 2 * n});
  }
  return mesh;
}

TEST(Cracks, APinholeIsNone) {
  constexpr double width = 1e-4;
  for (const double radius : {0.1, 0.4, 0.6, 2.0})
    for (const bool against : {false, true}) {
      const Mesh mesh = open_cone(radius * width, against);
      std::vector<DirectedEdge> missing = missing_edges(mesh, numbered(mesh.triangles.size()));
      EXPECT_EQ(missing.size(), 36u);
      EXPECT_TRUE(close_cracks(mesh, missing, width).empty()) << radius << ' ' << against;
      EXPECT_EQ(missing.size(), 36u);
    }
}

// The same rim with that of another piece beside it bounds a crack, however small it is.
TEST(Cracks, ASmallRimBesideAnotherIsOne) {
  constexpr double width = 1e-4;
  Mesh mesh = open_cone(0.3 * width, false);
  mesh.add(shapes::mapped(shapes::turned_over(open_cone(0.3 * width, true)),
                          [](const Point& p) { return Point(p.x(), p.y(), 2 + 0.01 * width - p.z()); }));
  std::vector<DirectedEdge> missing = missing_edges(mesh, numbered(mesh.triangles.size()));
  EXPECT_EQ(missing.size(), 72u);
  EXPECT_FALSE(close_cracks(mesh, missing, width).empty());
}

}  // namespace
}  // namespace padder
