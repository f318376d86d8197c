// SPDX-License-Identifier: MIT
#include <cstdio>

#include "padding/by_tolerance/cover_mesh.h"

int main() {
  padder::Mesh mesh;  // a tetrahedron
  mesh.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  const padder::Cluster cluster = padder::cover_mesh(mesh, padder::Length::share(0.05));
  std::printf("%zu spheres, protrusion %.4f, gap %.4f, certified: %d\n", cluster.size(),
              cluster.accuracy.protrusion_max, cluster.accuracy.gap_max, cluster.accuracy.certified);
  return cluster.accuracy.certified && cluster.size() > 4 ? 0 : 1;
}
