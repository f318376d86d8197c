// SPDX-License-Identifier: MIT
// Writes a robot's spheres as YAML, for cuRobo and as Isaac's XRDF. Both formats name the pairs of links that
// are never tested against each other.
#include "padding/export/writers.h"

namespace padder::exporting {
namespace {

// cuRobo reads with PyYAML, which takes 1e-05 for text. A number with an exponent needs a decimal point.
std::string yaml_number(double value) {
  std::string text = number(value);
  const auto e = text.find('e');
  if (e != std::string::npos && text.find('.') == std::string::npos) text.insert(e, ".0");
  return text;
}

std::string spheres(const Model& model, const std::string& indent) {
  std::string out;
  for (const Body& body : model.bodies) {
    if (body.cluster.size() == 0) continue;
    out += indent + quoted(body.name) + ":\n";
    for (std::size_t k = 0; k < body.cluster.size(); k++) {
      const Point& p = body.cluster.centers[k];
      out += indent + "  - {center: [" + yaml_number(p.x()) + ", " + yaml_number(p.y()) + ", " +
             yaml_number(p.z()) + "], radius: " + yaml_number(body.cluster.radii[k]) + "}\n";
    }
  }
  return out;
}

// Each pair stands once, in the list of its first link.
std::string ignored(const Job& job, const std::string& indent) {
  std::string out;
  for (std::size_t b = 0; b < job.model.bodies.size(); b++) {
    std::string others;
    for (const auto& [i, j] : job.pairs)
      if (i == b && job.model.bodies[i].cluster.size() > 0 && job.model.bodies[j].cluster.size() > 0)
        others += (others.empty() ? "" : ", ") + quoted(job.model.bodies[j].name);
    if (!others.empty()) out += indent + quoted(job.model.bodies[b].name) + ": [" + others + "]\n";
  }
  return out.empty() ? " {}\n" : "\n" + out;
}

}  // namespace

Files write_curobo(const Job& job) {
  std::string out = "# " + origin(job.model) + ", metres, in each link's frame\ncollision_spheres:\n" +
                    spheres(job.model, "  ");
  out += "collision_link_names:\n";
  for (const Body& body : job.model.bodies)
    if (body.cluster.size() > 0) out += "  - " + quoted(body.name) + "\n";
  return {{"", out + "self_collision_ignore:" + ignored(job, "  ")}};
}

Files write_xrdf(const Job& job) {
  const std::string name = quoted(identifier(job.model.name) + "_spheres");
  std::string out = "# " + origin(job.model) +
                    ", metres, in each link's frame\n"
                    "# cspace and tool_frames are choices of the robot's user: add them.\nformat: "
                    "xrdf\nformat_version: 1.0\n";
  out += "collision:\n  geometry: " + name + "\n";
  out += "self_collision:\n  geometry: " + name + "\n  ignore:" + ignored(job, "    ");
  return {{"", out + "geometry:\n  " + name + ":\n    spheres:\n" + spheres(job.model, "      ")}};
}

}  // namespace padder::exporting
