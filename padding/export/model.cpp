// SPDX-License-Identifier: MIT
#include "padding/export/model.h"

#include <algorithm>

namespace padder {

Eigen::Isometry3d Joint::motion(double value) const {
  Eigen::Isometry3d out = Eigen::Isometry3d::Identity();
  if (turns()) out.linear() = Eigen::AngleAxisd(value, axis).toRotationMatrix();
  if (type == Type::prismatic) out.translation() = value * axis;
  return out;
}

std::size_t Model::spheres() const {
  std::size_t n = 0;
  for (const Body& b : bodies) n += b.cluster.size();
  return n;
}

Model model_of(Cluster cluster) {
  Model model;
  model.name = cluster.name, model.unit = cluster.unit;
  model.bodies.emplace_back();
  model.bodies[0].name = cluster.name;
  model.bodies[0].cluster = std::move(cluster);
  return model;
}

Leader leader_of(const Model& model, std::size_t body) {
  Leader out{body};
  const Joint* joint = &model.bodies[body].joint;
  for (std::size_t turns = 0; !joint->mimic.empty() && turns < model.bodies.size(); turns++) {
    const auto leader = std::find_if(model.bodies.begin(), model.bodies.end(),
                                     [&](const Body& b) { return b.joint.name == joint->mimic; });
    if (leader == model.bodies.end()) break;
    out.offset += out.scale * joint->offset, out.scale *= joint->multiplier;
    joint = &leader->joint, out.body = static_cast<std::size_t>(leader - model.bodies.begin());
  }
  return out;
}

std::vector<double> first_values(const Model& model) {
  std::vector<double> out;
  for (const Body& b : model.bodies) out.push_back(b.joint.first_value());
  return out;
}

std::vector<Eigen::Isometry3d> poses_at(const Model& model, const std::vector<double>& values) {
  const auto value_of = [&](std::size_t body) {
    const Leader leader = leader_of(model, body);
    return leader.offset + (values.empty() ? 0 : leader.scale * values[leader.body]);
  };
  std::vector<Eigen::Isometry3d> out;
  for (std::size_t b = 0; b < model.bodies.size(); b++) {
    const Body& body = model.bodies[b];
    const Eigen::Isometry3d pose = body.pose * body.joint.motion(value_of(b));
    out.push_back(body.parent < 0 ? pose : out[static_cast<std::size_t>(body.parent)] * pose);
  }
  return out;
}

Model scaled(Model model, double factor, const std::string& unit) {
  model.unit = unit;
  for (Body& b : model.bodies) {
    b.cluster.unit = unit;
    b.pose.translation() *= factor;
    if (b.joint.type == Joint::Type::prismatic)
      b.joint.lower *= factor, b.joint.upper *= factor, b.joint.reference *= factor, b.joint.offset *= factor;
    if (b.inertial) b.inertial->center *= factor, b.inertial->inertia *= factor * factor;
    if (factor != 1) b.cluster.scale(factor);
  }
  return model;
}

std::optional<Inertial> inertial_of(const Body& body, double density) {
  if (body.inertial) return body.inertial;
  const MassProperties& m = body.cluster.mass;
  if (!(m.volume > 0)) return {};
  return Inertial{density * m.volume, m.center, density * m.inertia};
}

}  // namespace padder
