// SPDX-License-Identifier: MIT
#include "padding/robots/robot_file.h"

#include <set>
#include <string_view>

#include "padding/asset/error.h"
#include "padding/asset/file.h"
#include "padding/import/xml.h"
#include "padding/robots/mjcf.h"
#include "padding/robots/urdf.h"

namespace padder {

namespace fs = std::filesystem;
using pugi::xml_node;

namespace {

// URDF may end in .xml, too.
bool is_urdf(const fs::path& path) try {
  pugi::xml_document document;
  importing::load_xml(document, read_file(path, kMostText), path.string());
  return !document.child("robot").empty();
} catch (const Error&) {
  return false;
}

// Does the element of an MJCF say what the reader of spheres (padding/import/) does not read? It takes the
// geoms of each body that are spheres and state their size.
bool says_more_than_spheres(const xml_node& node) {
  static const std::set<std::string_view> more{"include", "frame",     "replicate",
                                               "attach",  "composite", "flexcomp"};
  const std::string_view name = node.name(), parent = node.parent().name();
  if (name == "body") {  // the place of the only one counts where there are no links
    bool placed = false;
    for (const char* place : {"pos", "quat", "axisangle", "euler", "xyaxes", "zaxis"})
      placed |= !node.attribute(place).empty();
    const bool only = parent == "worldbody" && !node.child("body") && !node.previous_sibling("body") &&
                      !node.next_sibling("body");
    return node.attribute("childclass") || (only && placed);
  }
  if (name == "joint") return parent == "body";
  if (name != "geom") return more.contains(name);
  const bool sphere =
      node.attribute("type").as_string("sphere") == std::string_view("sphere") && !node.attribute("mesh");
  if (parent == "default")
    return !sphere || node.attribute("size") || node.attribute("pos") || node.attribute("contype") ||
           node.attribute("conaffinity");
  const bool seen_only =
      node.attribute("contype").as_int(1) == 0 && node.attribute("conaffinity").as_int(1) == 0;
  return !sphere || seen_only || parent == "worldbody" || !node.attribute("size") ||
         node.attribute("class") || node.attribute("fromto");
}

}  // namespace

bool is_robot_file(const fs::path& path) try {
  const std::string ending = ending_of(path);
  if (ending == ".urdf" || ending == ".xacro") return true;
  if (ending != ".xml") return false;
  pugi::xml_document document;
  importing::load_xml(document, read_file(path, kMostText), path.string());
  const auto is_geom = [](const xml_node& node) { return std::string_view(node.name()) == "geom"; };
  return !document.child("mujoco") || document.find_node(is_geom).empty() ||
         !document.find_node(says_more_than_spheres).empty();
} catch (const Error&) {  // who reads it says why it cannot be read
  return true;
}

RobotTree read_robot(const fs::path& path, const RobotReadOptions& options) {
  return ending_of(path) == ".xml" && !is_urdf(path) ? read_mjcf(path, options) : read_urdf(path, options);
}

}  // namespace padder
