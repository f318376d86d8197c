// SPDX-License-Identifier: MIT
// Writes USD as text: one Xform for each body, and in it one Sphere prim for each sphere, which is a collider
// of USD's physics schema.
#include "padding/export/writers.h"

namespace padder::exporting {
namespace {

std::string tuple(const Vector& v) { return "(" + numbers(v, ", ") + ")"; }

// USD multiplies row vectors by matrices, so its matrices are the transposes of ours.
std::string matrix(const Eigen::Isometry3d& pose) {
  std::string out = "( ";
  for (int k = 0; k < 4; k++)
    out += (k ? ", (" : "(") + numbers(pose.matrix().col(k).head<3>(), ", ") + (k < 3 ? ", 0)" : ", 1)");
  return out + " )";
}

}  // namespace

Files write_usda(const Job& job) {
  const Model& model = job.model;
  const std::vector<std::string> names = identifiers(model);
  const auto poses = world_poses(model);
  const std::string root = identifier(model.name);
  const bool several = model.bodies.size() > 1;
  std::string out = "#usda 1.0\n(\n    defaultPrim = \"" + root + "\"\n    doc = " + quoted(origin(model)) +
                    "\n    metersPerUnit = " + number(metres(model.unit)) + "\n    upAxis = \"Z\"\n)\n\n";
  if (several) out += "def Xform \"" + root + "\"\n{\n";
  for (std::size_t b = 0; b < model.bodies.size(); b++) {
    const Cluster& c = model.bodies[b].cluster;
    if (c.size() == 0) continue;
    std::string filtered;
    for (const auto& [i, j] : job.pairs)
      if (i == b && model.bodies[j].cluster.size() > 0)
        filtered += std::string(filtered.empty() ? "" : ", ") + "</" + root + "/" + names[j] + ">";
    out += "def Xform \"" + (several ? names[b] : root) + "\"";
    if (!filtered.empty()) out += " (\n    prepend apiSchemas = [\"PhysicsFilteredPairsAPI\"]\n)";
    out += "\n{\n";
    if (!filtered.empty()) out += "    rel physics:filteredPairs = [" + filtered + "]\n";
    if (!poses[b].matrix().isIdentity(0))
      out += "    matrix4d xformOp:transform = " + matrix(poses[b]) +
             "\n    uniform token[] xformOpOrder = [\"xformOp:transform\"]\n";
    for (std::size_t k = 0; k < c.size(); k++)
      out += "    def Sphere \"sphere_" + std::to_string(k) +
             "\" (\n        prepend apiSchemas = [\"PhysicsCollisionAPI\"]\n    )\n    {\n" +
             "        double radius = " + number(c.radii[k]) +
             "\n        double3 xformOp:translate = " + tuple(c.centers[k]) +
             "\n        uniform token[] xformOpOrder = [\"xformOp:translate\"]\n    }\n";
    out += "}\n";
  }
  if (several) out += "}\n";
  return {{"", out}};
}

}  // namespace padder::exporting
