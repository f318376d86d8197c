// SPDX-License-Identifier: MIT
#include "padding/robots/mjcf.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

#include "padding/asset/error.h"
#include "padding/asset/excerpt.h"
#include "padding/import/xml.h"
#include "padding/input/text.h"
#include "padding/robots/mesh_file.h"
#include "padding/robots/mjcf_file.h"
#include "padding/robots/solid_inertia.h"

namespace padder {
namespace {

namespace fs = std::filesystem;
using pugi::xml_node;
using reading::MjcfElement;
using reading::MjcfFile;

// contype and conaffinity of a geom.
using Bits = std::pair<std::uint32_t, std::uint32_t>;

// A geom that may be padded. Its shape is read when it is: MuJoCo does not need all that others name.
struct Geom {
  std::size_t link;
  MjcfElement element;
  Eigen::Isometry3d frame;  // that it stands in, in the link's frame
  Bits bits;
  bool touches;  // something that its bits or a <pair> let it touch
};

class MjcfReader {
 public:
  MjcfReader(const fs::path& path, const RobotReadOptions& options)
      : path_(path), file_(path), options_(options) {}

  RobotTree read() {
    Model& model = robot_.model;
    model.file = path_.filename().string(), model.unit = "m";
    robot_.root_is_world = true;
    robot_.included = file_.included();
    model.name = file_.root().attribute("model").as_string(path_.stem().c_str());
    for (const xml_node& section : file_.root().children("asset"))
      for (const xml_node& mesh : section.children("mesh")) add_mesh(mesh);
    for (const xml_node& section : file_.root().children("contact"))
      for (const xml_node& pair : section.children("pair"))
        for (const char* end : {"geom1", "geom2"}) paired_.insert(pair.attribute(end).as_string());
    for (const xml_node& world : file_.root().children("worldbody")) add_names(world);
    add_link("world", -1, Eigen::Isometry3d::Identity());
    for (const xml_node& world : file_.root().children("worldbody")) {
      for (const char* joint : {"joint", "freejoint"})
        if (world.child(joint)) file_.fail(world.child(joint), "the world has no joints: put it into a body");
      add_children(world, 0, Eigen::Isometry3d::Identity(), "");
    }
    take_geoms();
    for (const xml_node& section : file_.root().children("deformable"))
      for (const xml_node& child : section.children()) soft_ += std::string_view(child.name()) == "flex";
    for (const xml_node& section : file_.root().children("equality"))
      for (const xml_node& joint : section.children("joint"))
        if (file_.with_defaults(joint, "").attribute("active").as_bool(true)) add_mimic(joint);
    for (const xml_node& section : file_.root().children("actuator"))
      for (const xml_node& actuator : section.children()) add_effort(actuator);
    keep_apart();
    if (planes_ > 0) note("planes and height fields, which are left out: " + std::to_string(planes_));
    add_masses();
    if (!unlimited_.empty())
      note("joints that slide without limits, which random poses do not try: " + first_few(unlimited_));
    note_left_out();
    if (soft_ > 0) note("soft bodies (flex), which are left out: " + std::to_string(soft_));
    return std::move(robot_);
  }

 private:
  void note(const std::string& text) { robot_.notes.push_back(text); }

  // Those that the file states.
  void add_names(xml_node node) {
    for (const xml_node& child : node.children()) {
      const std::string_view kind = child.name();
      if (kind == "body") body_names_.insert(child.attribute("name").as_string());
      if (kind == "joint" || kind == "freejoint") joint_names_.insert(child.attribute("name").as_string());
      add_names(child);
    }
  }

  // The stated name of an element, or else `name` with what makes it different from all in `taken`.
  static std::string name_of(xml_node node, std::string name, std::set<std::string>& taken) {
    if (const std::string stated = node.attribute("name").as_string(); !stated.empty()) return stated;
    while (!taken.insert(name).second) name += '_';
    return name;
  }

  std::size_t add_link(const std::string& name, int parent, const Eigen::Isometry3d& pose, Joint joint = {}) {
    if (joint.name.empty()) joint.name = name_of({}, name + "_fixed", joint_names_);
    Body body;
    body.name = name, body.parent = parent, body.pose = pose, body.joint = std::move(joint);
    const std::size_t index = robot_.links.size();
    if (!index_.emplace(name, index).second)
      throw Error(path_.string() + ": two bodies are called " + excerpt(name));
    robot_.links.push_back({name, {}});
    robot_.model.bodies.push_back(std::move(body));
    return index;
  }

  fs::path mesh_file(xml_node node) const {
    std::string name = node.attribute("file").as_string();
    if (file_.compiler("strippath", "false") == "true") name.erase(0, name.find_last_of("/\\") + 1);
    const fs::path folder = file_.compiler("meshdir", file_.compiler("assetdir", "").c_str());
    return reading::file_in(fs::absolute(path_).parent_path(), (folder / name).string());
  }

  void add_mesh(xml_node node) {
    const std::string name = node.attribute("name").as_string(mesh_file(node).stem().c_str());
    if (!meshes_.emplace(name, node).second) file_.fail(node, "two meshes are called " + excerpt(name));
  }

  void set_mesh(xml_node node, const std::string& body, RobotShape& shape) const {
    const MjcfElement e = file_.with_defaults(node, "");
    if (!*node.attribute("file").as_string())
      file_.fail(
          node,
          node.attribute("vertex")
              ? "it names no file: vertices in the MJCF itself are not read, write them to an .obj"
              : "it names no file: what MuJoCo or a plugin makes itself is not read, write it to an .obj");
    shape.file = mesh_file(node);
    if (std::error_code code; !fs::is_regular_file(shape.file, code))
      throw Error(path_.string() + ", body " + excerpt(body) + ": the mesh is not there: looked for " +
                  excerpt(shape.file.string(), 500) + reading::in_other_case(shape.file));
    shape.scale = file_.vector(e, "scale", Vector::Ones());
    if ((shape.scale.array() == 0).any()) file_.fail(node, "it has a scale of 0");
    // MuJoCo moves by refpos, turns by refquat, and scales then; a shape is scaled before it is moved.
    const auto q = file_.numbers(e, "refquat", 4, 4, {1, 0, 0, 0});
    const Eigen::Quaterniond turn = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized();
    if (!turn.isApprox(Eigen::Quaterniond::Identity()) &&
        (shape.scale.x() != shape.scale.y() || shape.scale.x() != shape.scale.z()))
      file_.fail(node, "a refquat with a scale that differs by axis is not read: turn the mesh's file");
    const Vector offset = shape.scale.cwiseProduct(file_.vector(e, "refpos", Vector::Zero()));
    shape.pose = shape.pose * turn.conjugate() * Eigen::Translation3d(-offset);
  }

  // What stands in a body, or in a frame of it.
  void add_children(xml_node node, std::size_t link, const Eigen::Isometry3d& frame,
                    const std::string& childclass) {
    for (const xml_node& child : node.children()) {
      const std::string_view name = child.name();
      if (name == "geom") {
        add_geom(child, link, frame, childclass);
      } else if (name == "body") {
        add_body(child, link, frame, childclass);
      } else if (name == "frame") {
        if (child.child("joint") || child.child("freejoint"))
          file_.fail(child, "joints in a frame are not read: put them into the body");
        add_children(child, link, frame * file_.pose({{child}}),
                     child.attribute("childclass").as_string(childclass.c_str()));
      } else if (name == "flexcomp") {
        soft_++;
      } else if (name == "replicate" || name == "composite" || name == "attach") {
        file_.fail(
            child,
            "it is not read: save the model with MuJoCo (mj_saveLastXML), which writes what it stands for");
      }
    }
  }

  void add_body(xml_node node, std::size_t parent, const Eigen::Isometry3d& frame, const std::string& outer) {
    const std::string childclass = node.attribute("childclass").as_string(outer.c_str());
    const std::string name = name_of(node, "body_" + std::to_string(robot_.links.size()), body_names_);
    Eigen::Isometry3d pose = frame * file_.pose({{node}});
    // The joints turn one after the other, each about its anchor, and the last one carries the body. Each
    // stands at its reference where the file shows the body.
    std::vector<Joint> joints;
    std::vector<Vector> anchors;
    for (const xml_node& child : node.children()) {
      const bool free = std::string_view(child.name()) == "freejoint";
      if (!free && std::string_view(child.name()) != "joint") continue;
      const MjcfElement e = free ? MjcfElement{{child}} : file_.with_defaults(child, childclass);
      const std::string called =
          name_of(child, name + "_joint" + (joints.empty() ? "" : "_" + std::to_string(joints.size() + 1)),
                  joint_names_);
      joints.push_back(joint_of(child, e, called, free));
      const bool moves = joints.back().type == Joint::Type::floating;
      if (moves && parent != 0)
        file_.fail(child, "a body that moves freely stands in the world: take it out of " +
                              excerpt(robot_.links[parent].name));
      if (joints.size() > 1 && (moves || joints[0].type == Joint::Type::floating))
        file_.fail(child, "a body that moves freely has no other joint: leave one");
      anchors.push_back(moves ? Vector(Vector::Zero()) : file_.vector(e, "pos", Vector::Zero()));
    }
    Vector at = Vector::Zero();  // where the chain stands, in the body's frame
    int above = static_cast<int>(parent);
    for (std::size_t k = 0; k < joints.size(); k++) {
      const bool last = k + 1 == joints.size() && anchors[k].isZero(0);
      const Vector step = anchors[k] - at;
      const std::size_t link =
          add_link(last ? name : name_of({}, name + ":" + joints[k].name, body_names_), above,
                   pose * Eigen::Translation3d(step) * joints[k].motion(-joints[k].reference), joints[k]);
      pose = Eigen::Isometry3d::Identity(), at = anchors[k], above = static_cast<int>(link);
    }
    if (joints.empty() || !at.isZero(0))
      above = static_cast<int>(add_link(name, above, pose * Eigen::Translation3d(-at)));
    const auto link = static_cast<std::size_t>(above);
    add_inertial(node, link);
    add_children(node, link, Eigen::Isometry3d::Identity(), childclass);
  }

  Joint joint_of(xml_node node, const MjcfElement& e, const std::string& name, bool free) {
    static const std::map<std::string_view, Joint::Type> types{{"hinge", Joint::Type::continuous},
                                                               {"slide", Joint::Type::prismatic},
                                                               {"ball", Joint::Type::ball},
                                                               {"free", Joint::Type::floating}};
    if (!joints_.insert(name).second) file_.fail(node, "two joints are called " + excerpt(name));
    Joint joint;
    joint.name = name;
    const std::string kind = free ? "free" : e.text("type", "hinge");
    const auto type = types.find(kind);
    if (type == types.end()) file_.fail(node, "\"" + excerpt(kind) + "\" is no type of joint");
    joint.type = type->second;
    if (joint.type == Joint::Type::floating) return joint;
    const bool turns = joint.type == Joint::Type::continuous, ball = joint.type == Joint::Type::ball;
    const double unit = turns || ball ? file_.angle() : 1;
    joint.damping = file_.numbers(e, "damping", 1, 3, {0})[0];
    joint.friction = file_.number(e, "frictionloss", 0);
    const auto range = file_.numbers(e, "range", 2, 2, {0, 0});
    const std::string limited = e.text("limited", "auto");
    if (limited != "auto" && limited != "true" && limited != "false")
      file_.fail(node, "limited is true, false or auto, not \"" + excerpt(limited) + '"');
    const bool limits = limited == "true" || (limited == "auto" && (range[0] != 0 || range[1] != 0));
    if (limits && !(range[0] < range[1] && (!ball || range[0] == 0)))
      file_.fail(node, ball ? "the range of a ball is 0 and an angle above 0"
                            : "its range wants the lower end first, as \"-1 1\"");
    if (limits) joint.lower = unit * range[0], joint.upper = unit * range[1];
    if (ball) return joint;
    const Vector axis = file_.vector(e, "axis", Vector::UnitZ());
    if (!(axis.norm() > 0)) file_.fail(node, "its axis has no length");
    joint.axis = axis.normalized();
    joint.reference = unit * file_.number(e, "ref", 0);
    if (limits && turns) joint.type = Joint::Type::revolute;
    if (!limits && !turns) unlimited_.push_back(name);
    const auto force = file_.numbers(e, "actuatorfrcrange", 2, 2);
    if (!force.empty()) joint.effort = std::max(std::abs(force[0]), std::abs(force[1]));
    return joint;
  }

  void add_inertial(xml_node body, std::size_t link) {
    const xml_node node = body.child("inertial");
    if (!node) return;
    const MjcfElement e{{node}};
    Inertial i;
    i.mass = file_.number(e, "mass", 0);
    if (i.mass < 0) file_.fail(node, "its mass is below 0");
    i.center = file_.vector(e, "pos", Vector::Zero());
    const Eigen::Matrix3d turn = file_.orientation(e).toRotationMatrix();
    const auto f = file_.numbers(e, "fullinertia", 6, 6);
    if (f.empty())
      i.inertia = file_.vector(e, "diaginertia", Vector::Zero()).asDiagonal();
    else
      i.inertia << f[0], f[3], f[4], f[3], f[1], f[5], f[4], f[5], f[2];
    i.inertia = turn * i.inertia * turn.transpose();
    robot_.model.bodies[link].inertial = i;
  }

  std::uint32_t bits(const MjcfElement& e, const char* name) const {  // signed or not
    return static_cast<std::uint32_t>(
        static_cast<std::int64_t>(std::clamp(file_.number(e, name, 1), -0x1p31, 0x1p32 - 1)));
  }

  void add_geom(xml_node node, std::size_t link, const Eigen::Isometry3d& frame,
                const std::string& childclass) {
    const MjcfElement e = file_.with_defaults(node, childclass);
    const std::string name = node.attribute("name").as_string();
    if (paired_.contains(name)) links_of_paired_[name] = link;
    if (const std::string type = e.text("type"); type == "plane" || type == "hfield") {
      planes_++;
      return;
    }
    const Bits own{bits(e, "contype"), bits(e, "conaffinity")};
    geoms_.push_back({link, e, frame, own, own != Bits{0, 0} || paired_.contains(name)});
    if (file_.compiler("inertiafromgeom", "auto") == "true") robot_.model.bodies[link].inertial.reset();
  }

  RobotShape shape_of(const Geom& geom) const {
    const MjcfElement& e = geom.element;
    const xml_node node = e.levels[0];
    const std::string mesh = e.text("mesh"), type = e.text("type", "sphere");
    RobotShape shape;
    const auto ends = file_.numbers(e, "fromto", 6, 6);
    const auto size = file_.numbers(e, "size", 1, 3, {0, 0, 0});
    Vector half(size[0], size.size() > 1 ? size[1] : 0, size.size() > 2 ? size[2] : 0);
    if (!ends.empty() && type != "mesh" && type != "sphere") {
      // MuJoCo's axis of z leads from the second end to the first, which turns a box about it.
      const Vector a(ends[0], ends[1], ends[2]), b(ends[3], ends[4], ends[5]);
      shape.pose = geom.frame * Eigen::Translation3d(0.5 * (a + b)) *
                   Eigen::Quaterniond::FromTwoVectors(Vector::UnitZ(), a - b);
      if (!(b - a).allFinite() || !std::isfinite((b - a).norm()))
        file_.fail(node, "the two ends of its fromto are too far apart");
      const bool round = type == "capsule" || type == "cylinder";
      half = {half[0], round ? 0.5 * (b - a).norm() : half[0], 0.5 * (b - a).norm()};
    } else {
      shape.pose = geom.frame * file_.pose(e);
    }
    if (type == "mesh") {
      const auto found = meshes_.find(mesh);
      if (found == meshes_.end()) file_.fail(node, "there is no mesh asset \"" + excerpt(mesh) + '"');
      set_mesh(found->second, robot_.links[geom.link].name, shape);
    } else {
      set_size(node, type, mesh, half, shape);
    }
    return shape;
  }

  // `half` are the sizes of MJCF.
  void set_size(xml_node node, const std::string& type, const std::string& mesh, const Vector& half,
                RobotShape& shape) const {
    if (!mesh.empty())
      file_.fail(node, "a " + excerpt(type) +
                           " that is fitted to a mesh is not read: give its size, or type=\"mesh\"");
    static const std::map<std::string_view, std::pair<RobotShape::Type, int>> types{
        {"sphere", {RobotShape::Type::sphere, 1}},
        {"capsule", {RobotShape::Type::capsule, 2}},
        {"cylinder", {RobotShape::Type::cylinder, 2}},
        {"box", {RobotShape::Type::box, 3}},
        {"ellipsoid", {RobotShape::Type::ellipsoid, 3}}};
    const auto kind = types.find(type);
    if (kind == types.end())
      file_.fail(node, "its type is none of sphere, capsule, ellipsoid, cylinder, box, mesh");
    const auto& [shape_type, count] = kind->second;
    if (!(half.head(count).minCoeff() > 0))
      file_.fail(node, "a " + type + " needs " + std::to_string(count) + " sizes above 0");
    shape.type = shape_type;
    if (type == "sphere") shape.size = Vector::Constant(half[0]);
    if (type == "capsule" || type == "cylinder") shape.size = {half[0], half[0], 2 * half[1]};
    if (type == "box") shape.size = 2 * half;
    if (type == "ellipsoid") shape.size = half;
  }

  // Those that touch, or those that are only seen.
  void take_geoms() {
    const bool any = std::ranges::any_of(geoms_, &Geom::touches);
    const bool visual = !any || (options_.visual && !std::ranges::all_of(geoms_, &Geom::touches));
    if (!any && !geoms_.empty()) note("no geom can touch anything: those to look at were padded");
    for (const Geom& g : geoms_) {
      if (g.touches == visual) continue;
      robot_.links[g.link].shapes.push_back(shape_of(g));
      bits_[g.link].insert(g.bits);
    }
    std::vector<std::string> bare;
    for (const std::size_t link : links_of_geoms())
      if (robot_.links[link].shapes.empty()) bare.push_back(robot_.links[link].name);
    note_bare(robot_, bare, visual);
  }

  std::set<std::size_t> links_of_geoms() const {
    std::set<std::size_t> links;
    for (const Geom& g : geoms_) links.insert(g.link);
    return links;
  }

  // Of a mesh or a shell only a stated mass is known, or else the density.
  struct Weight {
    Inertial inertial;
    bool mass_known = true, moments_known = true;
    double density = 0;  // if it is stated, and no mass is
  };

  // As MuJoCo weighs the geom.
  Weight weight_of(const Geom& geom) const {
    const MjcfElement& e = geom.element;
    const auto range = importing::numbers_in(file_.compiler("inertiagrouprange", "0 5"));
    const double group = file_.number(e, "group", 0), density = file_.number(e, "density", 1000);
    const double mass = file_.number(e, "mass", -1);  // below 0: none is stated
    if (density < 0 || (e.attribute("mass") && mass < 0))
      file_.fail(e.levels[0], "its mass or density is below 0");
    const bool counts = !range || range->size() != 2 || (group >= (*range)[0] && group <= (*range)[1]);
    if (!counts || mass == 0 || (mass < 0 && density == 0)) return {};
    const double stated = mass < 0 && e.attribute("density") ? density : 0;
    const std::string type = e.text("type", "sphere");
    if (e.attribute("mesh") || type == "mesh" || type == "sdf" || e.text("shellinertia") == "true")
      return {Inertial{std::max(mass, 0.0)}, mass > 0, false, stated};
    const RobotShape shape = shape_of(geom);
    return {reading::solid_inertia(shape, mass > 0 ? mass : density * reading::volume_of(shape)), true, true,
            stated};
  }

  // MuJoCo gives a body without <inertial> the mass of its geoms, those to look at included.
  void add_masses() {
    std::map<std::size_t, std::vector<Inertial>> parts;
    std::map<std::size_t, std::set<double>> densities;
    std::set<std::size_t> without_mass, without_moments;
    for (const Geom& geom : geoms_) {
      if (geom.link == 0 || robot_.model.bodies[geom.link].inertial) continue;  // the world has no mass
      const Weight weight = weight_of(geom);
      parts[geom.link].push_back(weight.inertial);
      if (!weight.mass_known || weight.inertial.mass != 0) densities[geom.link].insert(weight.density);
      if (!weight.mass_known) without_mass.insert(geom.link);
      if (!weight.moments_known) without_moments.insert(geom.link);
    }
    std::vector<std::string> shaped, padded, bare, dense;
    for (const auto& [index, geoms] : parts) {
      RobotLink& link = robot_.links[index];
      const Inertial sum = reading::sum_of(geoms);
      if (without_moments.contains(index) && link.shapes.empty())
        bare.push_back(link.name);
      else if (without_mass.contains(index) && densities[index].size() == 1 && *densities[index].begin() > 0)
        dense.push_back(link.name), link.density = *densities[index].begin();
      else if (without_mass.contains(index))
        padded.push_back(link.name);
      else if (without_moments.contains(index))
        shaped.push_back(link.name), link.mass = sum.mass;
      else if (sum.mass > 0 || !link.shapes.empty())  // 0 is said only where spheres would get another mass
        robot_.model.bodies[index].inertial = sum;
    }
    scale_masses(!padded.empty() ? padded : !dense.empty() ? dense : bare);
    if (!shaped.empty())
      note("bodies whose geoms state a mass, and whose moments follow from the shape that is padded: " +
           first_few(shaped));
    if (!dense.empty())
      note(
          "bodies whose geoms state a density, and whose mass follows from it and the shape that is "
          "padded: " +
          first_few(dense));
    if (!padded.empty())
      note(
          "bodies without <inertial> that have meshes or shells, so that their mass follows from a density "
          "and not from their geoms: " +
          first_few(padded));
    if (!bare.empty())
      note(
          "bodies without <inertial> and without spheres that have meshes or shells, which get no mass, "
          "though MuJoCo gives them that of their geoms: " +
          first_few(bare));
  }

  // What the element, or an attribute of it, stands for that no format gets from here; "" for all else.
  static std::vector<std::string> left_out(const xml_node& node) {
    const std::string_view name = node.name(), parent = node.parent().name();
    std::vector<std::string> out;
    if (parent == "equality" && (name == "connect" || name == "weld"))
      out.push_back("closed loops (connect, weld)");
    if (parent == "actuator" && name != "motor") out.push_back("actuators other than motors");
    if (parent == "tendon" || parent == "sensor") out.push_back(std::string(parent) + "s");
    if (parent == "keyframe" || ((name == "site" || name == "camera") && parent != "default"))
      out.push_back(std::string(parent == "keyframe" ? parent : name) + "s");
    const auto stated = [&](std::initializer_list<const char*> attributes) {
      for (const char* attribute : attributes)
        if (node.attribute(attribute)) out.push_back(attribute);
    };
    if (name == "joint") stated({"stiffness", "springref", "armature"});
    if (name == "option") stated({"gravity", "timestep"});
    return out;
  }

  void note_left_out() {
    struct Walker : pugi::xml_tree_walker {
      std::set<std::string> found;
      bool for_each(xml_node& node) override {
        for (const std::string& words : left_out(node)) found.insert(words);
        return true;
      }
    } walker;
    file_.root().traverse(walker);
    std::string all;
    for (const std::string& words : walker.found) all += (all.empty() ? "" : ", ") + words;
    if (!all.empty()) note("left out, since no link, joint or pair of links has it: " + all);
  }

  // Of masses that the file states: MuJoCo scales them to the sum that its compiler names.
  void scale_masses(const std::vector<std::string>& unknown) {
    const auto numbers = importing::numbers_in(file_.compiler("settotalmass", ""));
    const double asked = numbers && numbers->size() == 1 ? numbers->front() : -1;
    double sum = 0;
    for (const Body& b : robot_.model.bodies) sum += b.inertial ? b.inertial->mass : 0;
    for (const RobotLink& link : robot_.links) sum += link.mass;
    if (!(asked > 0)) return;
    if (!unknown.empty()) {
      note("settotalmass, which is left out, since not all masses are stated");
      return;
    }
    for (Body& b : robot_.model.bodies)
      if (b.inertial && sum > 0) b.inertial->mass *= asked / sum, b.inertial->inertia *= asked / sum;
    for (RobotLink& link : robot_.links)
      if (sum > 0) link.mass *= asked / sum;
  }

  Joint* joint_named(const std::string& name) {
    for (Body& b : robot_.model.bodies)
      if (b.joint.name == name && joints_.contains(name)) return &b.joint;
    return nullptr;
  }

  void add_mimic(xml_node node) {
    const MjcfElement e = file_.with_defaults(node, "");
    Joint* joint = joint_named(e.text("joint1"));
    const std::string leader = e.text("joint2");
    if (!joint) file_.fail(node, "joint1 is no joint of this model");
    const auto c = file_.numbers(e, "polycoef", 1, 5, {0, 1, 0, 0, 0});
    const bool straight = std::all_of(c.begin() + std::min<std::ptrdiff_t>(2, std::ssize(c)), c.end(),
                                      [](double x) { return x == 0; });
    if (leader.empty() || !straight || c.size() < 2) {
      note("joint " + excerpt(joint->name) +
           ": its equality is no line of another joint's place, and was left out");
      return;
    }
    const Joint* other = joint_named(leader);
    if (!other) file_.fail(node, "joint2 is no joint of this model");
    joint->mimic = leader, joint->multiplier = c[1];
    joint->offset = joint->reference + c[0] - c[1] * other->reference;
  }

  void add_effort(xml_node node) {
    const MjcfElement e = file_.with_defaults(node, "");
    Joint* joint = joint_named(e.text("joint"));
    if (!joint || joint->effort > 0) return;
    const double gear = std::abs(file_.numbers(e, "gear", 1, 6, {1})[0]);
    auto range = file_.numbers(e, "forcerange", 2, 2);
    if (range.empty() && std::string_view(node.name()) == "motor")
      range = file_.numbers(e, "ctrlrange", 2, 2);
    if (!range.empty()) joint->effort = gear * std::max(std::abs(range[0]), std::abs(range[1]));
  }

  void keep_apart() {
    const auto never = [&](std::size_t a, std::size_t b) {
      for (const auto& [type_a, with_a] : bits_[a])
        for (const auto& [type_b, with_b] : bits_[b])
          if ((type_a & with_b) || (type_b & with_a)) return false;
      return true;
    };
    std::set<std::pair<std::size_t, std::size_t>> pairs;
    for (const auto& [a, bits] : bits_)
      for (const auto& [b, other] : bits_)
        if (a < b && never(a, b)) pairs.insert({a, b});
    for (const xml_node& section : file_.root().children("contact"))
      for (const xml_node& exclude : section.children("exclude")) {
        std::array<std::size_t, 2> at{};
        for (std::size_t k = 0; k < 2; k++) {
          const auto found = index_.find(exclude.attribute(k == 0 ? "body1" : "body2").as_string());
          if (found == index_.end()) file_.fail(exclude, "it names a body that is not there");
          at[k] = found->second;
        }
        if (at[0] != at[1]) pairs.insert(std::minmax(at[0], at[1]));
      }
    for (const xml_node& section : file_.root().children("contact"))  // whatever else keeps these apart
      for (const xml_node& pair : section.children("pair"))
        pairs.erase(std::minmax(paired_link(pair, "geom1"), paired_link(pair, "geom2")));
    for (const auto& [a, b] : neighbours(robot_)) pairs.erase({a, b});
    for (const auto& [a, b] : pairs) robot_.model.apart.push_back({a, b, "User"});
  }

  std::size_t paired_link(xml_node pair, const char* end) const {
    const auto found = links_of_paired_.find(pair.attribute(end).as_string());
    if (found == links_of_paired_.end()) file_.fail(pair, std::string("its ") + end + " is not there");
    return found->second;
  }

  fs::path path_;
  MjcfFile file_;
  const RobotReadOptions& options_;
  RobotTree robot_;
  std::map<std::string, xml_node> meshes_;
  std::map<std::string, std::size_t> index_;  // of the links
  std::set<std::string> joints_;
  std::set<std::string> body_names_, joint_names_;  // stated and invented ones
  std::vector<std::string> unlimited_;              // joints that slide
  std::vector<Geom> geoms_;
  std::map<std::size_t, std::set<Bits>> bits_;          // of each link with shapes
  std::set<std::string> paired_;                        // geoms that a <pair> names
  std::map<std::string, std::size_t> links_of_paired_;  // that these geoms stand in
  std::size_t planes_ = 0, soft_ = 0;
};

}  // namespace

RobotTree read_mjcf(const fs::path& path, const RobotReadOptions& options) {
  return MjcfReader(path, options).read();
}

}  // namespace padder
