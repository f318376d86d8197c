// SPDX-License-Identifier: MIT
// What a file of another program can hold: bodies made of spheres, and the joints between them.
#pragma once
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "padding/asset/cluster.h"

namespace padder {

// Mass and inertia as a robot's file states them, in the body's frame. They replace what follows from a
// density.
struct Inertial {
  double mass = 0;
  Point center = Point::Zero();
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();  // about the centre, along the body's axes
};

// What joins a body to its parent, as URDF has it.
struct Joint {
  // URDF's kinds, and `ball`, which turns every way: MJCF's ball, and what Bullet's URDF calls spherical.
  enum class Type { fixed, revolute, continuous, prismatic, planar, floating, ball };
  std::string name;
  Type type = Type::fixed;
  Vector axis = Vector::UnitX();  // unit, in the body's frame
  // Of revolute (radians) and prismatic (length); infinite: no limits. Equal ones lock the joint. Of a ball,
  // `upper` is how far it turns at most.
  double lower = -std::numeric_limits<double>::infinity(), upper = std::numeric_limits<double>::infinity();
  double reference = 0;  // where it stands at first: MJCF's ref
  double effort = 0;     // the most a motor may give, N m or N; 0: not stated
  double damping = 0, friction = 0;
  std::string mimic;  // the joint that this one follows: its place is multiplier * theirs + offset
  double multiplier = 1, offset = 0;

  bool turns() const { return type == Type::revolute || type == Type::continuous; }
  bool moves_one_way() const { return turns() || type == Type::prismatic; }  // one number places it
  bool may_have_limits() const { return moves_one_way() && type != Type::continuous; }
  bool limited() const { return may_have_limits() && std::isfinite(lower) && std::isfinite(upper); }
  bool locked() const { return limited() && lower == upper; }
  Eigen::Isometry3d motion(double value) const;  // from its place at 0; none where no single number places it
  // The reference or, where that is beyond the limits, their middle, as MoveIt has it.
  double first_value() const {
    const bool within = !limited() || (lower <= reference && reference <= upper);
    return within ? reference : 0.5 * (lower + upper);
  }
};

// A body or link, with its spheres.
struct Body {
  std::string name;
  Cluster cluster;  // in the body's frame; no spheres: a body without collision geometry
  int parent = -1;  // index of a body before this one; -1: the world
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();  // in the parent's frame, joint at 0
  Joint joint;                                             // to the parent
  std::optional<Inertial> inertial;                        // none: from the cluster's volume and a density
};

// Two bodies that may not touch, by their indices, and why: a word of MoveIt's for SRDF, as "Adjacent".
struct Apart {
  std::size_t a = 0, b = 0;
  std::string reason = "Adjacent";
};

// Lengths in one unit for all bodies.
struct Model {
  std::string name;
  std::string unit;  // "m", "cm", "mm", "in", or "" when nobody said
  std::vector<Body> bodies;
  std::vector<Apart> apart;  // besides the pairs that families and masks keep apart
  std::string file;          // that a robot was read from, without folders; "" otherwise
  // The document a robot was read from, "" otherwise: written back as URDF with new collisions.
  std::string urdf;

  bool robot() const { return !file.empty() || !urdf.empty(); }  // was read from a robot's file
  std::size_t spheres() const;
};

// A model of one body. It keeps the cluster's family and mask.
Model model_of(Cluster cluster);

// Where each body is in the world, when each joint is at its value: a radian or a length. `values` has one
// for each body, of the joint to its parent; those of joints that mimic others and of joints with more than
// one way to move are not looked at. Empty: all at 0.
std::vector<Eigen::Isometry3d> poses_at(const Model& model, const std::vector<double>& values = {});

// The joint that decides where the joint of `body` stands: itself or, if it mimics, the one at the end of the
// chain. Its value is `scale` times that one's, plus `offset`.
struct Leader {
  std::size_t body = 0;
  double scale = 1, offset = 0;
};
Leader leader_of(const Model& model, std::size_t body);

// The first value of each joint, for poses_at.
std::vector<double> first_values(const Model& model);

// What .npz and .vtp call the array of one number that says the unit of lengths.
inline constexpr const char* kUnitInMetres = "unit_in_metres";

// The model with every length multiplied by `factor`, and the unit renamed. Volume and moments change with
// their powers of the factor; the mass of `inertial` stays.
Model scaled(Model model, double factor, const std::string& unit);

// The stated one, else with the mass density * volume. None for a body that has neither: an open sheet.
std::optional<Inertial> inertial_of(const Body& body, double density);

}  // namespace padder
