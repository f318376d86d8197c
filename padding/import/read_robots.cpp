// SPDX-License-Identifier: MIT
// Reads the spheres of a robot's links: cuRobo and XRDF as YAML; URDF, SRDF and MJCF as XML.
#include <yaml-cpp/yaml.h>

#include <charconv>
#include <pugixml.hpp>

#include "padding/asset/excerpt.h"
#include "padding/export/families.h"
#include "padding/import/readers.h"
#include "padding/import/xml.h"

namespace padder::importing {
namespace {

// Refuses a key that stands twice: yaml-cpp would take the first and ignore the other.
YAML::Node value_of(const YAML::Node& map, const char* key, const std::string& where) {
  YAML::Node found(YAML::NodeType::Undefined);
  bool any = false;
  if (!map.IsMap()) return found;
  for (const auto& entry : map) {
    if (!entry.first.IsScalar() || entry.first.Scalar() != key) continue;
    if (any)
      throw Error(where + ", line " + std::to_string(entry.first.Mark().line + 1) + ": the key '" + key +
                  "' stands twice: remove one");
    found.reset(entry.second), any = true;
  }
  return found;
}

Part links_spheres(const std::string& link, const YAML::Node& list, const std::string& where,
                   std::uint64_t& switched_off) {
  Part part;
  part.name = link;
  const std::string at = where + ", spheres of '" + excerpt(link) + "'";
  if (!list.IsSequence()) throw Error(at + ": a list is wanted");
  try {
    for (const YAML::Node& sphere : list) {
      const YAML::Node center = value_of(sphere, "center", at), radius = value_of(sphere, "radius", at);
      if (!center.IsDefined() || !radius.IsDefined() || !center.IsSequence() || center.size() != 3)
        throw Error(at + ", line " + std::to_string(sphere.Mark().line + 1) +
                    ": each needs a center of three numbers and a radius");
      if (radius.as<double>() <= 0) {  // a place that cuRobo fills later, as with what a gripper holds
        switched_off++;
        continue;
      }
      part.centers.emplace_back(center[0].as<double>(), center[1].as<double>(), center[2].as<double>());
      part.radii.push_back(radius.as<double>());
    }
  } catch (const YAML::Exception& e) {
    throw Error(at + ", line " + std::to_string(e.mark.line + 1) + ": not a number");
  }
  return part;
}

void append(Parts& parts, const YAML::Node& links, const std::string& where, std::uint64_t& switched_off) {
  if (links.IsScalar())
    throw Error(where + ": collision_spheres names another file, '" + excerpt(links.Scalar()) +
                "': give that one");
  if (!links.IsMap()) throw Error(where + ": the spheres must be listed under the names of their links");
  for (const auto& link : links) {
    if (!link.first.IsScalar()) throw Error(where + ": a link's name must be a word");
    for (const Part& p : parts)
      if (p.name == link.first.Scalar())
        throw Error(where + ", line " + std::to_string(link.first.Mark().line + 1) + ": the link '" +
                    excerpt(p.name) + "' is listed twice: remove one");
    parts.push_back(links_spheres(link.first.Scalar(), link.second, where, switched_off));
  }
}

// The pairs of links that are never tested: under each link a list of others. What is no such list says
// nothing here.
void append(std::vector<ApartNames>& apart, const YAML::Node& ignored) {
  if (!ignored.IsDefined() || !ignored.IsMap()) return;
  for (const auto& link : ignored) {
    if (!link.first.IsScalar() || !link.second.IsSequence()) continue;
    for (const YAML::Node& other : link.second)
      if (other.IsScalar()) apart.push_back({link.first.Scalar(), other.Scalar(), Apart().reason});
  }
}

void append(Part& part, const pugi::xml_node& at, const char* center, const char* radius,
            const std::string& where) {
  const auto p = numbers_in(*center ? center : "0 0 0");
  double r = 0;
  const char* end = radius + std::char_traits<char>::length(radius);
  const auto [next, code] = std::from_chars(radius, end, r);  // more numbers may follow in MuJoCo's size
  const bool blank = next == end || *next == ' ';
  if (!p || p->size() != 3 || code != std::errc() || !blank)
    throw Error(where + ", byte " + std::to_string(at.offset_debug()) + ": a sphere of '" +
                excerpt(part.name) + "'" + " has no centre of three numbers or no radius");
  part.centers.emplace_back((*p)[0], (*p)[1], (*p)[2]), part.radii.push_back(r);
}

// The family and mask of a body whose geoms all have the same bits, if these are bits of ours.
void append_filter(Part& part, const pugi::xml_node& body) {
  std::optional<FilterBits> all;
  for (const pugi::xml_node& geom : body.children("geom")) {
    // MuJoCo reads a signed number. Geoms without bits get 1 and 1, which are none of ours.
    const FilterBits bits{static_cast<std::uint32_t>(geom.attribute("contype").as_llong(1)),
                          static_cast<std::uint32_t>(geom.attribute("conaffinity").as_llong(1))};
    if (all && *all != bits) return;
    all = bits;
  }
  if (!all || part.radii.empty()) return;
  if (const auto filter = filter_of_mujoco_bits(*all))
    part.family = {filter->family}, part.mask = {filter->mask};
}

void append_mujoco(Parts& parts, const pugi::xml_node& parent, const std::string& where) {
  for (const pugi::xml_node& body : parent.children("body")) {
    Part part;
    part.name = body.attribute("name").as_string("body");
    for (const pugi::xml_node& geom : body.children("geom"))
      if (std::string_view(geom.attribute("type").as_string("sphere")) == "sphere" && geom.attribute("size"))
        append(part, geom, geom.attribute("pos").as_string(), geom.attribute("size").as_string(), where);
    append_filter(part, body);
    parts.push_back(std::move(part));
    append_mujoco(parts, body, where);
  }
}

}  // namespace

Content read_yaml(const std::string& text, const std::string& where) {
  YAML::Node document;
  try {
    document = YAML::Load(text);
  } catch (const YAML::Exception& e) {
    throw Error(where + ", line " + std::to_string(e.mark.line + 1) +
                ": not YAML: check that the file is whole");
  }
  if (!document.IsMap())
    throw Error(where + ": neither collision_spheres (cuRobo) nor geometry (XRDF) is in it");
  Content out;
  out.unit = "m", out.links = true;
  if (const YAML::Node geometry = value_of(document, "geometry", where);
      geometry.IsDefined() && geometry.IsMap()) {
    std::size_t groups = 0;
    for (const auto& group : geometry)
      if (group.second.IsMap() && group.second["spheres"]) groups++;
    for (const auto& group : geometry) {
      if (!group.second.IsMap() || !group.second["spheres"]) continue;
      Parts links;
      append(links, group.second["spheres"], where, out.switched_off);
      for (Part& link : links) {
        if (groups > 1) link.name = group.first.Scalar() + "/" + link.name;
        out.parts.push_back(std::move(link));
      }
    }
    if (const YAML::Node self = value_of(document, "self_collision", where); self.IsDefined())
      append(out.apart, value_of(self, "ignore", where));
    return out;
  }
  YAML::Node robot = document;
  if (!value_of(document, "collision_spheres", where).IsDefined())  // a whole robot of cuRobo
    for (const char* key : {"robot_cfg", "kinematics"})
      if (const YAML::Node inner = value_of(robot, key, where); inner.IsDefined() && inner.IsMap())
        robot.reset(inner);
  const YAML::Node spheres = value_of(robot, "collision_spheres", where);
  if (!spheres.IsDefined())
    throw Error(where + ": neither collision_spheres (cuRobo) nor geometry (XRDF) is in it");
  append(out.parts, spheres, where, out.switched_off);
  append(out.apart, value_of(robot, "self_collision_ignore", where));
  return out;
}

Content read_xml(const std::string& text, const std::string& where) {
  pugi::xml_document document;
  load_xml(document, text, where);
  Content out;
  out.unit = "m", out.links = true;
  if (const pugi::xml_node mujoco = document.child("mujoco")) {
    for (const pugi::xml_node& world : mujoco.children("worldbody")) append_mujoco(out.parts, world, where);
    for (const pugi::xml_node& contact : mujoco.children("contact"))
      for (const pugi::xml_node& pair : contact.children("exclude"))
        out.apart.push_back(
            {pair.attribute("body1").as_string(), pair.attribute("body2").as_string(), "User"});
    return out;
  }
  const pugi::xml_node robot = document.child("robot");
  if (!robot) throw Error(where + ": neither <robot> nor <mujoco> is its root");
  for (const pugi::xml_node& link : robot.children("link_sphere_approximation")) {  // SRDF
    Part part;
    part.name = link.attribute("link").as_string();
    for (const pugi::xml_node& s : link.children("sphere"))
      append(part, s, s.attribute("center").as_string("0 0 0"), s.attribute("radius").as_string(), where);
    out.parts.push_back(std::move(part));
  }
  for (const pugi::xml_node& pair : robot.children("disable_collisions"))
    out.apart.push_back({pair.attribute("link1").as_string(), pair.attribute("link2").as_string(),
                         pair.attribute("reason").as_string(Apart().reason.c_str())});
  for (const pugi::xml_node& link : robot.children("link")) {  // URDF
    Part part;
    part.name = link.attribute("name").as_string();
    for (const pugi::xml_node& c : link.children("collision"))
      if (const pugi::xml_node s = c.child("geometry").child("sphere"))
        append(part, s, c.child("origin").attribute("xyz").as_string(), s.attribute("radius").as_string(),
               where);
    out.parts.push_back(std::move(part));
  }
  return out;
}

}  // namespace padder::importing
