// SPDX-License-Identifier: MIT
// Reads 3MF, a zip archive with XML. assimp 5.2 does not deliver the unit and keeps only floats. The format
// is in github.com/3MFConsortium/spec_core; its spec_production has objects in further files.
#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <iterator>
#include <map>
#include <pugixml.hpp>

#include "padding/asset/excerpt.h"
#include "padding/asset/file.h"
#include "padding/input/read_internal.h"
#include "padding/input/zip.h"

namespace padder::reading {
namespace {

// 3MF writes matrices that act on row vectors: the transpose of these.
using Transform = Eigen::Matrix<double, 3, 4>;

Transform times(const Transform& a, const Transform& b) {
  Transform out;
  out.leftCols<3>() = a.leftCols<3>() * b.leftCols<3>();
  out.col(3) = a.leftCols<3>() * b.col(3) + a.col(3);
  return out;
}

std::string_view without_prefix(const char* name) {
  const std::string_view text = name;
  return text.substr(text.find(':') + 1);
}

// An attribute of another namespace, such as p:path. Its prefix may be any, so only the name behind it
// counts.
const char* foreign(const pugi::xml_node& node, std::string_view name) {
  for (const pugi::xml_attribute& a : node.attributes())
    if (std::string_view(a.name()).find(':') != std::string_view::npos && without_prefix(a.name()) == name)
      return a.value();
  return "";
}

class ThreeMfReader {
 public:
  ThreeMfReader(const std::string& bytes, const std::string& where) : zip_(bytes, where), where_(where) {}

  Soup read() {
    const std::string root = root_part();
    const pugi::xml_node model = part(root).child("model");
    read_unit(model);
    const pugi::xml_node build = model.child("build");
    Counts all;
    for (const pugi::xml_node& item : build.children("item")) all += counts(object_of(root, item), 0);
    const auto whole = [](double count) { return static_cast<std::uint64_t>(std::min(count, 1e18)); };
    check_counts(whole(all.points), whole(all.faces), where_);
    for (const pugi::xml_node& item : build.children("item")) add(object_of(root, item), transform_of(item));
    if (!build.child("item")) refuse("nothing is to be built: its <build> has no <item>, export it again");
    for (const auto& [what, count] : left_out_)
      soup_.notes.push_back(std::to_string(count) + " " + what + " left out");
    return std::move(soup_);
  }

 private:
  [[noreturn]] void refuse(const std::string& what) const { fail(where_, what); }

  // The path of the part that the package calls its model.
  std::string root_part() {
    const pugi::xml_document& relations = part("/_rels/.rels");
    for (const pugi::xml_node& r : relations.child("Relationships").children("Relationship"))
      if (std::string_view(r.attribute("Type").value()).ends_with("/3dmodel"))
        return r.attribute("Target").value();
    refuse("the package names no model: export it again");
  }

  const pugi::xml_document& part(std::string name) {
    if (name.starts_with('/')) name.erase(0, 1);
    const auto [it, fresh] = parts_.try_emplace(name);
    if (!fresh) return it->second;
    const std::string text = zip_.read(name, kMostText);
    const auto result = it->second.load_buffer(text.data(), text.size());
    if (!result)
      refuse("its part '" + excerpt(name) + "' is not XML at byte " + std::to_string(result.offset) +
             ": export it again");
    if (const pugi::xml_node model = it->second.child("model")) {
      check_extensions(model);
      for (const pugi::xml_node& o : model.child("resources").children("object"))
        if (!objects_.emplace(std::pair(name, std::string(o.attribute("id").value())), o).second)
          refuse("two objects have the id '" + excerpt(o.attribute("id").value()) + "': export it again");
    }
    return it->second;
  }

  // An extension that changes the shape and is not read here must not pass in silence. Materials do not
  // change it.
  void check_extensions(const pugi::xml_node& model) const {
    std::string_view all = model.attribute("requiredextensions").value();
    for (std::string_view prefix; !(prefix = next_word(all)).empty();) {
      const std::string_view name = model.attribute(("xmlns:" + std::string(prefix)).c_str()).value();
      if (name.find("/production/") == name.npos && name.find("/material/") == name.npos)
        refuse("it needs the 3MF extension '" + excerpt(name.empty() ? prefix : name, 200) +
               "', which is not read: export it as plain triangles");
    }
  }

  void read_unit(const pugi::xml_node& model) {
    // From the units of the format to ours, and how many of ours they are.
    static const std::map<std::string_view, std::pair<const char*, double>> units = {
        {"micron", {"mm", 0.001}}, {"millimeter", {"mm", 1}}, {"centimeter", {"cm", 1}},
        {"inch", {"in", 1}},       {"foot", {"in", 12}},      {"meter", {"m", 1}}};
    const char* name = model.attribute("unit").as_string("millimeter");
    const auto it = units.find(name);
    if (it == units.end())
      refuse("its unit '" + excerpt(name) +
             "' is none of 3MF's: micron, millimeter, centimeter, inch, foot or meter");
    soup_.unit = it->second.first, factor_ = it->second.second;
  }

  double real(const pugi::xml_attribute& attribute, const std::string& what) const {
    double value = 0;
    if (parse_real(attribute.value(), value) == Number::malformed)
      refuse(what + " has " + printable(attribute.value()) + " where a number should stand: export it again");
    return value;
  }

  Transform transform_of(const pugi::xml_node& node) const {
    Transform transform = Transform::Identity();
    std::string_view text = node.attribute("transform").value();
    if (text.empty()) return transform;
    for (int row = 0; row < 4; row++)
      for (int column = 0; column < 3; column++)
        if (parse_real(next_word(text), transform(column, row)) != Number::finite)
          refuse("a transform is not of twelve numbers: export it again");
    return transform;
  }

  struct Object {
    std::string path;  // of the part that holds it
    pugi::xml_node node;
  };

  Object object_of(const std::string& path, const pugi::xml_node& reference) {
    const char* other = foreign(reference, "path");
    std::string name = *other ? other : path;
    if (name.starts_with('/')) name.erase(0, 1);
    part(name);
    const std::string id = reference.attribute("objectid").value();
    const auto it = objects_.find({name, id});
    if (it == objects_.end())
      refuse("there is no object '" + excerpt(id) + "', which is named in it: export it again");
    return {name, it->second};
  }

  struct Counts {
    double points = 0, faces = 0;
    void operator+=(const Counts& more) { points += more.points, faces += more.faces; }
  };

  // Of an object with its components. A small file may build more than any memory holds, so they are counted
  // first.
  Counts counts(const Object& object, int depth) {
    if (depth > 64) refuse("its components contain each other: export it again");
    const auto known = counts_.find(object.node);
    if (known != counts_.end()) return known->second;
    const pugi::xml_node mesh = object.node.child("mesh");
    const auto number = [](const auto& nodes) { return double(std::distance(nodes.begin(), nodes.end())); };
    Counts all{number(mesh.child("vertices").children("vertex")),
               number(mesh.child("triangles").children("triangle"))};
    for (const pugi::xml_node& c : object.node.child("components").children("component"))
      all += counts(object_of(object.path, c), depth + 1);
    return counts_[object.node] = all;
  }

  void add(const Object& object, const Transform& transform) {
    const std::string_view type = object.node.attribute("type").as_string("model");
    if (type != "model" && type != "solidsupport" && type != "support" && type != "surface" &&
        type != "other")
      refuse("an object is of the type '" + excerpt(type) + "', which 3MF has not: export it again");
    if (type == "support" || type == "solidsupport") {
      left_out_["supports"]++;
      return;
    }
    // Components of components that hold nothing could be walked through without end.
    if (const Counts& all = counts_.at(object.node); all.points == 0 && all.faces == 0) return;
    if (const pugi::xml_node mesh = object.node.child("mesh"))
      add_mesh(mesh, transform, "object '" + excerpt(object.node.attribute("id").value()) + "'");
    for (const pugi::xml_node& c : object.node.child("components").children("component"))
      add(object_of(object.path, c), times(transform, transform_of(c)));
  }

  void add_mesh(const pugi::xml_node& mesh, const Transform& transform, const std::string& object) {
    for (const pugi::xml_node& child : mesh.children())
      if (without_prefix(child.name()) == "beamlattice") left_out_["beam lattices"]++;
    const auto first = static_cast<std::uint64_t>(soup_.points.size());
    for (const pugi::xml_node& v : mesh.child("vertices").children("vertex")) {
      const Eigen::Vector3d p(real(v.attribute("x"), object), real(v.attribute("y"), object),
                              real(v.attribute("z"), object));
      soup_.points.push_back(factor_ * (transform.leftCols<3>() * p + transform.col(3)));
    }
    const std::uint64_t count = soup_.points.size() - first;
    const bool mirrored = transform.leftCols<3>().determinant() < 0;
    for (const pugi::xml_node& t : mesh.child("triangles").children("triangle")) {
      std::int64_t v[3];
      const char* names[] = {"v1", "v2", "v3"};
      for (int k = 0; k < 3; k++) {
        const char* word = t.attribute(names[k]).value();
        if (!parse_whole(word, v[k]) || v[k] < 0 || static_cast<std::uint64_t>(v[k]) >= count)
          refuse("a triangle of " + object + " names vertex " + printable(word) + ", but there are " +
                 std::to_string(count) + " from 0 on: export it again");
      }
      if (mirrored) std::swap(v[1], v[2]);
      for (const std::int64_t k : v)
        soup_.corners.push_back(static_cast<std::uint32_t>(first + static_cast<std::uint64_t>(k)));
      soup_.close_face();
    }
    check_counts(soup_.points.size(), soup_.ends.size(), where_);
  }

  Zip zip_;
  const std::string& where_;
  std::map<std::string, pugi::xml_document> parts_;
  std::map<std::pair<std::string, std::string>, pugi::xml_node> objects_;  // by part and id
  std::map<pugi::xml_node, Counts> counts_;
  std::map<std::string, int> left_out_;
  double factor_ = 1;
  Soup soup_;
};

}  // namespace

Soup read_3mf(const std::string& bytes, const std::string& where) {
  return ThreeMfReader(bytes, where).read();
}

}  // namespace padder::reading
