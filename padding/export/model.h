// SPDX-License-Identifier: MIT
// What one foreign file can hold: bodies made of spheres, the joints between them, who may touch whom.
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "padding/asset/cluster.h"

namespace padder {

// As a file states it, for a body whose mass is known better than from a density. In the body's frame.
struct Inertial {
  double mass = 0;
  Point center = Point::Zero();
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();  // about the centre, along the body's axes
};

// What joins a body to its parent, as URDF has it.
struct Joint {
  // URDF's kinds.
  enum class Type { fixed, revolute, continuous, prismatic, planar, floating };
  std::string name;
  Type type = Type::fixed;
  Vector axis = Vector::UnitX();  // unit, in the body's frame
  double lower = 0, upper = 0;    // of revolute (radians) and prismatic (length)
};

// A body or link, with its spheres.
struct Body {
  std::string name;
  Cluster cluster;  // in the body's frame; no spheres: a body without collision geometry
  int parent = -1;  // index of a body before this one; -1: the world
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();  // in the parent's frame, joint at 0
  Joint joint;                                             // to the parent
  std::optional<Inertial> inertial;                        // none: of the cluster's true body and a density
};

// Lengths in one unit for all bodies.
struct Model {
  std::string name;
  std::string unit;  // "m", "cm", "mm", "in", or "" when nobody said
  std::vector<Body> bodies;
  std::string
      urdf;  // the document a robot was read from, "" otherwise: written back as URDF with new collisions

  std::size_t spheres() const;
};

// One body that is the cluster; its family and mask go along.
Model model_of(Cluster cluster);

// Metres in a unit; 1 for "". Throws Error for a word that is none of them.
double metres(const std::string& unit);

// Every length multiplied (mass properties with their powers), unit renamed. A body's `inertial` keeps its
// mass.
Model scaled(Model model, double factor, const std::string& unit);

// With mass density * volume; none for a body without volume (a sheet) and without a stated one.
std::optional<Inertial> inertial_of(const Body& body, double density);

}  // namespace padder
