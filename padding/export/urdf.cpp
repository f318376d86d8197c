// SPDX-License-Identifier: MIT
// Writes URDF, with one <collision> for each sphere, and MoveIt's SRDF.
#include <algorithm>
#include <cmath>
#include <map>
#include <pugixml.hpp>
#include <sstream>

#include "padding/asset/error.h"
#include "padding/export/writers.h"

namespace padder::exporting {
namespace {

// URDF demands numbers for the limits of a joint, and 0 would let it have no speed and no force.
constexpr double kUnlimited = 1e6;

const char* word(const Joint& joint) {
  const bool turns_on = joint.type == Joint::Type::revolute && !joint.limited();
  constexpr const char* words[] = {"fixed",  "revolute", "continuous", "prismatic",
                                   "planar", "floating", "floating"};  // for `ball`: no joint only turns
  return words[static_cast<std::size_t>(turns_on ? Joint::Type::continuous : joint.type)];
}

// Roll, pitch and yaw about fixed axes x, y, z, as URDF defines them.
Vector roll_pitch_yaw(const Eigen::Matrix3d& m) {
  const double horizontal = std::hypot(m(0, 0), m(1, 0));
  if (horizontal < 1e-12) return {std::atan2(-m(1, 2), m(1, 1)), std::atan2(-m(2, 0), horizontal), 0};
  return {std::atan2(m(2, 1), m(2, 2)), std::atan2(-m(2, 0), horizontal), std::atan2(m(1, 0), m(0, 0))};
}

void set(pugi::xml_node node, const char* attribute, const std::string& value) {
  node.append_attribute(attribute).set_value(value.c_str());
}

void append_collisions(pugi::xml_node link, const Cluster& c) {
  for (std::size_t k = 0; k < c.size(); k++) {
    pugi::xml_node collision = link.append_child("collision");
    set(collision.append_child("origin"), "xyz", numbers(c.centers[k]));
    set(collision.append_child("geometry").append_child("sphere"), "radius", number(c.radii[k]));
  }
}

void prepend_inertial(pugi::xml_node link, const Inertial& i) {
  pugi::xml_node inertial = link.prepend_child("inertial");
  set(inertial.append_child("origin"), "xyz", numbers(i.center));
  set(inertial.append_child("mass"), "value", number(i.mass));
  pugi::xml_node inertia = inertial.append_child("inertia");
  const char* names[3][3] = {{"ixx", "ixy", "ixz"}, {"", "iyy", "iyz"}, {"", "", "izz"}};
  for (int row = 0; row < 3; row++)
    for (int column = row; column < 3; column++)
      set(inertia, names[row][column], number(i.inertia(row, column)));
}

void append_joint(pugi::xml_node robot, const Body& body, const std::string& parent) {
  pugi::xml_node joint = robot.append_child("joint");
  set(joint, "name", body.joint.name.empty() ? body.name + "_joint" : body.joint.name);
  const std::string type = word(body.joint);
  set(joint, "type", type);
  set(joint.append_child("parent"), "link", parent);
  set(joint.append_child("child"), "link", body.name);
  pugi::xml_node place = joint.append_child("origin");
  set(place, "xyz", numbers(body.pose.translation()));
  set(place, "rpy", numbers(roll_pitch_yaw(body.pose.linear())));
  if (!body.joint.mimic.empty()) {
    pugi::xml_node mimic = joint.append_child("mimic");
    set(mimic, "joint", body.joint.mimic), set(mimic, "multiplier", number(body.joint.multiplier)),
        set(mimic, "offset", number(body.joint.offset));
  }
  if (type == "fixed" || type == "floating") return;
  set(joint.append_child("axis"), "xyz", numbers(body.joint.axis));
  if (body.joint.damping > 0 || body.joint.friction > 0) {
    pugi::xml_node dynamics = joint.append_child("dynamics");
    set(dynamics, "damping", number(body.joint.damping)),
        set(dynamics, "friction", number(body.joint.friction));
  }
  if (type != "revolute" && type != "prismatic") return;
  pugi::xml_node limit = joint.append_child("limit");
  const bool limited = body.joint.limited();
  set(limit, "lower", number(limited ? body.joint.lower : -kUnlimited));
  set(limit, "upper", number(limited ? body.joint.upper : kUnlimited));
  set(limit, "effort", number(body.joint.effort > 0 ? body.joint.effort : kUnlimited));
  set(limit, "velocity", number(kUnlimited));
}

std::string text_of(const pugi::xml_document& document) {
  std::ostringstream out;
  document.save(out, "  ");
  return out.str();
}

// urdfdom refuses the robot without these.
void fill(pugi::xml_node element, std::initializer_list<const char*> attributes, double value) {
  for (const char* name : attributes)
    if (element && !element.attribute(name)) set(element, name, number(value));
}

// Writes the document that the robot was read from. Only <collision> changes; a missing <inertial> is added,
// and numbers that are missing of one or of a <limit>.
std::string edited(const Job& job) {
  pugi::xml_document document;
  if (!document.load_buffer(job.model.urdf.data(), job.model.urdf.size(), pugi::parse_full))
    throw Error("the URDF of " + job.model.name + " is not XML");
  for (pugi::xml_node node : document.children())
    if (node.type() == pugi::node_declaration && node.attribute("encoding"))
      node.attribute("encoding").set_value("UTF-8");  // as it is written
  pugi::xml_node robot = document.child("robot");
  for (const Body& body : job.model.bodies) {
    pugi::xml_node link = robot.find_child_by_attribute("link", "name", body.name.c_str());
    if (!link) throw Error("the URDF of " + job.model.name + " has no link " + body.name);
    while (link.remove_child("collision")) continue;
    const auto inertial = inertial_of(body, job.options.density);
    // One without a mass or without moments does not state what the body has (padding/robots/urdf.h).
    const auto moments = link.child("inertial").child("inertia");
    const bool stated = moments.attribute("ixx") && moments.attribute("iyy") && moments.attribute("izz");
    if (inertial && !(body.inertial && stated)) {
      link.remove_child("inertial");
      prepend_inertial(link, *inertial);
    }
    fill(link.child("inertial").child("inertia"), {"ixx", "ixy", "ixz", "iyy", "iyz", "izz"}, 0);
    append_collisions(link, body.cluster);
  }
  for (const pugi::xml_node joint : robot.children("joint"))
    fill(joint.child("limit"), {"effort", "velocity"}, kUnlimited);
  return text_of(document);
}

// Of the pairs that the model lists; others may not touch by families and masks.
std::map<std::pair<std::size_t, std::size_t>, std::string> reasons_of(const Model& model) {
  std::map<std::pair<std::size_t, std::size_t>, std::string> out;
  for (const Apart& p : model.apart) out.emplace(std::minmax(p.a, p.b), p.reason);
  return out;
}

std::string srdf(const Job& job, bool spheres) {
  pugi::xml_document document;
  document.append_child(pugi::node_comment).set_value((" " + origin(job.model) + " ").c_str());
  pugi::xml_node robot = document.append_child("robot");
  set(robot, "name", job.model.name);
  for (const Body& body : job.model.bodies) {
    if (!spheres || body.cluster.size() == 0) continue;
    pugi::xml_node link = robot.append_child("link_sphere_approximation");
    set(link, "link", body.name);
    for (std::size_t k = 0; k < body.cluster.size(); k++) {
      pugi::xml_node sphere = link.append_child("sphere");
      set(sphere, "center", numbers(body.cluster.centers[k])),
          set(sphere, "radius", number(body.cluster.radii[k]));
    }
  }
  const auto reasons = reasons_of(job.model);
  for (const auto& [i, j] : job.pairs) {
    if (job.model.bodies[i].cluster.size() == 0 || job.model.bodies[j].cluster.size() == 0) continue;
    const auto reason = reasons.find({i, j});
    pugi::xml_node pair = robot.append_child("disable_collisions");
    set(pair, "link1", job.model.bodies[i].name), set(pair, "link2", job.model.bodies[j].name);
    set(pair, "reason", reason != reasons.end() ? reason->second : Apart().reason);
  }
  return text_of(document);
}

}  // namespace

Files write_urdf(const Job& job) {
  Files files;
  if (!job.model.urdf.empty()) {
    files.emplace_back("", edited(job));
  } else {
    pugi::xml_document document;
    document.append_child(pugi::node_comment).set_value((" " + origin(job.model) + " ").c_str());
    pugi::xml_node robot = document.append_child("robot");
    set(robot, "name", job.model.name);
    const auto& bodies = job.model.bodies;
    const bool world =
        std::count_if(bodies.begin(), bodies.end(), [](const Body& b) { return b.parent < 0; }) > 1 ||
        !bodies[0].pose.matrix().isIdentity(0);
    if (world) set(robot.append_child("link"), "name", "world");  // a URDF has one root
    for (const Body& body : bodies) {
      pugi::xml_node link = robot.append_child("link");
      set(link, "name", body.name);
      if (const auto inertial = inertial_of(body, job.options.density)) prepend_inertial(link, *inertial);
      append_collisions(link, body.cluster);
    }
    for (const Body& body : bodies)
      if (body.parent >= 0 || world)
        append_joint(robot, body,
                     body.parent < 0 ? "world" : bodies[static_cast<std::size_t>(body.parent)].name);
    files.emplace_back("", text_of(document));
  }
  // URDF cannot say which pairs may not touch. A robot without such pairs has the file, too: one that lay
  // there would speak of another robot.
  if (job.model.robot() || !job.pairs.empty()) files.emplace_back("*.srdf", srdf(job, false));
  return files;
}

std::vector<std::string> joints_with_unknown_limits(const Model& model) {
  std::vector<std::string> out;
  pugi::xml_document document;
  document.load_buffer(model.urdf.data(), model.urdf.size());
  for (const pugi::xml_node joint : document.child("robot").children("joint"))
    if (const auto limit = joint.child("limit");
        limit && !(limit.attribute("effort") && limit.attribute("velocity")))
      out.push_back(joint.attribute("name").as_string());
  if (model.urdf.empty())
    for (const Body& b : model.bodies)
      if (b.joint.may_have_limits()) out.push_back(b.joint.name);
  return out;
}

Files write_srdf(const Job& job) { return {{"", srdf(job, true)}}; }

}  // namespace padder::exporting
