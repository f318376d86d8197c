// SPDX-License-Identifier: MIT
// A robot's URDF: links with their collision geometry, joints, the tree they make.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "padding/asset/mesh.h"
#include "padding/export/model.h"

namespace padder {

// One geometry of a link.
struct UrdfShape {
  // URDF's kinds.
  enum class Type { mesh, box, cylinder, sphere };
  Type type = Type::mesh;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();  // in the link's frame
  std::filesystem::path file;                              // of a mesh, found on this machine
  Vector scale = Vector::Ones();                           // of a mesh
  Vector size = Vector::Zero();  // box: its sides; cylinder: radius, radius, length; sphere: radius thrice
};

// A link, its shapes and its mass.
struct UrdfLink {
  std::string name;
  std::vector<UrdfShape> shapes;  // to be padded
};

// Bodies without spheres, parents first; links[k] belongs to model.bodies[k].
struct Urdf {
  Model model;
  std::vector<UrdfLink> links;
  std::vector<std::string> notes;  // what was not taken as it stands, one clause each
};

// Metres and radians, as URDF has them. Shapes are those of `collision`; when no link has any, those of
// `visual`, and a note says so. References to meshes:
//   package://PKG/rest  the folder PKG is looked for in the folders above the URDF, then in ROS_PACKAGE_PATH
//   file:///rest        as it stands
//   rest                beside the URDF
// Only meshes that will be padded must exist. Throws Error that names link or joint: no robot, no link, a
// name twice, a joint to a link that is not there, no tree, a mesh not found (with the places looked at),
// numbers that are none.
Urdf read_urdf(const std::filesystem::path& path);

// Pairs of links that may not touch, i < j: rigidly connected ones (fixed joints), and neighbours: each rigid
// group with the nearest one above it in the tree that has shapes.
std::vector<std::pair<std::size_t, std::size_t>> neighbours(const Urdf& urdf);

// The pairs as families and masks of the bodies: links fixed to each other are of one family, neighbours mask
// each other; links without shapes get none. Throws Error when 32 families do not suffice (families_of,
// padding/export/families.h).
void set_families(Urdf& urdf);

}  // namespace padder
