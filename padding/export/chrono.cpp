// SPDX-License-Identifier: MIT
// Writes a C++ header for Chrono, which has no file format for clumps of spheres. The header states the
// inertia, because Chrono's own sum counts overlaps of spheres twice.
#include <algorithm>

#include "padding/export/writers.h"

namespace padder::exporting {

Files write_chrono(const Job& job) {
  const std::vector<CollisionFilter> filters = filters_of(job.model);
  const auto bits = chrono_bits(filters);  // check_filters has seen that there are enough
  const bool kept = std::ranges::all_of(filters, [](const auto& f) { return f.family <= kChronoFamilies; });
  std::string out = "// " + origin(job.model) + ", unit " +
                    (job.model.unit.empty() ? "as in the mesh" : job.model.unit) + ", density " +
                    number(job.options.density) + ".\n";
  out +=
      "// Spheres about the centre of mass, along the principal axes: the frame of a ChBody. For each body "
      "b:\n"
      "//   body->SetMass(b::mass); body->SetInertiaXX({b::moments[0], b::moments[1], b::moments[2]});\n"
      "//   for (auto& s : b::spheres) body->AddCollisionShape(make_shared<ChCollisionShapeSphere>(material, "
      "s[3]),\n"
      "//                                                      ChFrame<>(ChVector3d(s[0], s[1], s[2]), "
      "QUNIT));\n"
      "//   body->GetCollisionModel()->SetFamilyGroup(b::family_group);\n"
      "//   body->GetCollisionModel()->SetFamilyMask(b::family_mask);\n";
  out += kept ? "// Family k is Chrono's family k; 0, which every body of Chrono's is of at first, is no "
                "family.\n"
              : "// Families above 14 are among them: the numbers hold among the bodies of this file, and "
                "are not the families.\n";
  out += "// The mesh itself, to look at, goes into that frame by axes^T (p - center).\n#pragma once\n\n";
  out += "namespace " + identifier(job.model.name) + " {\n";
  const std::vector<std::string> names = identifiers(job.model);
  for (std::size_t k = 0; k < job.model.bodies.size(); k++) {
    const Body& body = job.model.bodies[k];
    const Cluster& c = body.cluster;
    if (c.size() == 0) continue;
    const std::vector<Point> centers = centers_in_mass_frame(c);
    if (job.model.bodies.size() > 1) out += "namespace " + names[k] + " {\n";
    out += "inline constexpr double mass = " + number(job.options.density * c.mass.volume) + ";\n";
    out += "inline constexpr double moments[3] = {" + numbers(job.options.density * c.mass.moments, ", ") +
           "};\n";
    out += "inline constexpr double center[3] = {" + numbers(c.mass.center, ", ") +
           "};  // in the mesh's frame\n";
    out += "inline constexpr double axes[3][3] = {";  // rows of the matrix whose columns they are
    for (int row = 0; row < 3; row++)
      out += (row ? ", {" : "{") + numbers(c.mass.axes.row(row).transpose(), ", ") + "}";
    out += "};  // columns: the principal directions\n";
    out += "inline constexpr short family_group = " + std::to_string((*bits)[k].own) +
           ", family_mask = " + std::to_string((*bits)[k].others) + ";\n";
    out += "inline constexpr double spheres[" + std::to_string(c.size()) + "][4] = {  // x, y, z, r\n";
    for (std::size_t s = 0; s < c.size(); s++)
      out += "    {" + numbers(centers[s], ", ") + ", " + number(c.radii[s]) + "},\n";
    out += "};\n";
    if (job.model.bodies.size() > 1) out += "}  // namespace " + names[k] + "\n";
  }
  return {{"", out + "}  // namespace " + identifier(job.model.name) + "\n"}};
}

}  // namespace padder::exporting
