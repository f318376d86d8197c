// SPDX-License-Identifier: MIT
// Writes USD as text, with USD's physics schema: one Xform for each body, which is a rigid body with its
// mass; in it one Sphere prim for each sphere, which is a collider; and one prim for each joint.
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <numbers>

#include "padding/export/writers.h"

namespace padder::exporting {
namespace {

std::string tuple(const Vector& v) { return "(" + numbers(v, ", ") + ")"; }

std::string tuple(const Eigen::Quaterniond& q) {
  return "(" + number(q.w()) + ", " + numbers(q.vec(), ", ") + ")";
}

// USD multiplies row vectors by matrices, so its matrices are the transposes of ours.
std::string matrix(const Eigen::Isometry3d& pose) {
  std::string out = "( ";
  for (int k = 0; k < 4; k++)
    out += (k ? ", (" : "(") + numbers(pose.matrix().col(k).head<3>(), ", ") + (k < 3 ? ", 0)" : ", 1)");
  return out + " )";
}

class UsdWriter {
 public:
  explicit UsdWriter(const Job& job)
      : job_(job), names_(identifiers(job.model)), root_("/" + identifier(job.model.name)) {}

  std::string document() const {
    const Model& model = job_.model;
    const bool several = model.bodies.size() > 1;
    std::string out = "#usda 1.0\n(\n    defaultPrim = \"" + root_.substr(1) +
                      "\"\n    doc = " + quoted(origin(model)) +
                      "\n    kilogramsPerUnit = 1\n    metersPerUnit = " + number(metres(model.unit)) +
                      "\n    upAxis = \"" + (is_of_gltf(model) ? "Y" : "Z") + "\"\n)\n\n";
    if (several) {
      const bool robot = std::ranges::any_of(model.bodies, [](const Body& b) { return b.parent >= 0; });
      out += "def Xform \"" + root_.substr(1) + "\"" +
             (robot ? " (\n    prepend apiSchemas = [\"PhysicsArticulationRootAPI\"]\n)" : "") + "\n{\n";
    }
    const auto poses = poses_at(model);
    for (std::size_t b = 0; b < model.bodies.size(); b++)
      out += body(b, several ? names_[b] : root_.substr(1), poses[b]);
    return out + (several ? "}\n" : "");
  }

 private:
  std::string path(std::size_t body) const { return "<" + root_ + "/" + names_[body] + ">"; }

  std::string body(std::size_t b, const std::string& name, const Eigen::Isometry3d& pose) const {
    const Body& body = job_.model.bodies[b];
    const double metre = metres(job_.model.unit);  // the density is per cubic metre
    const auto inertial = inertial_of(body, job_.options.density * metre * metre * metre);
    const bool stands = is_world(job_.model, static_cast<int>(b));  // its colliders move nowhere
    const bool weighs = !stands && inertial && inertial->mass > 0;
    std::string filtered;
    for (const auto& [i, j] : job_.pairs)
      if (i == b && job_.model.bodies[j].cluster.size() > 0 && body.cluster.size() > 0)
        filtered += (filtered.empty() ? "" : ", ") + path(j);
    std::string schemas;
    const auto add = [&](const char* schema) {
      schemas += std::string(schemas.empty() ? "\"" : ", \"") + schema + "\"";
    };
    if (!stands) add("PhysicsRigidBodyAPI");
    if (weighs) add("PhysicsMassAPI");
    if (!filtered.empty()) add("PhysicsFilteredPairsAPI");
    std::string out = "def Xform \"" + name + "\"";
    if (!schemas.empty()) out += " (\n    prepend apiSchemas = [" + schemas + "]\n)";
    out += "\n{\n";
    if (weighs) out += mass(*inertial);
    if (!filtered.empty()) out += "    rel physics:filteredPairs = [" + filtered + "]\n";
    if (!pose.matrix().isIdentity(0))
      out += "    matrix4d xformOp:transform = " + matrix(pose) +
             "\n    uniform token[] xformOpOrder = [\"xformOp:transform\"]\n";
    const Cluster& c = body.cluster;
    for (std::size_t k = 0; k < c.size(); k++)
      out += "    def Sphere \"sphere_" + std::to_string(k) +
             "\" (\n        prepend apiSchemas = [\"PhysicsCollisionAPI\"]\n    )\n    {\n" +
             "        double radius = " + number(c.radii[k]) +
             "\n        double3 xformOp:translate = " + tuple(c.centers[k]) +
             "\n        uniform token[] xformOpOrder = [\"xformOp:translate\"]\n    }\n";
    return out + joint(b) + "}\n";
  }

  static std::string mass(const Inertial& i) {
    std::string out = "    float physics:mass = " + number(i.mass) +
                      "\n    point3f physics:centerOfMass = " + tuple(i.center) + "\n";
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal(i.inertia);
    Eigen::Matrix3d axes = principal.eigenvectors();
    if (axes.determinant() < 0) axes.col(0) *= -1;
    if (principal.eigenvalues().minCoeff() > 0)  // a body of 0 moments leaves them to the reader
      out += "    float3 physics:diagonalInertia = " + tuple(Vector(principal.eigenvalues())) +
             "\n    quatf physics:principalAxes = " + tuple(Eigen::Quaterniond(axes)) + "\n";
    return out;
  }

  // The joint that holds the body to its parent. Its x axis is the axis of the joint.
  std::string joint(std::size_t b) const {
    const Body& body = job_.model.bodies[b];
    const Joint& j = body.joint;
    if (body.parent < 0 || j.type == Joint::Type::floating) return "";
    const Eigen::Quaterniond along = Eigen::Quaterniond::FromTwoVectors(Vector::UnitX(), j.axis);
    const char* type = j.turns()                          ? "PhysicsRevoluteJoint"
                       : j.type == Joint::Type::prismatic ? "PhysicsPrismaticJoint"
                       : j.type == Joint::Type::fixed     ? "PhysicsFixedJoint"
                       : j.type == Joint::Type::ball      ? "PhysicsSphericalJoint"
                                                          : "PhysicsJoint";
    std::string out = std::string("def ") + type + " \"joint\"";
    if (j.type ==
        Joint::Type::planar)  // a limit whose low end is above its high end locks that way of moving
      out +=
          " (\n    prepend apiSchemas = [\"PhysicsLimitAPI:transX\", \"PhysicsLimitAPI:rotY\", "
          "\"PhysicsLimitAPI:rotZ\"]\n)";
    out += "\n{\n";
    if (!is_world(job_.model, body.parent))  // without a body0 the joint holds it to the world
      out += "    rel physics:body0 = " + path(static_cast<std::size_t>(body.parent)) + "\n";
    out += "    rel physics:body1 = " + path(b) +
           "\n    point3f physics:localPos0 = " + tuple(Vector(body.pose.translation())) +
           "\n    quatf physics:localRot0 = " + tuple(Eigen::Quaterniond(body.pose.linear()) * along) +
           "\n    point3f physics:localPos1 = (0, 0, 0)\n    quatf physics:localRot1 = " + tuple(along) +
           "\n";
    if (j.moves_one_way() || j.type == Joint::Type::ball) out += "    uniform token physics:axis = \"X\"\n";
    const double unit = j.turns() ? 180 / std::numbers::pi : 1;  // USD counts angles in degrees
    if (j.limited())
      out += "    float physics:lowerLimit = " + number(unit * j.lower) +
             "\n    float physics:upperLimit = " + number(unit * j.upper) + "\n";
    if (j.type == Joint::Type::planar)
      for (const char* way : {"transX", "rotY", "rotZ"})
        out += std::string("    float limit:") + way + ":physics:low = 1\n    float limit:" + way +
               ":physics:high = -1\n";
    return out + "}\n";
  }

  const Job& job_;
  std::vector<std::string> names_;
  std::string root_;
};

}  // namespace

Files write_usda(const Job& job) { return {{"", UsdWriter(job).document()}}; }

}  // namespace padder::exporting
