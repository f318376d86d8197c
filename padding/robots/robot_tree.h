// SPDX-License-Identifier: MIT
// A robot as its file describes it: the links with their shapes, and the tree that the joints form.
#pragma once
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "padding/asset/mesh.h"
#include "padding/export/model.h"

namespace padder {

// One of the shapes of a link.
struct RobotShape {
  // URDF's kinds, and MJCF's ellipsoid.
  enum class Type { mesh, box, cylinder, capsule, sphere, ellipsoid };
  Type type = Type::mesh;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();  // in the link's frame
  std::filesystem::path file;                              // of a mesh; exists on this machine
  Vector scale = Vector::Ones();                           // of a mesh
  // Sides of a box; radius, radius, length of a cylinder; the same of a capsule, whose length is that between
  // the centres of its round ends; three times the radius of a sphere; half axes of an ellipsoid.
  Vector size = Vector::Zero();
};

// A link and its shapes. Its mass is in the model, if its moments are stated, too.
struct RobotLink {
  std::string name;
  std::vector<RobotShape> shapes;  // to be padded
  double mass = 0;                 // if above 0: the mass, whose moments follow from the shapes
  double density = 0;              // if above 0: in kg/m^3, from which the mass follows, if none is stated
};

// The bodies have no spheres yet. Parents come first, and links[k] belongs to model.bodies[k].
struct RobotTree {
  Model model;
  std::vector<RobotLink> links;
  std::vector<std::filesystem::path> included;  // what its text is put together from, besides its own file
  std::vector<std::string> notes;               // what was not taken as it was written, one clause each
  bool root_is_world = false;  // MuJoCo's: what joints hold to it, and to what is fixed to it, may touch it
};

// Where a robot's meshes are, and which of its shapes count.
struct RobotReadOptions {
  std::vector<std::filesystem::path> package_folders;  // are searched for packages first
  std::vector<std::string> xacro;                      // NAME:=VALUE each, handed to the program xacro
  bool visual = false;  // take the shapes of `visual` even where there are some of `collision`
};

// The first few names, for a sentence.
std::string first_few(const std::vector<std::string>& names);

// Notes that `links` have shapes only of the kind that is not padded, if there are any; `visual`: that of
// `visual` is.
void note_bare(RobotTree& robot, const std::vector<std::string>& links, bool visual);

// The pairs of links that may not touch, i < j. Links that fixed joints connect form a rigid group; links of
// one group may not touch. Neither may links of a group and of the nearest group above it in the tree that
// has shapes. A floating joint holds nothing together, so nothing is above a group that hangs on one, as a
// box on a table. The other joints keep their links at one point, on one line or in one plane, where they
// touch by construction. Where the root is MuJoCo's world, its group is above no other.
std::vector<std::pair<std::size_t, std::size_t>> neighbours(const RobotTree& robot);

// Lists these pairs in model.apart, and turns them into families and masks of the bodies: the links of a
// rigid group get one family, and neighbouring groups mask each other. Links without shapes get none, nor
// does the only link that has some. When 32 families are not enough (families_of, padding/export/families.h),
// no link gets one, and only the list says what may not touch.
void keep_neighbours_apart(RobotTree& robot);

}  // namespace padder
