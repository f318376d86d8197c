// SPDX-License-Identifier: GPL-3.0-or-later
#include <cstdio>

#include "padding/export/export.h"
#include "padding/import/import.h"
#include "padding/pad.h"

int main() {
  padder::ReadResult file;  // a tetrahedron, as if read from a file
  file.mesh.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  file.mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  file.source.file = "tetrahedron";
  padder::PadOptions options;
  options.tolerance = padder::Length::share(0.05);
  const padder::Cluster cluster = padder::pad(file, options).cluster;
  padder::write_model(padder::model_of(cluster), "tetrahedron.npz", padder::find_format("tetrahedron.npz"));
  const std::size_t back = padder::read_spheres("tetrahedron.npz").size();
  std::printf("%zu spheres, volume %.3f\n", back, cluster.mass.volume);
  return back == cluster.size() && back > 4 ? 0 : 1;
}
