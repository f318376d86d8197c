// SPDX-License-Identifier: MIT
#include "padding/export/warnings.h"

#include <algorithm>
#include <string_view>

namespace padder {

bool states_mass(const Format& format) {
  const std::string_view stating[] = {"dem-engine", "yade", "mercury", "chrono", "urdf", "mujoco", "usd"};
  return std::find(std::begin(stating), std::end(stating), format.name) != std::end(stating);
}

std::vector<std::string> mass_warnings(const Model& model, const Format& format) {
  std::vector<std::string> out;
  if (!states_mass(format)) return out;
  for (const Body& b : model.bodies)
    if (b.cluster.size() > 0 && b.cluster.mass_of == SurfaceKind::wrap && !b.inertial &&
        b.cluster.mass.volume > 0)
      out.push_back("the mass and moments of " + b.name + " for " + format.program +
                    " are those of a wrap around the mesh, which is no closed body, and can be far from the "
                    "true ones: set them by hand, or mend the mesh");
  return out;
}

}  // namespace padder
