// SPDX-License-Identifier: MIT
#include "padding/robots/mjcf_file.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>

#include "padding/asset/error.h"
#include "padding/asset/excerpt.h"
#include "padding/asset/file.h"
#include "padding/import/xml.h"
#include "padding/robots/mesh_file.h"

namespace padder::reading {

namespace fs = std::filesystem;

namespace {

constexpr const char* kTurns[] = {"axisangle", "euler", "xyaxes", "zaxis"};  // instead of `quat`
constexpr const char* kMain = "main";                                        // the class of what names none

Eigen::Quaterniond about(int axis, double angle) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, Vector::Unit(axis)));
}

}  // namespace

pugi::xml_attribute MjcfElement::attribute(const char* name) const {
  for (const pugi::xml_node& level : levels)
    if (const auto found = level.attribute(name)) return found;
  return {};
}

MjcfFile::MjcfFile(const fs::path& path) : path_(path) {
  importing::load_xml(document_, read_file(path, kMostText), path.string());
  if (!root()) throw Error(path.string() + ": <mujoco> is not its root");
  std::vector<std::string> seen{path.filename().string()};
  follow_includes(root(), seen);
  classes_[kMain] = {};
  const auto defaults = root().children("default");
  for (const pugi::xml_node& node : defaults) add_defaults(node, "");
  // The outermost class holds for all elements, whatever it is called.
  for (const pugi::xml_node& node : defaults)
    if (const auto name = node.attribute("class")) classes_.emplace(name.as_string(), classes_[kMain]);
  const std::string unit = compiler("angle", "degree");
  if (unit != "degree" && unit != "radian")
    fail(root().child("compiler"), "angle is degree or radian, not \"" + excerpt(unit) + '"');
  if (unit == "degree") angle_ = std::numbers::pi / 180;
  sequence_ = compiler("eulerseq", "xyz");
  if (sequence_.size() != 3 || sequence_.find_first_not_of("xyzXYZ") != std::string::npos)
    fail(root().child("compiler"),
         "eulerseq is three of x, y, z, X, Y, Z, not \"" + excerpt(sequence_) + '"');
  if (compiler("coordinate", "local") != "local")
    fail(root().child("compiler"),
         "global coordinates are not read, as in MuJoCo since 2.3.3: save it with local ones");
}

void MjcfFile::fail(const pugi::xml_node& node, const std::string& what) const {
  const std::string name = node.attribute("name").as_string();
  throw Error(path_.string() + ", <" + excerpt(node.name()) +
              (name.empty() ? "" : " name=\"" + excerpt(name) + '"') + ">: " + what);
}

void MjcfFile::follow_includes(pugi::xml_node node, std::vector<std::string>& seen) {
  for (pugi::xml_node child = node.first_child(); child;) {
    const pugi::xml_node next = child.next_sibling();
    if (std::strcmp(child.name(), "include") == 0) {
      const std::string name = child.attribute("file").as_string();
      if (name.empty()) fail(child, "it names no file");
      if (std::find(seen.begin(), seen.end(), name) != seen.end())
        fail(child, "the file " + excerpt(name) + " is included twice");
      seen.push_back(name);
      const fs::path file = file_in(path_.parent_path(), name);
      included_.push_back(file);
      pugi::xml_document part;
      try {
        importing::load_xml(part, read_file(file, kMostText), file.string());
      } catch (const Error& e) {
        fail(child, e.what());
      }
      follow_includes(part.document_element(), seen);
      for (const pugi::xml_node& inner : part.document_element().children())
        node.insert_copy_before(inner, child);
      node.remove_child(child);
    } else {
      follow_includes(child, seen);
    }
    child = next;
  }
}

void MjcfFile::add_defaults(pugi::xml_node node, const std::string& above) {
  const std::string name = above.empty() ? kMain : node.attribute("class").as_string();
  if (name.empty()) fail(node, "a default inside another one needs a class");
  // As in MuJoCo. The chains of classes inside one another would grow without end.
  if (!above.empty() && classes_.contains(name))
    fail(node, "there is a class \"" + excerpt(name) + "\" already");
  auto& chain = classes_[name];
  chain.insert(chain.begin(), node);  // several sections of the same class: the later counts first
  if (!above.empty()) {
    const auto& outer = classes_[above];
    chain.insert(chain.end(), outer.begin(), outer.end());
  }
  for (const pugi::xml_node& inner : node.children("default")) add_defaults(inner, name);
}

std::string MjcfFile::compiler(const char* name, const char* otherwise) const {
  std::string value = otherwise;
  for (const pugi::xml_node& node : root().children("compiler"))
    if (const auto attribute = node.attribute(name)) value = attribute.as_string();
  return value;
}

MjcfElement MjcfFile::with_defaults(pugi::xml_node node, const std::string& childclass) const {
  MjcfElement e{{node}};
  const std::string name = node.attribute("class").as_string(childclass.empty() ? kMain : childclass.c_str());
  const auto found = classes_.find(name);
  if (found == classes_.end()) fail(node, "there is no default class \"" + excerpt(name) + '"');
  for (const pugi::xml_node& level : found->second)
    if (const pugi::xml_node values = level.child(node.name())) e.levels.push_back(values);
  return e;
}

std::vector<double> MjcfFile::numbers(const MjcfElement& e, const char* name, std::size_t least,
                                      std::size_t most, std::vector<double> otherwise) const {
  std::vector<double> out = std::move(otherwise);
  const auto finite = [](double v) { return std::isfinite(v); };
  for (auto level = e.levels.rbegin(); level != e.levels.rend(); ++level) {
    const pugi::xml_attribute attribute = level->attribute(name);
    if (!attribute) continue;
    const auto own = importing::numbers_in(attribute.as_string());
    if (!own || own->size() < least || own->size() > most || !std::ranges::all_of(*own, finite))
      fail(*level, std::string(name) + " takes " + std::to_string(least) +
                       (least == most ? "" : " to " + std::to_string(most)) +
                       (most == 1 ? " number" : " numbers") + ", not \"" + excerpt(attribute.as_string()) +
                       '"');
    out.resize(std::max(out.size(), own->size()));
    std::ranges::copy(*own, out.begin());
  }
  return out;
}

double MjcfFile::number(const MjcfElement& e, const char* name, double otherwise) const {
  return numbers(e, name, 1, 1, {otherwise})[0];
}

Vector MjcfFile::vector(const MjcfElement& e, const char* name, const Vector& otherwise) const {
  const auto v = numbers(e, name, 3, 3, {otherwise.x(), otherwise.y(), otherwise.z()});
  return {v[0], v[1], v[2]};
}

Eigen::Quaterniond MjcfFile::orientation(const MjcfElement& e) const {
  // As in MuJoCo, where a class that has one of these counts even for an element that has a quat.
  for (const pugi::xml_node& level : e.levels) {
    std::string turns = level.attribute("quat") ? "quat" : "";
    bool another = false;
    for (const char* name : kTurns)
      if (level.attribute(name)) turns += (turns.empty() ? "" : " and ") + std::string(name), another = true;
    if (!another) continue;
    if (turns.find(' ') != std::string::npos) fail(level, "it has " + turns + ": leave one, as MuJoCo wants");
    const MjcfElement own{{level}};
    const auto direction = [&](const Vector& along) -> Vector {
      if (!(along.norm() > 0)) fail(level, "its " + turns + " has a direction without length");
      return along.normalized();
    };
    if (const auto a = numbers(own, "axisangle", 4, 4); !a.empty())
      return Eigen::Quaterniond(Eigen::AngleAxisd(a[3] * angle_, direction({a[0], a[1], a[2]})));
    if (const auto a = numbers(own, "euler", 3, 3); !a.empty()) {
      Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();
      for (std::size_t k = 0; k < 3; k++) {
        // Small letters turn about the axes as they are turned, capitals about fixed ones.
        const bool fixed = sequence_[k] < 'a';
        const Eigen::Quaterniond next = about(sequence_[k] - (fixed ? 'X' : 'x'), a[k] * angle_);
        turn = fixed ? next * turn : turn * next;
      }
      return turn;
    }
    if (const auto a = numbers(own, "xyaxes", 6, 6); !a.empty()) {
      const Vector x = direction({a[0], a[1], a[2]}), along(a[3], a[4], a[5]);
      const Vector y = direction(along - x.dot(along) * x);
      Eigen::Matrix3d axes;
      axes << x, y, x.cross(y);
      return Eigen::Quaterniond(axes);
    }
    return Eigen::Quaterniond::FromTwoVectors(Vector::UnitZ(),
                                              direction(vector(own, "zaxis", Vector::UnitZ())));
  }
  const auto q = numbers(e, "quat", 4, 4, {1, 0, 0, 0});
  const Eigen::Quaterniond turn(q[0], q[1], q[2], q[3]);
  if (!(turn.norm() > 0)) fail(e.levels[0], "its quat has no length");
  return turn.normalized();
}

Eigen::Isometry3d MjcfFile::pose(const MjcfElement& e) const {
  return Eigen::Translation3d(vector(e, "pos", Vector::Zero())) * orientation(e);
}

}  // namespace padder::reading
