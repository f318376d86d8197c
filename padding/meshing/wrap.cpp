// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/meshing/wrap.h"

#include <CGAL/alpha_wrap_3.h>

#include <algorithm>

#include "padding/asset/excerpt.h"
#include "padding/meshing/wrap_kernel.h"

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

Repaired wrap(const Soup& soup, const RepairOptions& options, double diagonal, const std::string& why) {
  Repaired out;
  out.kind = BodyKind::wrap;
  out.alpha = wrap_alpha(options, diagonal);
  out.offset = options.tolerance > 0 ? options.tolerance / 8
                                     : std::min(accuracy_of(options, diagonal) / 3, diagonal / 1500);
  // CGAL comes to no end with an offset that rounding drowns.
  out.offset = std::max(out.offset, 1e-9 * diagonal);
  std::vector<std::array<std::size_t, 3>> triangles;
  for (const auto& t : soup.triangles) triangles.push_back({t[0], t[1], t[2]});
  CgalMesh mesh;
  CGAL::alpha_wrap_3(soup.points, triangles, out.alpha, out.offset, mesh,
                     CGAL::parameters::geom_traits(WrapKernel()), CGAL::parameters::default_values());
  out.mesh = from_cgal(mesh), out.checked = true;
  const auto percent = [&](double length) { return short_number(100 * length / diagonal, 3) + " %"; };
  out.report = "wrapped (" + why + "; alpha " + percent(out.alpha) + ", offset " + percent(out.offset) +
               " of the diagonal)";
  return out;
}

}  // namespace padder
