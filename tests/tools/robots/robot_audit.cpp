// SPDX-License-Identifier: GPL-3.0-or-later
// robot_audit ROBOT REPORT SPHERES.urdf MODEL.xml [POSES [SEED]] [--visual] [--package-path DIR] [--xacro
// WORD]: compares a padded robot with its exact meshes in random poses, by FCL. REPORT is what `pad --json`
// printed.
//
// In each pose and for each pair of links that are not adjacent, FCL says whether the meshes touch, and the
// spheres read from SPHERES.urdf say whether they do. Where they differ, it counts as a fault only beyond
// what the errors of the two links allow:
//   * only the spheres touch: the meshes are farther apart than the two protrusions together;
//   * only the meshes touch: the spheres are farther apart than the two gaps together.
// A mesh with holes is no body. Where repair closed some, the surface compared is the mesh and the patches,
// which the errors are proved against; "patched" counts the pairs that the mesh without its patches would
// make a fault of. What lies inside a link is asked of its closed parts: an open sheet has no inside.
//
// MuJoCo, where it is there, reads MODEL.xml: no contact where the joints stand at first, and each geom
// stands in 100 of the poses where the sphere does.
//
// Prints one JSON object. Exit code 1: there was a fault, 2: the files cannot be compared.
#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/narrowphase/collision.h>
#include <fcl/narrowphase/distance.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <limits>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <random>
#include <set>

#include "padding/asset/error.h"
#include "padding/asset/file.h"
#include "padding/import/import.h"
#include "padding/meshing/repair.h"
#include "padding/robot.h"
#include "padding/robots/robot_file.h"
#include "tests/padding/shapes.h"
#ifdef PADDER_MUJOCO
#include "tests/padding/in_mujoco.h"
#endif

namespace padder {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using Poses = std::vector<Eigen::Isometry3d>;
using Bvh = fcl::BVHModel<fcl::OBBRSSd>;

// A surface, and what it encloses.
struct Shape {
  std::shared_ptr<Bvh> tree;
  std::vector<Point> pieces;  // of each connected piece of the surface, a corner
  Mesh closed;                // its winding number tells what is inside
  Box box;
};

// A link: its surface, its spheres, and the errors that its report states.
struct Part {
  Shape shape;                     // what the errors are proved against
  std::optional<Shape> unpatched;  // the mesh as it came, where that is another
  Cluster spheres;
  Point center = Point::Zero();  // of a ball around all of it
  double radius = 0;
  double protrusion = 0, gap = 0;
  const Shape& as_it_came() const { return unpatched ? *unpatched : shape; }
};

std::shared_ptr<Bvh> tree_of(const Mesh& mesh) {
  auto tree = std::make_shared<Bvh>();
  tree->beginModel(static_cast<int>(mesh.triangles.size()), static_cast<int>(mesh.points.size()));
  std::vector<fcl::Triangle> triangles;
  for (const auto& t : mesh.triangles) triangles.emplace_back(t[0], t[1], t[2]);
  tree->addSubModel(mesh.points, triangles);
  tree->endModel();
  return tree;
}

// A corner of each piece of triangles that share corners.
std::vector<Point> corners_of_pieces(const Mesh& mesh) {
  std::map<std::array<double, 3>, std::size_t> number;  // of each place: corners may be listed twice
  std::vector<std::size_t> parent;
  const auto root = [&](const Point& p) {
    std::size_t k = number.try_emplace({p.x(), p.y(), p.z()}, parent.size()).first->second;
    if (k == parent.size()) parent.push_back(k);
    while (parent[k] != k) k = parent[k] = parent[parent[k]];
    return k;
  };
  for (std::size_t t = 0; t < mesh.triangles.size(); t++)
    for (int c = 1; c < 3; c++) parent[root(mesh.corner(t, c))] = root(mesh.corner(t, 0));
  std::vector<Point> corners;
  for (const auto& [place, k] : number)
    if (parent[k] == k) corners.emplace_back(place[0], place[1], place[2]);
  return corners;
}

Shape shape_of(const Mesh& surface, Mesh closed) {
  return {tree_of(surface), corners_of_pieces(surface), std::move(closed), surface.bounds()};
}

// Asks repair only where it closed holes or found a sheet: everywhere else the mesh as it came is the body.
void set_shape(Part& part, const Mesh& mesh, const Json& told, const std::string& name) {
  const bool filled = told.at("accuracy").value("proved_against", "") == "filled";
  if (!filled && told.value("repair", "").find("sheet") == std::string::npos) {
    part.shape = shape_of(mesh, mesh);
    return;
  }
  const Repaired body = repair(mesh, {}, name);
  if (body.patches.empty() == filled) throw Error(name + ": repair closes other holes here than pad did");
  const Mesh closed = body.kind == BodyKind::sheet ? Mesh{}
                      : body.solid                 ? body.solid->mesh()
                                                   : body.boundary();
  Mesh patches{body.mesh.points, {}};
  for (const Patch& patch : body.patches)
    for (const std::uint32_t t : patch.triangles) patches.triangles.push_back(body.mesh.triangles[t]);
  part.shape = shape_of(shapes::joined(mesh, patches), closed);
  if (filled) part.unpatched = shape_of(mesh, closed);
}

// Where no two triangles meet, each piece of one lies wholly inside the other or wholly outside.
bool inside(const Shape& a, const Shape& b, const Eigen::Isometry3d& a_in_b) {
  return std::any_of(a.pieces.begin(), a.pieces.end(), [&](const Point& corner) {
    const Point p = a_in_b * corner;
    return (p.array() > b.box.low.array()).all() && (p.array() < b.box.high.array()).all() &&
           std::abs(shapes::winding(b.closed, p)) > 0.5;
  });
}

bool shapes_touch(const Shape& a, const Shape& b, const Eigen::Isometry3d& pa, const Eigen::Isometry3d& pb) {
  fcl::CollisionResultd result;
  fcl::collide(a.tree.get(), pa, b.tree.get(), pb, fcl::CollisionRequestd(), result);
  return result.isCollision() || inside(a, b, pb.inverse() * pa) || inside(b, a, pa.inverse() * pb);
}

double surfaces_distance(const Shape& a, const Shape& b, const Eigen::Isometry3d& pa,
                         const Eigen::Isometry3d& pb) {
  fcl::DistanceResultd result;
  fcl::distance(a.tree.get(), pa, b.tree.get(), pb, fcl::DistanceRequestd(), result);
  return std::max(0.0, result.min_distance);
}

// Negative where they overlap.
double spheres_distance(const Part& a, const Part& b, const Eigen::Isometry3d& b_in_a) {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t j = 0; j < b.spheres.size(); j++) {
    const Point p = b_in_a * b.spheres.centers[j];
    if ((p - a.center).norm() - a.radius - b.spheres.radii[j] >= least) continue;  // all of a is farther
    for (std::size_t i = 0; i < a.spheres.size(); i++)
      least = std::min(least, (a.spheres.centers[i] - p).norm() - a.spheres.radii[i] - b.spheres.radii[j]);
  }
  return least;
}

// What was found in some poses.
struct Counts {
  std::uint64_t tests = 0, both_touch = 0, only_spheres = 0, only_meshes = 0, patched = 0, faults = 0;
  double worst = 0;  // distance over what is allowed
  std::string example;

  void add(const Counts& c) {
    tests += c.tests, both_touch += c.both_touch, only_spheres += c.only_spheres;
    only_meshes += c.only_meshes, patched += c.patched, faults += c.faults;
    worst = std::max(worst, c.worst);
    if (example.empty()) example = c.example;
  }
};

class Audit {
 public:
  Audit(const fs::path& robot, const fs::path& report, const fs::path& spheres,
        const RobotReadOptions& options)
      : robot_(read_robot(robot, options)), parts_(robot_.links.size()) {
    for (const auto& [i, j] : neighbours(robot_)) adjacent_.insert({i, j});
    std::map<std::string, Json> told;
    const Json json = Json::parse(read_file(report));
    for (const Json& link : json.at("links")) told[link.at("link")] = link;
    for (std::size_t k = 0; k < parts_.size(); k++) {
      const RobotLink& link = robot_.links[k];
      if (link.shapes.empty()) continue;
      Part& part = parts_[k];
      const ReadResult file = read_link(link, robot);  // its round shapes are a little too small
      const Mesh& mesh = file.mesh;
      part.spheres = read_spheres(spheres, link.name);
      const Json& accuracy = told.at(link.name).at("accuracy");
      if (accuracy.is_null()) {  // spheres that were kept
        part.shape = shape_of(mesh, mesh);
      } else {
        if (!accuracy.at("certified").get<bool>() || accuracy.at("proved_against") == "wrap")
          throw Error("link " + link.name + ": its errors are not proved against its mesh");
        part.protrusion = accuracy.at("protrusion_bound"), part.gap = accuracy.at("gap_bound");
        set_shape(part, mesh, told.at(link.name), link.name);
      }
      part.protrusion += file.chord_error;
      const Box& box = part.shape.box;
      part.center = 0.5 * (box.low + box.high);
      part.radius = 0.5 * box.diagonal() + part.protrusion;
    }
  }

  // The value of each joint between its limits; of one that follows another, what follows.
  std::vector<double> random_values(std::mt19937_64& random) const {
    std::vector<double> values;
    for (const Body& b : robot_.model.bodies) {
      double low = 0, high = 0;
      if (b.joint.turns()) low = -std::numbers::pi, high = std::numbers::pi;
      if (b.joint.limited()) low = b.joint.lower, high = b.joint.upper;
      values.push_back(low == high ? low : std::uniform_real_distribution<>(low, high)(random));
    }
    return values;
  }

  Counts compare(const Poses& poses) const {
    Counts counts;
    for (std::size_t i = 0; i < parts_.size(); i++)
      for (std::size_t j = i + 1; j < parts_.size(); j++) {
        const Part &a = parts_[i], &b = parts_[j];
        if (!a.shape.tree || !b.shape.tree || adjacent_.contains({i, j})) continue;
        counts.tests++;
        if ((poses[i] * a.center - poses[j] * b.center).norm() > a.radius + b.radius) continue;
        judge(counts, i, j, poses);
      }
    return counts;
  }

  const Model& model() const { return robot_.model; }
  const std::vector<Part>& parts() const { return parts_; }

 private:
  void judge(Counts& counts, std::size_t i, std::size_t j, const Poses& poses) const {
    const Part &a = parts_[i], &b = parts_[j];
    const double apart = spheres_distance(a, b, poses[i].inverse() * poses[j]);
    const bool spheres = apart <= 0;
    const double allowed = spheres ? a.protrusion + b.protrusion : a.gap + b.gap;
    // How far apart these surfaces or the spheres are, if only one of the two touches; else nothing.
    const auto difference = [&](const Shape& s, const Shape& t) -> std::optional<double> {
      if (shapes_touch(s, t, poses[i], poses[j]) == spheres) return {};
      return spheres ? surfaces_distance(s, t, poses[i], poses[j]) : apart;
    };
    constexpr double rounding = 1e-7;  // of STL's float32, in metres
    const auto differs = difference(a.shape, b.shape);
    if (a.unpatched || b.unpatched)
      counts.patched += difference(a.as_it_came(), b.as_it_came()).value_or(0) > allowed + rounding;
    counts.both_touch += spheres && !differs;
    if (!differs) return;
    (spheres ? counts.only_spheres : counts.only_meshes)++;
    if (*differs <= allowed + rounding) {
      counts.worst = std::max(counts.worst, allowed > 0 ? *differs / allowed : 0);
      return;
    }
    counts.faults++;
    counts.example = robot_.links[i].name + " and " + robot_.links[j].name + ": only the " +
                     (spheres ? "spheres" : "meshes") + " touch, and the others are " +
                     std::to_string(*differs) + " m apart where " + std::to_string(allowed) + " is allowed";
  }

  RobotTree robot_;
  std::vector<Part> parts_;
  std::set<std::pair<std::size_t, std::size_t>> adjacent_;
};

#ifdef PADDER_MUJOCO
class Mujoco {
 public:
  explicit Mujoco(const fs::path& file) : loaded_(file) {
    mju_user_warning = [](const char*) {};  // that its room for contacts is full: it would print that
  }

  // The largest distance of a geom from its sphere. The value of a joint goes to the place that has its name.
  double error(const Model& robot, const std::vector<Part>& parts, const std::vector<double>& values,
               const Poses& poses) {
    for (std::size_t k = 0; k < values.size(); k++)
      if (const int joint = loaded_.id(mjOBJ_JOINT, robot.bodies[k].joint.name); joint >= 0)
        data_->qpos[model_->jnt_qposadr[joint]] = values[k];
    mj_forward(model_, data_);
    double worst = 0;
    for (std::size_t k = 0; k < parts.size(); k++) {
      if (parts[k].spheres.size() == 0) continue;
      const int body = loaded_.id(mjOBJ_BODY, robot.bodies[k].name);
      if (body < 0 || model_->body_geomnum[body] != static_cast<int>(parts[k].spheres.size()))
        throw Error("MuJoCo's body " + robot.bodies[k].name + " has another number of spheres");
      for (std::size_t s = 0; s < parts[k].spheres.size(); s++) {
        const double* x = data_->geom_xpos + 3 * (static_cast<std::size_t>(model_->body_geomadr[body]) + s);
        worst = std::max(worst, (Point(x[0], x[1], x[2]) - poses[k] * parts[k].spheres.centers[s]).norm());
      }
    }
    return worst;
  }
  int contacts_at_first() {
    mj_resetData(model_, data_);
    mj_forward(model_, data_);
    return data_->ncon;
  }

 private:
  InMujoco loaded_;
  mjModel* model_ = loaded_.model;
  mjData* data_ = loaded_.data;
};
#endif

// What the joints that follow others stand at, beside those that do not.
std::vector<double> with_followers(const Model& model, std::vector<double> values) {
  for (std::size_t turns = 0; turns < values.size(); turns++)
    for (std::size_t k = 0; k < values.size(); k++)
      for (std::size_t leader = 0; leader < values.size(); leader++)
        if (const Joint& j = model.bodies[k].joint;
            !j.mimic.empty() && model.bodies[leader].joint.name == j.mimic)
          values[k] = j.multiplier * values[leader] + j.offset;
  return values;
}

int run(const std::vector<std::string>& words) {
  RobotReadOptions options;
  std::vector<std::string> a;
  for (std::size_t k = 0; k < words.size(); k++)
    if (words[k] == "--visual")
      options.visual = true;
    else if (words[k] == "--package-path")
      options.package_folders.emplace_back(words.at(++k));
    else if (words[k] == "--xacro")
      options.xacro.push_back(words.at(++k));
    else
      a.push_back(words[k]);
  const int poses = a.size() > 4 ? std::stoi(a[4]) : 10000;
  const std::uint64_t seed = a.size() > 5 ? std::stoull(a[5]) : 1;
  const Audit audit(a[0], a[1], a[2], options);
  std::mt19937_64 random(seed);
  std::vector<std::vector<double>> values;
  for (int k = 0; k < poses; k++) values.push_back(audit.random_values(random));
  std::vector<Counts> counts(values.size());
#pragma omp parallel for schedule(dynamic, 16)
  for (std::size_t k = 0; k < values.size(); k++)
    counts[k] = audit.compare(poses_at(audit.model(), values[k]));
  Counts all;
  for (const Counts& c : counts) all.add(c);
  bool bad = all.faults > 0;
  Json mujoco;
#ifdef PADDER_MUJOCO
  Mujoco robot(a[3]);
  const int touching = robot.contacts_at_first();
  double error = 0;
  for (std::size_t k = 0; k < std::min<std::size_t>(100, values.size()); k++)
    error =
        std::max(error, robot.error(audit.model(), audit.parts(), with_followers(audit.model(), values[k]),
                                    poses_at(audit.model(), values[k])));
  mujoco = {{"version", mj_versionString()}, {"contacts_at_zero", touching}, {"farthest", error}};
  bad = bad || touching > 0 || !(error < 1e-9);
#endif
  const Json out = {{"tests", all.tests},
                    {"both_touch", all.both_touch},
                    {"only_spheres", all.only_spheres},
                    {"only_meshes", all.only_meshes},
                    {"patched", all.patched},
                    {"faults", all.faults},
                    {"worst", all.worst},
                    {"example", all.example},
                    {"poses", poses},
                    {"seed", seed},
                    {"mujoco", mujoco}};
  std::printf("%s\n", out.dump().c_str());
  return bad ? 1 : 0;
}

}  // namespace
}  // namespace padder

int main(int argc, char** argv) {
  try {
    if (argc < 5)
      throw padder::Error("robot_audit ROBOT REPORT SPHERES.urdf MODEL.xml [POSES [SEED]] [--visual]");
    return padder::run({argv + 1, argv + argc});
  } catch (const std::exception& e) {
    std::fprintf(stderr, "robot_audit: %s\n", e.what());
    return 2;
  }
}
