// SPDX-License-Identifier: MIT
// Writes MuJoCo's MJCF: bodies nested by their joints, and one geom for each sphere.
#include <Eigen/Eigenvalues>
#include <map>
#include <set>

#include "padding/export/writers.h"

namespace padder::exporting {
namespace {

// MuJoCo reads a signed 32-bit number: bit 31 is written as a negative one.
std::string bit_field(std::uint32_t bits) { return std::to_string(static_cast<std::int32_t>(bits)); }

std::string place(const Eigen::Isometry3d& pose) {
  std::string out;
  if (!pose.translation().isZero(0)) out += " pos=\"" + numbers(pose.translation()) + "\"";
  if (!pose.linear().isIdentity(0)) {
    const Eigen::Quaterniond q(pose.linear());
    out += " quat=\"" + number(q.w()) + " " + numbers(q.vec()) + "\"";
  }
  return out;
}

class MjcfWriter {
 public:
  explicit MjcfWriter(const Job& job) : job_(job), children_(job.model.bodies.size()) {
    // The families of a robot's links are about these links only. Bodies outside the robot touch all of them.
    for (const CollisionFilter& f : filters_of(job.model))
      bits_.push_back(mujoco_bits(job.model.robot() ? CollisionFilter{} : f));
    for (std::size_t b = 0; b < job.model.bodies.size(); b++)
      if (const int parent = job.model.bodies[b].parent; parent >= 0)
        children_[static_cast<std::size_t>(parent)].push_back(b);
    for (std::size_t b = 0; b < job.model.bodies.size(); b++) {
      const Body& body = job.model.bodies[b];
      bodies_.insert(body.name);
      joints_[body.joint.name] = &body.joint;
      const Leader leader = leader_of(job.model, b);
      references_.push_back(leader.offset + leader.scale * job.model.bodies[leader.body].joint.first_value());
    }
  }

  std::string document() {
    std::string bodies;
    for (std::size_t b = 0; b < job_.model.bodies.size(); b++)
      if (job_.model.bodies[b].parent < 0) bodies += body(b, "    ");
    std::string compiler =
        "angle=\"radian\" inertiafromgeom=\"false\"";  // summing the spheres would count overlaps twice
    if (unbalanced_) compiler += " balanceinertia=\"true\"";
    if (weightless_) compiler += " boundmass=\"1e-6\" boundinertia=\"1e-9\"";
    return "<!-- " + comment(origin(job_.model)) + ", metres, density " + number(job_.options.density) +
           " where no mass was stated -->\n" +
           (weightless_ ? "<!-- boundmass and boundinertia: MuJoCo wants some mass and moments on every "
                          "moving body, and one has none -->\n"
                        : "") +
           (unbalanced_
                ? "<!-- balanceinertia: MuJoCo wants moments that a body can have, and those stated of one "
                  "link are none -->\n"
                : "") +
           "<mujoco model=\"" + xml_text(one_line(job_.model.name)) + "\">\n  <compiler " + compiler +
           "/>\n  <default>\n    <geom type=\"sphere\"/>\n  </default>\n  <worldbody>\n" + bodies +
           "  </worldbody>\n" + excluded() + followers() + motors() + "</mujoco>\n";
  }

 private:
  static std::string comment(std::string text) {  // "--" must not occur in one
    for (std::size_t k; (k = text.find("--")) != std::string::npos;) text[k] = ' ';
    return text;
  }

  std::string joint(std::size_t index, const std::string& indent) {
    const Body& b = job_.model.bodies[index];
    const auto hinge_or_slide = [&](const char* type, const Vector& axis, const std::string& suffix,
                                    bool limited) {
      const double reference = suffix.empty() ? references_[index] : 0;
      return indent + "<joint name=\"" + xml_text(joint_name(b.joint, suffix)) + "\" type=\"" + type +
             "\" axis=\"" + numbers(axis) + "\"" +
             (limited
                  ? " limited=\"true\" range=\"" + number(b.joint.lower) + " " + number(b.joint.upper) + "\""
                  : "") +
             (reference != 0 ? " ref=\"" + number(reference) + "\"" : "") +
             (b.joint.damping > 0 ? " damping=\"" + number(b.joint.damping) + "\"" : "") +
             (b.joint.friction > 0 ? " frictionloss=\"" + number(b.joint.friction) + "\"" : "") + "/>\n";
    };
    const Vector x = b.joint.axis.unitOrthogonal(), y = b.joint.axis.cross(x);
    if (b.joint.moves_one_way())
      return hinge_or_slide(b.joint.turns() ? "hinge" : "slide", b.joint.axis, "",
                            b.joint.lower < b.joint.upper && b.joint.limited());
    switch (b.joint.type) {
      case Joint::Type::planar:
        return hinge_or_slide("slide", x, "_x", false) + hinge_or_slide("slide", y, "_y", false) +
               hinge_or_slide("hinge", b.joint.axis, "_turn", false);
      case Joint::Type::floating: {  // a free joint may only stand in the world
        if (is_world(job_.model, b.parent))
          return indent + "<freejoint name=\"" + xml_text(b.joint.name) + "\"/>\n";
        std::string out;
        for (int k = 0; k < 3; k++)
          out += hinge_or_slide("slide", Vector::Unit(k), std::string("_") + "xyz"[k], false);
        return out + indent + "<joint name=\"" + xml_text(joint_name(b.joint, "_turn")) +
               "\" type=\"ball\"/>\n";
      }
      case Joint::Type::ball:
        return indent + "<joint name=\"" + xml_text(b.joint.name) + "\" type=\"ball\"" +
               (std::isfinite(b.joint.upper) ? " limited=\"true\" range=\"0 " + number(b.joint.upper) + "\""
                                             : "") +
               (b.joint.damping > 0 ? " damping=\"" + number(b.joint.damping) + "\"" : "") +
               (b.joint.friction > 0 ? " frictionloss=\"" + number(b.joint.friction) + "\"" : "") + "/>\n";
      default:
        return "";
    }
  }

  bool weighs(std::size_t b) const {  // with what is fixed to it
    const auto own = inertial_of(job_.model.bodies[b], job_.options.density);
    if (own && own->mass > 0) return true;
    for (const std::size_t child : children_[b])
      if (job_.model.bodies[child].joint.type == Joint::Type::fixed && weighs(child)) return true;
    return false;
  }

  // Of one of the joints that stand for one that moves in several ways. No other joint has it.
  std::string joint_name(const Joint& joint, const std::string& suffix) const {
    std::string name = joint.name + suffix;
    while (!suffix.empty() && joints_.contains(name)) name += '_';
    return name;
  }

  std::string body_name(std::size_t index) const {
    std::string name = job_.model.bodies[index].name;
    if (name != "world" || is_world(job_.model, static_cast<int>(index))) return name;
    do name += '_';
    while (bodies_.contains(name));
    return name;
  }

  std::string body(std::size_t index, const std::string& indent) {
    const Body& b = job_.model.bodies[index];
    const std::string inside = indent + "  ";
    if (is_world(job_.model, static_cast<int>(index))) return content(index, indent);
    std::string out = indent + "<body name=\"" + xml_text(body_name(index)) + "\"" +
                      place(b.pose * b.joint.motion(references_[index])) + ">\n";
    const auto inertial = inertial_of(b, job_.options.density);
    // An asset on its own is a free body; a robot's root stays where it is.
    const bool alone = !job_.model.robot() && b.parent < 0;
    if (alone && inertial && b.joint.type == Joint::Type::fixed)
      out += inside + "<freejoint/>\n";
    else if (b.joint.type != Joint::Type::fixed) {
      out += joint(index, inside);
      weightless_ |= !weighs(index);
    }
    if (inertial && inertial->mass > 0) out += inertia_of(*inertial, inside);
    return out + content(index, inside) + indent + "</body>\n";
  }

  std::string inertia_of(const Inertial& i, const std::string& indent) {
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal(i.inertia);
    const Vector moments = principal.eigenvalues().cwiseMax(0.0);  // in ascending order
    unbalanced_ |= moments[0] + moments[1] < moments[2];
    std::string out = indent + "<inertial pos=\"" + numbers(i.center) + "\" mass=\"" + number(i.mass) + "\" ";
    constexpr double least = 1e-13;  // of a fullinertia; MuJoCo's own limit is a tenth of it
    if (moments[0] > least) {
      const Eigen::Matrix3d& m = i.inertia;
      return out + "fullinertia=\"" + numbers(m.diagonal()) + " " + number(m(0, 1)) + " " + number(m(0, 2)) +
             " " + number(m(1, 2)) + "\"/>\n";
    }
    weightless_ = true;
    Eigen::Matrix3d axes = principal.eigenvectors();
    if (axes.determinant() < 0) axes.col(0) *= -1;
    const Eigen::Quaterniond q(axes);
    return out + "quat=\"" + number(q.w()) + " " + numbers(q.vec()) + "\" diaginertia=\"" + numbers(moments) +
           "\"/>\n";
  }

  // The geoms of a body, and the bodies on it.
  std::string content(std::size_t index, const std::string& inside) {
    std::string out;
    const Cluster& c = job_.model.bodies[index].cluster;
    const FilterBits bits = bits_[index];
    for (std::size_t k = 0; k < c.size(); k++)
      out += inside + "<geom type=\"sphere\" size=\"" + number(c.radii[k]) + "\" pos=\"" +
             numbers(c.centers[k]) + "\" contype=\"" + bit_field(bits.own) + "\" conaffinity=\"" +
             bit_field(bits.others) + "\"/>\n";
    for (const std::size_t child : children_[index]) out += body(child, inside);
    return out;
  }

  // Pairs that may not touch although their bits say that they may.
  std::string excluded() const {
    std::string out;
    for (const auto& [i, j] : job_.pairs) {
      const Body &a = job_.model.bodies[i], &b = job_.model.bodies[j];
      const bool pass = (bits_[i].own & bits_[j].others) || (bits_[j].own & bits_[i].others);
      if (pass && a.cluster.size() > 0 && b.cluster.size() > 0)
        out += "    <exclude body1=\"" + xml_text(body_name(i)) + "\" body2=\"" + xml_text(body_name(j)) +
               "\"/>\n";
    }
    return out.empty() ? "" : "  <contact>\n" + out + "  </contact>\n";
  }

  // Joints that follow another one: URDF's <mimic> is a polynomial of degree 1, and MuJoCo counts from the
  // references, which follow each other, too. What follows a joint that has no single place, as a fixed one,
  // stays where that one is at 0.
  std::string followers() const {
    std::string out;
    for (const Body& b : job_.model.bodies)
      if (!b.joint.mimic.empty() && b.joint.moves_one_way())
        out += "    <joint joint1=\"" + xml_text(b.joint.name) + "\"" +
               (leads(b.joint.mimic) ? " joint2=\"" + xml_text(b.joint.mimic) + "\"" : "") +
               " polycoef=\"0 " + number(b.joint.multiplier) + " 0 0 0\"/>\n";
    return out.empty() ? "" : "  <equality>\n" + out + "  </equality>\n";
  }

  // One for each joint that states its effort. A motor without a control does nothing.
  std::string motors() const {
    std::string out;
    for (const Body& b : job_.model.bodies)
      if (b.joint.effort > 0 && b.joint.mimic.empty() && b.joint.moves_one_way())
        out += "    <motor name=\"" + xml_text(b.joint.name) + "\" joint=\"" + xml_text(b.joint.name) +
               "\" ctrllimited=\"true\" ctrlrange=\"" + number(-b.joint.effort) + " " +
               number(b.joint.effort) + "\"/>\n";
    return out.empty() ? "" : "  <actuator>\n" + out + "  </actuator>\n";
  }

  bool leads(const std::string& joint) const {
    const auto found = joints_.find(joint);
    return found != joints_.end() && found->second->moves_one_way();
  }

  Job job_;
  std::vector<FilterBits> bits_;
  std::set<std::string> bodies_;
  std::map<std::string, const Joint*> joints_;
  std::vector<double> references_;  // of each joint; the bodies are written where they stand at these
  std::vector<std::vector<std::size_t>> children_;
  bool weightless_ = false, unbalanced_ = false;
};

// Joints that are locked, or follow one that is, fixed where they stand: MuJoCo refuses equal limits.
Model fixed_where_locked(const Model& model) {
  Model out = model;
  for (std::size_t b = 0; b < out.bodies.size(); b++) {
    const Leader leader = leader_of(model, b);
    const Joint& decides = model.bodies[leader.body].joint;
    if (!out.bodies[b].joint.moves_one_way() || !decides.locked()) continue;
    out.bodies[b].pose =
        out.bodies[b].pose * out.bodies[b].joint.motion(leader.offset + leader.scale * decides.lower);
    out.bodies[b].joint.type = Joint::Type::fixed, out.bodies[b].joint.mimic.clear();
  }
  return out;
}

}  // namespace

Files write_mujoco(const Job& job) {
  const Model model = fixed_where_locked(job.model);
  return {{"", MjcfWriter({model, job.options, job.pairs}).document()}};
}

}  // namespace padder::exporting
