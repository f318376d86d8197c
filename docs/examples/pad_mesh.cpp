// SPDX-License-Identifier: GPL-3.0-or-later
// Pads a mesh file through the library: reads it, covers it within a tolerance, and writes the cluster of
// spheres in two formats.
//   pad_mesh MESH [TOLERANCE]      TOLERANCE as 2% of the diagonal, or as a length in the mesh's unit
#include <cstdio>
#include <exception>
#include <string>

#include "padding/export/export.h"
#include "padding/pad.h"

int main(int argc, char** argv) try {
  const std::string file = argc > 1 ? argv[1] : "assets/grain.obj";
  padder::PadOptions options;
  const auto tolerance = padder::length_of(argc > 2 ? argv[2] : "2%");
  if (!tolerance) {
    std::fprintf(stderr, "the tolerance is no length: write 2%% or 0.01\n");
    return 2;
  }
  options.tolerance = *tolerance;

  const padder::Padded padded = padder::pad_file(file, {}, options);

  const padder::Cluster& cluster = padded.cluster;
  std::printf("%zu spheres cover %s\n", cluster.size(), file.c_str());
  // Protrusion: how far a sphere stands out of the mesh. Gap: how far the mesh stands out of the spheres.
  std::printf("protrusion at most %.3g, gap at most %.3g, %s\n", cluster.accuracy.protrusion_bound,
              cluster.accuracy.gap_bound,
              cluster.accuracy.certified ? "both proved" : padded.report.reason.c_str());
  std::printf("volume of the mesh %.3g; the first sphere has the radius %.3g\n", cluster.mass.volume,
              cluster.radii[0]);

  padder::write_cluster(cluster, "example.spheres.json");  // with everything that is known of it
  // Formats of other programs: the ending of the name chooses one; docs/formats.md lists them.
  const char* table = "example.csv";
  padder::write_model(padder::model_of(cluster), table, padder::find_format(table));
  return 0;
} catch (const std::exception& error) {  // padder::Error: one sentence that names the file and the place
  std::fprintf(stderr, "pad_mesh: %s\n", error.what());
  return 1;
}
