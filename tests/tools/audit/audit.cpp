// SPDX-License-Identifier: GPL-3.0-or-later
// audit MESH CLUSTER [POINTS [SEED [SURFACE [MOVED]]]]: says whether the report in a cluster is true, by the
// means of measure.h. SURFACE is what `pad --write-mesh` wrote, MOVED how far it moved corners. The volume of
// the raw triangles' inside is printed beside the one in the cluster, and how far the inertia in the cluster
// is from that of this inside.
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "padding/asset/error.h"
#include "padding/input/read.h"
#include "tests/tools/audit/measure.h"

int main(int argc, char** argv) try {
  if (argc < 3) {
    std::fprintf(stderr, "usage: audit MESH CLUSTER [POINTS [SEED [SURFACE [MOVED]]]]\n");
    return 2;
  }
  const padder::Mesh mesh = padder::read_mesh(argv[1]).mesh;
  const padder::Cluster cluster = padder::read_cluster(argv[2]);
  padder::Mesh surface;
  if (argc > 5) surface = padder::read_mesh(argv[5]).mesh;
  const int points = argc > 3 ? std::atoi(argv[3]) : 20000;
  const unsigned seed = argc > 4 ? unsigned(std::atoi(argv[4])) : 1;
  const padder::audit::Measured m = padder::audit::measure(mesh, argc > 5 ? &surface : nullptr, cluster,
                                                           points, seed, argc > 6 ? std::atof(argv[6]) : 0);
  const padder::audit::MassInside inside = padder::audit::mass_inside(mesh, seed);
  // The largest difference of two entries, over the largest entry.
  const double inertia_off = inside.volume > 0
                                 ? (cluster.mass.inertia - inside.inertia).cwiseAbs().maxCoeff() /
                                       inside.inertia.cwiseAbs().maxCoeff()
                                 : 0;
  const nlohmann::ordered_json j = {{"protrusion_max", m.protrusion},
                                    {"protrusion_reported", cluster.accuracy.protrusion_max},
                                    {"gap_max", m.gap},
                                    {"gap_anywhere", m.gap_anywhere},
                                    {"gap_reported", cluster.accuracy.gap_max},
                                    {"patch_area", m.patch_area},
                                    {"volume", inside.volume},
                                    {"volume_reported", cluster.mass.volume},
                                    {"inertia_off", inertia_off},
                                    {"certified", cluster.accuracy.certified},
                                    {"true", m.holds()}};
  std::printf("%s\n", j.dump(2).c_str());
  return m.holds() ? 0 : 1;
} catch (const padder::Error& e) {
  std::fprintf(stderr, "audit: %s\n", e.what());
  return 2;
}
