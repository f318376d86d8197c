// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/meshing/wrap.h"

#include <CGAL/alpha_wrap_3.h>

#include <algorithm>
#include <cstdio>

namespace padder {

namespace {
double accuracy_of(const RepairOptions& options, double diagonal) {
  return options.accuracy > 0 ? options.accuracy : diagonal / 500;
}
}  // namespace

double wrap_alpha(const RepairOptions& options, double diagonal) {
  // No wrap facet is larger than alpha allows, and its corners lie at the offset: so the wrap stands off by
  // at most the sum. The room left is for the slack of the proof.
  if (options.tolerance > 0) return std::max(0.83 * options.tolerance, diagonal / 600);
  if (options.alpha > 0) return options.alpha;
  return std::clamp(2.75 * accuracy_of(options, diagonal), diagonal / 400, diagonal / 150);
}

Repaired wrap(const Soup& soup, const RepairOptions& options, double diagonal, RepairReport report,
              const std::string& why) {
  Repaired out;
  out.kind = BodyKind::wrap;
  out.alpha = wrap_alpha(options, diagonal);
  out.offset =
      options.offset > 0 ? options.offset : std::min(accuracy_of(options, diagonal) / 3, diagonal / 1500);
  if (options.tolerance > 0) out.offset = options.tolerance / 8;
  std::vector<std::array<std::size_t, 3>> triangles;
  for (const auto& t : soup.triangles) triangles.push_back({t[0], t[1], t[2]});
  CgalMesh mesh;
  CGAL::alpha_wrap_3(soup.points, triangles, out.alpha, out.offset, mesh);
  out.mesh = from_cgal(mesh), out.checked = true;
  char settings[100];
  std::snprintf(settings, sizeof settings, "alpha %.3g %%, offset %.3g %% of the diagonal",
                100 * out.alpha / diagonal, 100 * out.offset / diagonal);
  report.add("wrapped (" + why + "; " + settings + ")");
  out.report = report.text();
  return out;
}

}  // namespace padder
