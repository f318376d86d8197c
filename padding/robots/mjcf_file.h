// SPDX-License-Identifier: MIT
// The text of an MJCF: included files put in their places, defaults looked up, numbers and orientations read.
// Not installed.
#pragma once
#include <filesystem>
#include <map>
#include <pugixml.hpp>
#include <string>
#include <vector>

#include "padding/asset/mesh.h"

namespace padder::reading {

// An element with the defaults that hold for it, the nearest first.
struct MjcfElement {
  std::vector<pugi::xml_node> levels;

  pugi::xml_attribute attribute(const char* name) const;  // of the first level that has it; empty if none has
  std::string text(const char* name, const char* otherwise = "") const {
    return attribute(name).as_string(otherwise);
  }
};

class MjcfFile {
 public:
  // Throws Error for a file that is not there, not XML, or not <mujoco>, and for an <include> that cannot be
  // followed.
  explicit MjcfFile(const std::filesystem::path& path);

  const std::vector<std::filesystem::path>& included() const { return included_; }
  pugi::xml_node root() const { return document_.child("mujoco"); }
  // The value of the compiler's attribute, the last one if it stands several times.
  std::string compiler(const char* name, const char* otherwise) const;
  // `childclass` is that of the bodies around it; "" for none.
  MjcfElement with_defaults(pugi::xml_node node, const std::string& childclass) const;

  // Between `least` and `most` numbers. An absent attribute gives `otherwise`. An attribute with fewer
  // numbers than a class further out replaces the first of them, as in MuJoCo.
  std::vector<double> numbers(const MjcfElement& e, const char* name, std::size_t least, std::size_t most,
                              std::vector<double> otherwise = {}) const;
  double number(const MjcfElement& e, const char* name, double otherwise) const;
  Vector vector(const MjcfElement& e, const char* name, const Vector& otherwise) const;
  double angle() const { return angle_; }  // radians in the file's unit of angles
  Eigen::Quaterniond orientation(const MjcfElement& e) const;
  // `pos` and the orientation.
  Eigen::Isometry3d pose(const MjcfElement& e) const;

  [[noreturn]] void fail(const pugi::xml_node& node, const std::string& what) const;

 private:
  void follow_includes(pugi::xml_node node, std::vector<std::string>& seen);
  void add_defaults(pugi::xml_node node, const std::string& above);

  std::filesystem::path path_;
  std::vector<std::filesystem::path> included_;
  pugi::xml_document document_;
  std::map<std::string, std::vector<pugi::xml_node>>
      classes_;  // each with the classes around it, itself first
  double angle_ = 1;
  std::string sequence_;
};

}  // namespace padder::reading
