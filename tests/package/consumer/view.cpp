// SPDX-License-Identifier: MIT
#include "padding/view/page.h"
#include "padding/view/picture.h"

int main(int, char** argv) {
  padder::Cluster cluster;
  cluster.name = "tetrahedron";
  cluster.centers = {{0.2, 0.2, 0.2}, {0.5, 0.1, 0.1}};
  cluster.radii = {0.2, 0.1};
  cluster.triangle = {-1, -1};
  padder::Mesh mesh;
  mesh.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  const padder::View view = padder::view_of(cluster, mesh);
  padder::PictureOptions small;
  small.width = 64, small.height = 32, small.samples = 1;
  padder::write_png(padder::render(view, small), "tetrahedron.png");
  padder::PageOptions page;
  page.script = argv[1];
  padder::write_page(view, "tetrahedron.html", page);
}
