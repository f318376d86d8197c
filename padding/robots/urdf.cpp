// SPDX-License-Identifier: MIT
#include "padding/robots/urdf.h"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <map>
#include <optional>
#include <pugixml.hpp>
#include <set>
#include <sstream>

#include "padding/asset/error.h"
#include "padding/asset/excerpt.h"
#include "padding/asset/file.h"
#include "padding/import/xml.h"
#include "padding/input/packages.h"
#include "padding/robots/mesh_file.h"

namespace padder {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostExpanded = std::size_t(256) << 20;  // bytes that xacro may make of a file
constexpr int kNotFound = 127;                                 // exit code, as a shell's

struct ProgramOutput {
  std::string text;
  int code = -1;  // the exit code; -1 where the program did not end by itself
  bool too_long = false;
};

// Runs a program and takes what it prints, up to `most` bytes. It ends with this process.
ProgramOutput output_of(const std::vector<std::string>& words, std::size_t most) {
  std::vector<char*> arguments;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  ProgramOutput out;
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) return out;
  const pid_t parent = ::getpid(), child = ::fork();
  if (child == 0) {  // of a process with threads: only what a signal handler may call
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (::getppid() != parent || ::dup2(ends[1], STDOUT_FILENO) < 0) ::_exit(1);
    ::execvp(arguments[0], arguments.data());
    ::_exit(kNotFound);
  }
  ::close(ends[1]);
  char part[65536];
  ssize_t n = 1;
  while (child > 0 && !out.too_long && n != 0) {
    n = ::read(ends[0], part, sizeof part);
    if (n < 0 && errno != EINTR) break;
    if (n > 0) out.text.append(part, static_cast<std::size_t>(n));
    out.too_long = out.text.size() > most;
  }
  ::close(ends[0]);
  if (out.too_long) ::kill(child, SIGKILL);
  int status = 0;
  while (child > 0 && ::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (child > 0 && WIFEXITED(status)) out.code = WEXITSTATUS(status);
  return out;
}

class UrdfReader {
 public:
  UrdfReader(const fs::path& path, const RobotReadOptions& options) : path_(path), options_(options) {}

  RobotTree read() {
    RobotTree robot;
    robot.model.urdf = ending_of(path_) == ".xacro" ? expanded() : read_file(path_, kMostText);
    robot.model.file = path_.filename().string();
    robot.model.unit = "m";
    pugi::xml_document document;
    importing::load_xml(document, robot.model.urdf, path_.string());
    const pugi::xml_node root = document.child("robot");
    if (!root) fail("<robot> is not its root");
    const auto of_xacro = [](const auto& n) { return std::string_view(n.name()).starts_with("xacro:"); };
    if (const auto macro = document.find_node(of_xacro))
      fail("it holds <" + excerpt(macro.name()) +
           ">, which the program xacro expands: expand it, or give the file an ending of .xacro");
    robot.model.name = root.attribute("name").as_string("robot");
    bool collision = false, seen = false;
    for (const auto& link : root.children("link"))
      collision |= !link.child("collision").empty(), seen |= !link.child("visual").empty();
    const bool visual = options_.visual || !collision;
    for (const auto& link : root.children("link")) add_link(link, visual ? "visual" : "collision", robot);
    if (links_.empty()) fail("there is no <link> in it");
    if (!visual && seen && std::ranges::all_of(links_, [](const RobotLink& l) { return l.shapes.empty(); }))
      fail("its collision shapes are all points, which are left out: --visual pads what can be seen");
    for (const auto& joint : root.children("joint")) add_joint(joint);
    check_mimics();
    if (!collision && seen)
      robot.notes.push_back("no link has collision geometry: the visual geometry was padded");
    note_bare(robot, bare_, visual);
    std::vector<std::string> crossed, locked;
    for (Body& b : bodies_) {
      if (b.joint.lower > b.joint.upper) {
        crossed.push_back(b.joint.name);
        b.joint.lower = Joint().lower, b.joint.upper = Joint().upper;
      }
      if (b.joint.locked()) locked.push_back(b.joint.name);
    }
    const auto note = [&](const char* what, const std::vector<std::string>& joints) {
      if (!joints.empty()) robot.notes.push_back(what + first_few(joints));
    };
    note("joints whose lower limit is above the upper one are taken to have no limits: ", crossed);
    note("joints that do not move, because their limits (0 where <limit> states none) leave only one place: ",
         locked);
    note("joints whose axis has no length are taken as fixed: ", axisless_);
    note("links whose <inertial> lacks <mass>, so that mass and moments follow from a density: ", massless_);
    note(
        "links whose <inertial> lacks the moments of <inertia>, which follow from the shape that is padded: ",
        momentless_);
    note("joints that mimic one that is not there are taken to follow none: ", leaderless_);
    order(robot);
    return robot;
  }

 private:
  // What the program xacro of ROS makes of the file.
  std::string expanded() const {
    std::vector<std::string> words{"xacro", path_.string()};
    if (words[1].starts_with('-')) words[1].insert(0, "./");  // it is no option
    words.insert(words.end(), options_.xacro.begin(), options_.xacro.end());
    const ProgramOutput result = output_of(words, kMostExpanded);
    if (result.too_long)
      fail("xacro makes more than " + std::to_string(kMostExpanded >> 20) +
           " MiB of it: look for a macro that calls itself");
    if (result.code == kNotFound)
      fail(
          "the program xacro, which expands it, is not installed: install it (ROS's package xacro), or "
          "expand the file elsewhere and give the .urdf");
    if (result.code != 0) fail("xacro cannot expand it, for the reason that it gave above");
    return result.text;
  }

  [[noreturn]] void fail(const std::string& what) const { throw Error(path_.string() + ": " + what); }

  static std::string text_of(const pugi::xml_node& node) {
    std::ostringstream text;
    node.print(text, "", pugi::format_raw);
    return text.str();
  }
  // Of several elements where one may be, all but the first would be lost, unless they say the same.
  static bool has_others(const pugi::xml_node& node, const char* name) {
    const pugi::xml_node first = node.child(name);
    for (pugi::xml_node more = first; (more = more.next_sibling(name));)
      if (text_of(more) != text_of(first)) return true;
    return false;
  }
  pugi::xml_node only_child(const pugi::xml_node& node, const char* name, const std::string& where) const {
    if (has_others(node, name))
      fail(where + ": its <" + excerpt(node.name()) + "> has more than one <" + name + ">: leave one");
    return node.child(name);
  }
  // Empty where there is none that is known.
  pugi::xml_node only_shape(const pugi::xml_node& geometry, const std::string& where) const {
    pugi::xml_node found;
    for (const char* name : {"mesh", "box", "cylinder", "capsule", "sphere"})
      if (const pugi::xml_node shape = only_child(geometry, name, where)) {
        if (found)
          fail(where + ": its <geometry> has more than one shape, <" + excerpt(found.name()) + "> and <" +
               name + ">: leave one, or write an element for each");
        found = shape;
      }
    return found;
  }

  // An empty attribute gives `otherwise`.
  Vector three(const pugi::xml_attribute& attribute, const Vector& otherwise,
               const std::string& where) const {
    if (!*attribute.as_string()) return otherwise;
    const auto v = importing::numbers_in(attribute.as_string());
    if (!v || v->size() != 3 || !Vector((*v)[0], (*v)[1], (*v)[2]).allFinite())
      fail(where + ": " + wants("three numbers", attribute));
    return {(*v)[0], (*v)[1], (*v)[2]};
  }
  static std::string wants(const char* what, const pugi::xml_attribute& attribute) {
    const std::string text = attribute.as_string();
    const bool xacro = text.find("${") != std::string::npos || text.find("$(") != std::string::npos;
    return std::string(attribute.name()) + " wants " + what + ", not \"" + excerpt(text) + "\"" +
           (xacro ? ": expand the file with the program xacro first" : "");
  }
  double one(const pugi::xml_node& node, const char* name, const std::string& where) const {
    const pugi::xml_attribute attribute = node.attribute(name);
    if (!attribute) fail(where + ": a number is wanted as its " + name);
    const auto v = importing::numbers_in(attribute.as_string());
    if (!v || v->size() != 1 || !std::isfinite((*v)[0])) fail(where + ": " + wants("a number", attribute));
    return (*v)[0];
  }
  double positive(const pugi::xml_node& node, const char* name, const std::string& where) const {
    const double v = one(node, name, where);
    if (!(v > 0)) fail(where + ": " + wants("a number above 0", node.attribute(name)));
    return v;
  }

  Eigen::Isometry3d place(const pugi::xml_node& origin, const std::string& where) const {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    const pugi::xml_attribute rpy = origin.attribute("rpy"), quat = origin.attribute("quat_xyzw");
    if (rpy && quat) fail(where + ": an origin has rpy and quat_xyzw, leave one out");
    pose.translation() = three(origin.attribute("xyz"), Vector::Zero(), where);
    const Vector turn = three(rpy, Vector::Zero(), where);
    if (!turn.isZero(0))
      pose.linear() =
          (Eigen::AngleAxisd(turn.z(), Vector::UnitZ()) * Eigen::AngleAxisd(turn.y(), Vector::UnitY()) *
           Eigen::AngleAxisd(turn.x(), Vector::UnitX()))
              .toRotationMatrix();
    if (quat) {
      const auto v = importing::numbers_in(quat.as_string());
      const Eigen::Vector4d q = v && v->size() == 4 ? Eigen::Vector4d(v->data()) : Eigen::Vector4d::Zero();
      if (!(q.norm() > 0) || !std::isfinite(q.norm()))
        fail(where + ": " + wants("four numbers that are not all 0", quat));
      pose.linear() = Eigen::Quaterniond(q.normalized()).toRotationMatrix();
    }
    return pose;
  }

  fs::path home() const { return fs::absolute(path_).lexically_normal().parent_path(); }

  // What a reference names: a file, or one in a package.
  struct Place {
    std::optional<std::string> package;  // "" is searched for, too: package:///rest
    fs::path file;
  };
  Place place_of(std::string name) const {
    const auto drop = [&](std::string_view start) {
      const bool has = name.starts_with(start);
      if (has) name.erase(0, start.size());
      return has;
    };
    const bool uri = drop("file://");
    if (uri && !name.starts_with("/")) drop("localhost");
    if (drop("package://") || drop("model://")) {
      const std::size_t slash = std::min(name.find('/'), name.size());
      return {name.substr(0, slash), name.substr(std::min(slash + 1, name.size()))};
    }
    if (const std::size_t end = name.find(")/"); name.starts_with("$(find ") && end != std::string::npos)
      return {name.substr(7, end - 7), name.substr(end + 2)};
    return {{}, home() / name};  // which a name that begins with / replaces
  }

  std::vector<fs::path> places(const std::string& name) const {
    const Place place = place_of(name);
    if (!place.package) return {place.file};
    const auto [at, fresh] = packages_.try_emplace(*place.package);
    if (fresh) at->second = places_in_package(*place.package, "", home(), options_.package_folders);
    std::vector<fs::path> files;
    for (const fs::path& root : at->second) files.push_back(root / place.file);
    return files;
  }

  fs::path found(const std::string& reference, const std::string& where) const {
    const bool uri = reference.find("://") != std::string::npos;
    const std::string plain = uri ? unescaped(reference) : reference;
    // Some forget to escape, and some write for Windows. Isaac Gym's names start from a folder above.
    std::vector<std::string> names = {plain, reference, reading::slashed(plain), reading::slashed(reference)};
    if (!uri && !plain.starts_with(".") && !plain.starts_with("/"))
      names.push_back("package://" + reading::slashed(plain));
    std::vector<fs::path> all;
    std::error_code code;
    for (const std::string& name : names)
      for (const fs::path& p : places(name)) {
        if (fs::is_regular_file(p, code)) return p;
        all.push_back(p);
      }
    std::string other;
    for (std::size_t k = 0; k < all.size() && other.empty(); k++) other = reading::in_other_case(all[k]);
    fail(where + ": the mesh " + excerpt(reference, 200) + " is not there: " +
         (!place_of(reference).package
              ? "looked for " + excerpt(all[0].string(), 500)
              : "neither a folder above the URDF has it, nor one of ROS_PACKAGE_PATH or AMENT_PREFIX_PATH; "
                "name the folder of its package with --package-path") +
         other);
  }

  void add_link(const pugi::xml_node& node, const char* kind, RobotTree& robot) {
    RobotLink link;
    Body body;
    link.name = body.name = node.attribute("name").as_string();
    const std::string where = "link " + excerpt(link.name);
    if (link.name.empty()) fail("a <link> has no name");
    if (!index_.emplace(link.name, links_.size()).second) fail("two links are called " + excerpt(link.name));
    const auto leave_out = [&](const char* point) {
      robot.notes.push_back(link.name + ": a " + point + ", which is a point, was left out");
    };
    for (const auto& element : node.children(kind)) {
      const pugi::xml_node geometry = only_child(element, "geometry", where),
                           given = only_shape(geometry, where);
      const std::string_view type = given.name();
      RobotShape shape;
      shape.pose = place(only_child(element, "origin", where), where);
      if (type == "mesh") {
        const std::string name = given.attribute("filename").as_string();
        if (name.empty()) fail(where + ": its <mesh> has no filename");
        shape.file = found(name, where);
        shape.scale = three(given.attribute("scale"), Vector::Ones(), where);
        if ((shape.scale.array() == 0).any()) fail(where + ": a mesh has a scale of 0");
      } else if (type == "box") {
        shape.type = RobotShape::Type::box;
        shape.size = three(given.attribute("size"), Vector::Constant(-1), where);
        if (shape.size.isZero(0)) {  // of links that stand for a place, as the base of Kinova's arms
          leave_out("box of size 0");
          continue;
        }
        if (!(shape.size.minCoeff() > 0)) fail(where + ": a box has no positive size");
      } else if (type == "cylinder" || type == "capsule") {
        shape.type = type == "cylinder" ? RobotShape::Type::cylinder : RobotShape::Type::capsule;
        const double r = positive(given, "radius", where);
        shape.size = {r, r, positive(given, "length", where)};
      } else if (type == "sphere") {
        if (one(given, "radius", where) == 0) {  // a place where Drake looks for contacts
          leave_out("sphere of radius 0");
          continue;
        }
        shape.type = RobotShape::Type::sphere;
        shape.size = Vector::Constant(positive(given, "radius", where));
      } else {
        const std::string unknown = geometry.first_child().name();
        fail(where + ": its geometry is none of mesh, box, cylinder, capsule, sphere" +
             (unknown.empty() ? "" : ", but <" + excerpt(unknown) + ">"));
      }
      link.shapes.push_back(std::move(shape));
    }
    const char* other = std::string_view(kind) == "collision" ? "visual" : "collision";
    if (link.shapes.empty() && node.child(other)) bare_.push_back(link.name);
    if (has_others(node, "inertial"))  // robots that are in use have it
      robot.notes.push_back(link.name +
                            ": it has more than one <inertial>, of which the first counts, as in ROS");
    if (const auto inertial = node.child("inertial")) add_inertial(inertial, where, link, body);
    links_.push_back(std::move(link)), bodies_.push_back(std::move(body)), parents_.push_back(-1);
  }

  // Isaac takes one without mass or moments, too, and computes what is missing.
  void add_inertial(const pugi::xml_node& inertial, const std::string& where, RobotLink& link, Body& body) {
    const auto mass = only_child(inertial, "mass", where), m = only_child(inertial, "inertia", where);
    if (!mass.attribute("value")) return massless_.push_back(link.name);
    Inertial i;
    i.mass = one(mass, "value", where + ", <mass>");
    if (i.mass < 0) fail(where + ": its mass is below 0: state one of at least 0");
    if (!m.attribute("ixx") || !m.attribute("iyy") || !m.attribute("izz")) {
      momentless_.push_back(link.name);
      if (!link.shapes.empty()) link.mass = i.mass;
      return;
    }
    const Eigen::Isometry3d frame = place(only_child(inertial, "origin", where), where);
    i.center = frame.translation();
    const char* names[3][3] = {{"ixx", "ixy", "ixz"}, {"ixy", "iyy", "iyz"}, {"ixz", "iyz", "izz"}};
    for (int row = 0; row < 3; row++)
      for (int column = 0; column < 3; column++)
        if (const char* name = names[row][column]; m.attribute(name))
          i.inertia(row, column) = one(m, name, where + ", <inertia>");
    i.inertia = frame.linear() * i.inertia * frame.linear().transpose();
    body.inertial = i;
  }

  void add_joint(const pugi::xml_node& node) {
    static const std::map<std::string_view, Joint::Type> types{
        {"fixed", Joint::Type::fixed},           {"revolute", Joint::Type::revolute},
        {"continuous", Joint::Type::continuous}, {"prismatic", Joint::Type::prismatic},
        {"planar", Joint::Type::planar},         {"floating", Joint::Type::floating},
        {"spherical", Joint::Type::ball}};
    Joint joint;
    joint.name = node.attribute("name").as_string();
    if (joint.name.empty()) fail("a <joint> has no name");
    const std::string where = "joint " + excerpt(joint.name);
    if (!joint_names_.insert(joint.name).second) fail("two joints are called " + excerpt(joint.name));
    const auto type = types.find(node.attribute("type").as_string());
    if (type == types.end())
      fail(where + ": \"" + excerpt(node.attribute("type").as_string()) + "\" is no type of joint");
    joint.type = type->second;
    for (const char* name : {"parent", "child", "origin", "axis", "limit", "dynamics", "mimic"})
      only_child(node, name, where);
    const auto link = [&](const char* which) {
      const auto it = index_.find(node.child(which).attribute("link").as_string());
      if (it == index_.end())
        fail(where + ": its " + which + " \"" + excerpt(node.child(which).attribute("link").as_string()) +
             "\" is not a link of this robot");
      return it->second;
    };
    const std::size_t parent = link("parent"), child = link("child");
    if (parents_[child] >= 0) fail(where + ": " + excerpt(links_[child].name) + " has a parent already");
    const Vector axis = three(node.child("axis").attribute("xyz"), Vector::UnitX(), where);
    const bool has_axis = joint.type != Joint::Type::fixed && joint.type != Joint::Type::floating &&
                          joint.type != Joint::Type::ball;
    if (has_axis && axis.norm() > 0) joint.axis = axis.normalized();
    if (has_axis && !(axis.norm() > 0)) joint.type = Joint::Type::fixed, axisless_.push_back(joint.name);
    if (const auto limit = node.child("limit"); limit && joint.may_have_limits()) {
      joint.lower = limit.attribute("lower") ? one(limit, "lower", where) : 0;
      joint.upper = limit.attribute("upper") ? one(limit, "upper", where) : 0;
    }
    const auto or_default = [&](const pugi::xml_node& element, const char* name, double otherwise) {
      return element.attribute(name) ? one(element, name, where) : otherwise;
    };
    joint.effort = or_default(node.child("limit"), "effort", 0);
    joint.damping = or_default(node.child("dynamics"), "damping", 0);
    joint.friction = or_default(node.child("dynamics"), "friction", 0);
    if (const auto mimic = node.child("mimic")) {
      joint.mimic = mimic.attribute("joint").as_string();
      joint.multiplier = or_default(mimic, "multiplier", 1);
      joint.offset = or_default(mimic, "offset", 0);
    }
    parents_[child] = static_cast<int>(parent);
    bodies_[child].joint = std::move(joint);
    bodies_[child].pose = place(node.child("origin"), where);
  }

  void check_mimics() {
    for (Body& b : bodies_) {
      if (b.joint.mimic.empty() || joint_names_.contains(b.joint.mimic)) continue;
      leaderless_.push_back(b.joint.name);
      b.joint.mimic.clear();
    }
    std::map<std::string_view, const Joint*> named;
    for (const Body& b : bodies_) named[b.joint.name] = &b.joint;
    for (const Body& b : bodies_) {
      const Joint* leader = &b.joint;
      for (std::size_t turns = 0; !leader->mimic.empty(); turns++, leader = named.at(leader->mimic))
        if (turns > bodies_.size())
          fail("joint " + excerpt(b.joint.name) + ": the joints that it mimics go round in a circle at " +
               excerpt(leader->name));
    }
  }

  // Puts parents before their children, and keeps the order of the file otherwise.
  void order(RobotTree& robot) {
    std::vector<int> at(links_.size(), -1);
    for (std::size_t k = 0; k < links_.size(); k++) {
      std::vector<std::size_t> chain;  // from k up to the first link that is in the list
      for (int up = static_cast<int>(k); up >= 0 && at[static_cast<std::size_t>(up)] < 0;
           up = parents_[static_cast<std::size_t>(up)]) {
        if (chain.size() > links_.size())
          fail("its joints go round in a circle at " + excerpt(links_[k].name));
        chain.push_back(static_cast<std::size_t>(up));
      }
      for (auto it = chain.rbegin(); it != chain.rend(); ++it) {
        at[*it] = static_cast<int>(robot.links.size());
        const int parent = parents_[*it];
        bodies_[*it].parent = parent < 0 ? -1 : at[static_cast<std::size_t>(parent)];
        robot.model.bodies.push_back(std::move(bodies_[*it]));
        robot.links.push_back(std::move(links_[*it]));
      }
    }
    std::vector<std::string> roots;
    for (const Body& b : robot.model.bodies)
      if (b.parent < 0) roots.push_back(b.name);
    if (roots.size() > 1)
      fail("a robot has one root, and here are " + std::to_string(roots.size()) + ": " + first_few(roots));
  }

  fs::path path_;
  const RobotReadOptions& options_;
  mutable std::map<std::string, std::vector<fs::path>> packages_;  // where each may be: searching takes long
  std::vector<RobotLink> links_;
  std::vector<Body> bodies_;
  std::vector<int> parents_;
  std::map<std::string, std::size_t, std::less<>> index_;
  std::set<std::string> joint_names_;
  std::vector<std::string> axisless_, leaderless_;  // joints
  std::vector<std::string> massless_, momentless_;  // links with an <inertial> that states none of these
  std::vector<std::string> bare_;  // links that have no shapes of the kind asked for, but of the other
};

}  // namespace

RobotTree read_urdf(const fs::path& path, const RobotReadOptions& options) {
  return UrdfReader(path, options).read();
}

}  // namespace padder
