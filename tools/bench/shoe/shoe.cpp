// SPDX-License-Identifier: GPL-3.0-or-later
// Speed against error, from the mesh to the motion: a part padded at six tolerances is dropped on a bed of
// gravel. For each tolerance: what a step takes, how far single contacts are from those of the exact mesh,
// and how far the part comes to rest from where the finest one does.
#include <algorithm>
#include <cmath>
#include <ctime>
#include <numbers>

#include "padding/asset/error.h"
#include "padding/pad.h"
#include "tools/bench/bench.h"
#include "tools/bench/shoe/exact_mesh.h"
#include "tools/settle/read_scene.h"
#include "tools/settle/stepper.h"

namespace padder::bench {
namespace {

constexpr double kTolerances[] = {5, 3, 2, 1, 0.5, 0.25};  // % of the diagonal
constexpr int kBeds = 3;                                   // of other grains: a mean of three drops
constexpr std::uint64_t kSingle = 20000;                   // single contacts
constexpr double kFriction = 0.6, kDensity = 7800, kDropTime = 0.4;

struct Part {
  Mesh mesh;
  ExactMesh exact;
  MassProperties mass;  // of the mesh
  Box box;
  double diagonal, grain;  // the largest grain's radius
};

struct Padding {
  double tolerance = 0;  // %
  std::vector<detect::Sphere> spheres;
};

struct Grains {
  std::vector<Point> centers;  // in the part's frame
  std::vector<double> radii;
};

// What contacts with the spheres get wrong beside those with the mesh, whose nearest point gives the exact
// normal and, against the grain's radius, the exact depth; negative for a grain that the mesh does not touch.
struct ContactErrors {
  std::uint64_t contacts = 0;
  double normal_mean = 0, normal_p95 = 0;  // degrees
  double depth_mean = 0, depth_p95 = 0;    // % of the diagonal
};

double p95(std::vector<double>& values) {
  if (values.empty()) return 0;
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(0.95 * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}
double mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v;
  return values.empty() ? 0 : sum / static_cast<double>(values.size());
}

// The direction of a contact with several spheres is that of the springs' sum; its depth the deepest.
ContactErrors errors_of(const Part& part, const Padding& padding, const Grains& grains) {
  const std::vector<std::uint32_t> alike(grains.radii.size(), 1);  // grains do not meet each other
  const detect::Shape shape{padding.spheres.data(), padding.spheres.size()};
  const detect::Body body;
  detect::Input input;
  input.shapes = {&shape, 1}, input.bodies = {&body, 1};
  input.spheres =
      detect::spheres_of<double>(grains.radii.size(), grains.centers.data()->data(), grains.radii.data());
  input.spheres.family = alike.data();
  detect::CallOptions options;
  options.scalar = detect::Scalar::f64;
  detect::Detector detector({detect::BackendKind::omp}, options);
  const detect::Contacts& found = detect_watched(detector, input);
  std::vector<Vector> push(grains.radii.size(), Vector::Zero());
  std::vector<double> depth(grains.radii.size(), -1);
  for (std::size_t c = 0; c < found.count; c++) {
    const std::size_t g = found.pairs[c].j - padding.spheres.size();
    const detect::Normal<double>& n = found.normal_span<double>()[c];
    push[g] -= n.depth * Vector(n.x, n.y, n.z), depth[g] = std::max(depth[g], n.depth);
  }
  ContactErrors e;
  std::vector<double> angles, depths;
  for (std::size_t g = 0; g < grains.radii.size(); g++) {
    if (depth[g] < 0) continue;
    const Vector to = part.exact.nearest(grains.centers[g]) - grains.centers[g];
    const double cosine = push[g].norm() > 0 ? push[g].dot(to) / (push[g].norm() * to.norm()) : 1;
    angles.push_back(std::acos(std::clamp(cosine, -1.0, 1.0)) * 180 / std::numbers::pi);
    depths.push_back(std::abs(depth[g] - (grains.radii[g] - to.norm())) / part.diagonal * 100);
  }
  e.contacts = angles.size();
  e.normal_mean = mean(angles), e.normal_p95 = p95(angles);
  e.depth_mean = mean(depths), e.depth_p95 = p95(depths);
  return e;
}

// A place on the mesh that a grain can touch, and the way to it.
struct Approach {
  Point at;
  Vector from;  // unit
};
std::vector<Approach> approaches(const Part& part) {
  std::vector<double> upto;
  double area = 0;
  for (std::size_t t = 0; t < part.mesh.triangles.size(); t++)
    upto.push_back(area += part.mesh.area_normal(t).norm());
  detect::SplitMix64 random(1);
  std::vector<Approach> out;
  for (std::uint64_t tries = 0; out.size() < kSingle && tries < 100 * kSingle; tries++) {
    const auto t = static_cast<std::size_t>(
        std::lower_bound(upto.begin(), upto.end() - 1, random.unit() * area) - upto.begin());
    double u = random.unit(), v = random.unit();
    if (u + v > 1) u = 1 - u, v = 1 - v;
    const Point at = part.mesh.corner(t, 0) + u * (part.mesh.corner(t, 1) - part.mesh.corner(t, 0)) +
                     v * (part.mesh.corner(t, 2) - part.mesh.corner(t, 0));
    const Vector normal = part.mesh.area_normal(t).normalized();
    const Point center = at + part.grain * normal;
    if ((part.exact.nearest(center) - center).norm() > 0.999 * part.grain) out.push_back({at, normal});
  }
  return out;
}

// Grains that come along their ways until they press a fiftieth of their radius into the first sphere. One
// that meets no sphere within one and a half tolerances of the mesh is left out: a hole.
Grains single_contacts(const Part& part, const Padding& padding, const std::vector<Approach>& ways) {
  Grains out;
  const double radius = part.grain, reach = 0.015 * padding.tolerance * part.diagonal;
  for (const Approach& way : ways) {
    double first = -1;
    for (const detect::Sphere& s : padding.spheres) {
      const Vector to = Point(s.x, s.y, s.z) - way.at;
      const double along = to.dot(way.from), sum = s.r + 0.98 * radius;
      const double square = sum * sum - (to.squaredNorm() - along * along);
      if (square < 0) continue;
      const double t = along + std::sqrt(square);
      if (t <= radius + reach) first = std::max(first, t);
    }
    if (first < radius - reach) continue;
    out.centers.push_back(way.at + first * way.from), out.radii.push_back(radius);
  }
  return out;
}

// A bed six grains deep in a box, at rest. The part's weight presses a grain in by a fiftieth of its radius.
settle::System bed(const Part& part, std::uint64_t grains, std::uint64_t seed, const Settings& s,
                   detect::BackendKind backend) {
  const double pitch = 2.05 * part.grain, least = 0.7 * part.grain;
  const double half = std::max(0.5 * pitch * std::ceil(std::sqrt(static_cast<double>(grains) / 6)),
                               0.5 * (part.box.high - part.box.low).maxCoeff() + 2 * part.grain);
  const double weight = 9.81 * kDensity * part.mass.volume;
  Json planes = {{{"point", {0, 0, 0}}, {"normal", {0, 0, 1}}}};
  for (const double sign : {-1.0, 1.0}) {
    planes.push_back({{"point", {sign * half, 0, 0}}, {"normal", {-sign, 0, 0}}});
    planes.push_back({{"point", {0, sign * half, 0}}, {"normal", {0, -sign, 0}}});
  }
  const Json scene = {{"format", "padder.scene"},
                      {"version", 1},
                      {"unit", "m"},
                      {"settle",
                       {{"material",
                         {{"density", 2500},
                          {"friction", kFriction},
                          {"restitution", 0.2},
                          {"stiffness", weight / (0.02 * least)}}},
                        {"seed", seed},
                        {"planes", planes},
                        {"grains",
                         {{{"count", grains},
                           {"radius", {least, part.grain}},
                           {"low", {-half, -half, 0}},
                           {"high", {half, half, 1e3}}}}}}}};
  settle::System system = settle::settle_scene_from_json(scene.dump(), "bed", ".").system;
  settle::Stepper stepper(system, {s.threads, -1, backend});
  while (stepper.time() < 0.5) stepper.step(100);
  return stepper.system();
}

struct Drop {
  double step = 0, processor = 0, detection = 0;  // seconds a step, and processor time
  double deepest = 0;                             // % of the diagonal
  settle::Vec3 position;
  settle::Quaternion turn;
  ContactErrors errors;  // of the contacts at rest
};

Drop drop(const Part& part, const Padding& padding, const settle::System& on, double raise, const Settings& s,
          detect::BackendKind backend) {
  settle::System system = on;
  const auto grains = std::move(system.grain_radius);
  const auto at = std::move(system.position);
  for (auto* list :
       {&system.position, &system.velocity, &system.momentum, &system.spin, &system.inverse_inertia})
    list->clear();
  system.grain_radius.clear(), system.inverse_mass.clear();
  const MassProperties& m = part.mass;
  std::vector<detect::Sphere> shape;
  for (const detect::Sphere& p : padding.spheres) {
    const Vector local = m.axes.transpose() * (Point(p.x, p.y, p.z) - m.center);
    shape.push_back({local.x(), local.y(), local.z(), p.r});
  }
  system.shapes.push_back(std::move(shape));
  const Vector i = kDensity * m.moments;
  const Eigen::Quaterniond turn(m.axes);
  double top = 0;
  for (std::size_t g = 0; g < grains.size(); g++) top = std::max(top, at[g].z + grains[g]);
  const double z = top + 0.06 * part.diagonal + raise - part.box.low.z();  // no padding reaches farther
  const Point center = m.center - Point(part.box.center().x(), part.box.center().y(), -z);
  add_body(system, 0, {kDensity * m.volume, {i.x(), i.y(), i.z()}}, {center.x(), center.y(), center.z()},
           {turn.w(), turn.x(), turn.y(), turn.z()});
  for (std::size_t g = 0; g < grains.size(); g++) add_grain(system, at[g], grains[g], 2500);
  settle::Stepper stepper(system, {s.threads, -1, backend});
  const std::clock_t begun = std::clock();
  while (stepper.time() < kDropTime) stepper.step(100);
  Drop out;
  out.processor =
      static_cast<double>(std::clock() - begun) / CLOCKS_PER_SEC / static_cast<double>(stepper.steps());
  const auto steps = static_cast<double>(stepper.steps());
  out.step = stepper.effort().seconds / steps, out.detection = stepper.effort().detection_seconds / steps;
  const settle::Watch w = stepper.watch();
  out.deepest = w.deepest / part.diagonal * 100;
  const settle::System& end = stepper.system();
  out.position = end.position[0], out.turn = end.orientation[0];
  const Eigen::Matrix3d rotation =
      Eigen::Quaterniond(out.turn.w, out.turn.x, out.turn.y, out.turn.z).toRotationMatrix() *
      m.axes.transpose();
  Grains rest;
  for (std::size_t g = 0; g < grains.size(); g++) {
    const settle::Vec3& p = end.position[g + 1];
    const Vector from(p.x - out.position.x, p.y - out.position.y, p.z - out.position.z);
    rest.centers.push_back(rotation.transpose() * from + m.center), rest.radii.push_back(grains[g]);
  }
  out.errors = errors_of(part, padding, rest);
  return out;
}

double angle_between(const settle::Quaternion& a, const settle::Quaternion& b) {
  const double c = std::abs(a.w * b.w + a.x * b.x + a.y * b.y + a.z * b.z);
  return 2 * std::acos(std::min(c, 1.0)) * 180 / std::numbers::pi;
}

// The mean over the beds, against the drops of the finest padding.
Json row_of(const Part& part, const std::string& name, const Padding& padding, const std::vector<Drop>& drops,
            const std::vector<Drop>& finest, const ContactErrors& single, std::size_t approached,
            const char* backend) {
  Json r = {{"part", name},
            {"backend", backend},
            {"tolerance_percent", padding.tolerance},
            {"spheres", padding.spheres.size()}};
  const auto over_beds = [&](auto value) {
    double sum = 0;
    for (std::size_t k = 0; k < drops.size(); k++) sum += value(drops[k], finest[k]);
    return sum / static_cast<double>(drops.size());
  };
  r["seconds"] = over_beds([](const Drop& d, const Drop&) { return d.step; });
  r["seconds_processor"] = over_beds([](const Drop& d, const Drop&) { return d.processor; });
  r["seconds_detection"] = over_beds([](const Drop& d, const Drop&) { return d.detection; });
  r["normal_error_mean_deg"] = single.normal_mean, r["normal_error_p95_deg"] = single.normal_p95;
  r["depth_error_mean_percent"] = single.depth_mean, r["depth_error_p95_percent"] = single.depth_p95;
  r["missed_share"] = 1 - static_cast<double>(single.contacts) / static_cast<double>(approached);
  r["rest_contacts"] = over_beds([](const Drop& d, const Drop&) { return double(d.errors.contacts); });
  r["rest_normal_error_mean_deg"] =
      over_beds([](const Drop& d, const Drop&) { return d.errors.normal_mean; });
  r["rest_depth_error_mean_percent"] =
      over_beds([](const Drop& d, const Drop&) { return d.errors.depth_mean; });
  r["deepest_percent"] = over_beds([](const Drop& d, const Drop&) { return d.deepest; });
  r["height_difference_percent"] = over_beds([&](const Drop& d, const Drop& f) {
    return std::abs(d.position.z - f.position.z) / part.diagonal * 100;
  });
  r["angle_difference_deg"] =
      over_beds([](const Drop& d, const Drop& f) { return angle_between(d.turn, f.turn); });
  return r;
}

Json cells_of(const Json& r, const std::string& label) {
  const auto n = [&](const char* key, const char* format) { return number(r[key].get<double>(), format); };
  return {r["backend"],
          label,
          std::to_string(r["spheres"].get<std::uint64_t>()),
          number(r["seconds"].get<double>() * 1e3, "%.3f"),
          number(r["seconds_processor"].get<double>() * 1e3, "%.3f"),
          number(r["seconds_detection"].get<double>() * 1e3, "%.3f"),
          n("normal_error_mean_deg", "%.2f"),
          n("normal_error_p95_deg", "%.1f"),
          n("depth_error_mean_percent", "%.3f"),
          number(100 * r["missed_share"].get<double>(), "%.1f"),
          n("rest_normal_error_mean_deg", "%.2f"),
          n("deepest_percent", "%.3f"),
          n("height_difference_percent", "%.3f"),
          n("angle_difference_deg", "%.2f")};
}

std::vector<Padding> paddings_of(const ReadResult& file, const Settings& s, Part& part) {
  std::vector<Padding> out;
  for (const double t : kTolerances) {
    say(s, "padding at " + number(t, "%g %%"));
    PadOptions options;
    options.tolerance = Length::share(0.01 * t);
    const Padded padded = pad(file, options);
    Padding p{t, {}};
    for (std::size_t k = 0; k < padded.cluster.size(); k++) {
      const Point& c = padded.cluster.centers[k];
      p.spheres.push_back({c.x(), c.y(), c.z(), padded.cluster.radii[k]});
    }
    part.mass = padded.cluster.mass;
    out.push_back(std::move(p));
  }
  if (!(part.mass.volume > 0))
    throw Error("the mesh bounds no volume, and so has no mass: choose a closed one");
  return out;
}

}  // namespace

Json shoe(const Settings& s) {
  if (s.files.size() != 1) wrong_usage("name one mesh: bench shoe assets/track_shoe.obj");
  const ReadResult file = read_mesh(s.files[0]);
  const std::string name = std::filesystem::path(s.files[0]).stem().string();
  const Box box = file.mesh.bounds();
  Part part{file.mesh, ExactMesh(file.mesh), {}, box, box.diagonal(), 0.03 * (box.high - box.low).maxCoeff()};
  const std::vector<Padding> paddings = paddings_of(file, s, part);
  const std::uint64_t grains = size_or(s, 2000);
  const std::vector<Approach> ways = approaches(part);
  std::vector<ContactErrors> errors;
  for (const Padding& p : paddings) errors.push_back(errors_of(part, p, single_contacts(part, p, ways)));
  Json rows = Json::array(),
       table = Json::array(
           {{"backend", "tolerance [%]", "spheres", "step [ms]", "processor [ms]", "detection [ms]",
             "normal error [deg]", "95 %", "depth error [%]", "missed [%]", "at rest: normal error [deg]",
             "deepest [%]", "height off by [%]", "turned by [deg]"}});
  for (const detect::BackendKind backend : backends(s)) {
    const char* const where = name_of(backend);
    std::vector<settle::System> beds;
    for (int k = 1; k <= kBeds; k++)
      say(s, std::string(where) + ": bed " + std::to_string(k)),
          beds.push_back(bed(part, grains, static_cast<std::uint64_t>(k), s, backend));
    const auto drops_of = [&](const Padding& p, double raise) {
      say(s, std::string(where) + ": dropped at " + number(p.tolerance, "%g %%"));
      std::vector<Drop> drops;
      for (const settle::System& one : beds) drops.push_back(drop(part, p, one, raise, s, backend));
      return drops;
    };
    const std::vector<Drop> finest = drops_of(paddings.back(), 0);
    const auto add = [&](std::size_t k, const std::vector<Drop>& drops, const std::string& label) {
      rows.push_back(row_of(part, name, paddings[k], drops, finest, errors[k], ways.size(), where));
      rows.back()["again"] = &drops != &finest && k + 1 == paddings.size();
      table.push_back(cells_of(rows.back(), label));
    };
    for (std::size_t k = 0; k + 1 < paddings.size(); k++)
      add(k, drops_of(paddings[k], 0), number(paddings[k].tolerance, "%g"));
    add(paddings.size() - 1, finest, number(paddings.back().tolerance, "%g"));
    // How far two runs part that differ by nothing that matters.
    add(paddings.size() - 1, drops_of(paddings.back(), 1e-6 * part.diagonal), "the same, a millionth higher");
  }
  return {{"bench", "shoe"},           {"machine", machine()}, {"part", name},
          {"grains", grains},          {"beds", kBeds},        {"single_contacts", ways.size()},
          {"diagonal", part.diagonal}, {"rows", rows},         {"table", table}};
}

}  // namespace padder::bench
