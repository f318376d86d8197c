// SPDX-License-Identifier: MIT
// Writes a robot as YAML, for cuRobo and as Isaac's XRDF: its spheres, the joints that a planner moves, and
// the pairs of links that are never tested against each other.
#include <algorithm>

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

// The joints that a planner moves, and where they stand at first. Joints that are locked, that mimic others
// or that move in more than one way are not among them.
struct ControlSpace {
  std::string names, positions, ones, accelerations, jerks;  // as YAML lists
  std::string by_name;                                       // "{a: 0, b: 0}"

  explicit ControlSpace(const Model& model) {
    for (const Body& b : model.bodies) {
      const Joint& j = b.joint;
      if (!j.moves_one_way() || j.locked() || !j.mimic.empty() || b.parent < 0) continue;
      const std::string comma = names.empty() ? "" : ", ";
      const std::string value = yaml_number(j.first_value());
      names += comma + quoted(j.name), positions += comma + value, ones += comma + "1.0";
      accelerations += comma + "15.0", jerks += comma + "500.0";  // cuRobo's own, where nothing is stated
      by_name += comma + quoted(j.name) + ": " + value;
    }
  }
};

// Where the tool is, as far as can be told: the link at the end of the longest chain of joints, or the one
// that holds it where that is a finger among several.
std::string last_link(const Model& model) {
  std::vector<int> depth(model.bodies.size());
  std::size_t last = 0;
  for (std::size_t b = 0; b < depth.size(); b++) {
    const int parent = model.bodies[b].parent;
    if (parent >= 0) depth[b] = depth[static_cast<std::size_t>(parent)] + 1;
    if (depth[b] > depth[last]) last = b;
  }
  const int holder = model.bodies[last].parent;
  const auto fingers = std::ranges::count_if(
      model.bodies, [&](const Body& b) { return b.parent == holder && b.joint.type != Joint::Type::fixed; });
  if (holder > 0 && fingers > 1) last = static_cast<std::size_t>(holder);
  return model.bodies[last].name;
}

}  // namespace

// A part alone is a list of spheres; a robot is what cuRobo 0.8 takes. cuRobo refuses keys that it does not
// know, and 0.7 knew others for the tool and the default place: it takes the XRDF.
Files write_curobo(const Job& job) {
  const Model& model = job.model;
  const bool robot = model.bodies.size() > 1;
  const std::string indent = robot ? "    " : "";
  std::string out = "# " + origin(model) + ", metres, in each link's frame\n";
  if (robot) {
    out +=
        "# tool_frames is the end of the longest chain: set it, and the limits of cspace, to what is "
        "right.\n";
    out += "robot_cfg:\n  kinematics:\n    urdf_path: " + quoted(urdf_of(model, job.options)) +
           "\n    asset_root_path: \"\"\n";
    out += "    base_link: " + quoted(model.bodies[0].name) + "\n    tool_frames: [" +
           quoted(last_link(model)) + "]\n";
  }
  out += indent + "collision_spheres:\n" + spheres(model, indent + "  ");
  out += indent + "collision_link_names:\n";
  for (const Body& body : model.bodies)
    if (body.cluster.size() > 0) out += indent + "  - " + quoted(body.name) + "\n";
  if (robot) out += "    collision_sphere_buffer: 0.0\n    self_collision_buffer: {}\n";
  out += indent + "self_collision_ignore:" + ignored(job, indent + "  ");
  const ControlSpace space(model);
  if (robot)
    out +=
        "    lock_joints: null\n    extra_links: null\n    format_version: 2.0\n    cspace:\n      "
        "joint_names: [" +
        space.names + "]\n      default_joint_position: [" + space.positions +
        "]\n      null_space_weight: [" + space.ones + "]\n      cspace_distance_weight: [" + space.ones +
        "]\n      max_jerk: 500.0\n      max_acceleration: 15.0\n";
  return {{"", out}};
}

Files write_xrdf(const Job& job) {
  const Model& model = job.model;
  const std::string name = quoted(identifier(model.name) + "_spheres");
  const ControlSpace space(model);
  std::string out =
      "# " + origin(model) +
      ", metres, in each link's frame\n"
      "# tool_frames is the end of the longest chain, and the limits of cspace are cuRobo's own: set "
      "them to what is right.\nformat: xrdf\nformat_version: 1.0\n";
  out += "modifiers:\n  - set_base_frame: " + quoted(model.bodies[0].name) + "\n";
  out += "default_joint_positions: {" + space.by_name + "}\n";
  out += "cspace:\n  joint_names: [" + space.names + "]\n  acceleration_limits: [" + space.accelerations +
         "]\n  jerk_limits: [" + space.jerks + "]\n";
  out += "tool_frames: [" + quoted(last_link(model)) + "]\n";
  out += "collision:\n  geometry: " + name + "\n  buffer_distance: {}\n";
  out += "self_collision:\n  geometry: " + name + "\n  buffer_distance: {}\n  ignore:" + ignored(job, "    ");
  return {{"", out + "geometry:\n  " + name + ":\n    spheres:\n" + spheres(model, "      ")}};
}

}  // namespace padder::exporting
