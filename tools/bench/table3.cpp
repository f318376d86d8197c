// SPDX-License-Identifier: GPL-3.0-or-later
// Table 3 of the paper: a step of a silo of constant height at rest, as the number of spheres grows. The
// stepper and the scene are those of the program settle.
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "tools/bench/bench.h"
#include "tools/bench/device.h"
#include "tools/settle/make_scene.h"
#include "tools/settle/read_scene.h"
#include "tools/settle/stepper.h"

namespace padder::bench {
namespace {

// Seconds a step, and contacts, on one Tesla C1060: the paper's rows by objects.
struct PaperRow {
  double total, detection, solver;
  std::uint64_t contacts;
};
const std::map<std::uint64_t, PaperRow>& paper() {
  static const std::map<std::uint64_t, PaperRow> rows = {
      {100000, {6.1972, 0.5436, 5.4243, 361440}},    {200000, {12.1190, 1.0758, 10.5881, 718377}},
      {300000, {18.2708, 1.6183, 15.9482, 1080069}}, {400000, {23.2806, 1.9746, 20.4606, 1403784}},
      {500000, {29.2565, 2.4568, 25.7773, 1765772}}, {600000, {35.0433, 2.9785, 30.7971, 2124639}},
      {700000, {40.5938, 3.4695, 35.6405, 2439241}}, {800000, {46.9516, 4.0234, 41.2297, 2838832}},
      {900000, {52.6227, 4.5272, 46.1909, 3178228}}, {1000000, {58.1518, 4.9473, 51.1686, 3548594}}};
  return rows;
}

// Until the number of contacts stays within half a percent for a twentieth of a second, as the paper runs
// "until the number of collisions reached steady state"; not before the column has had the time to fall.
void run_until_steady(settle::Stepper& stepper, const Settings& s, double least_time, double most_time) {
  const double window = 0.05;
  std::uint64_t low = 0, high = 0;
  double until = least_time;
  for (bool steady = false; !steady && stepper.time() < most_time;) {
    low = ~std::uint64_t(0), high = 0;
    while (stepper.time() < until) {
      stepper.step(20);
      if (stepper.time() >= until - window)
        low = std::min(low, stepper.contacts()), high = std::max(high, stepper.contacts());
    }
    steady = high > 0 && static_cast<double>(high - low) <= 0.005 * static_cast<double>(high);
    until = stepper.time() + window;
    say(s, std::to_string(stepper.system().spheres()) + " spheres: time " + number(stepper.time(), "%.2f") +
               ", " + std::to_string(high) + " contacts");
  }
}

std::vector<detect::FloatSphere> grains_of(const settle::System& s) {
  std::vector<detect::FloatSphere> spheres;
  for (std::size_t k = 0; k < s.movers(); k++) {
    const settle::Vec3& p = s.position[k];
    spheres.push_back({static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z),
                       static_cast<float>(s.grain_radius[k])});
  }
  return spheres;
}

// A call of the detector with normals, between two states of the silo 50 steps apart: what a program pays
// that keeps the detector's list. With a history and without.
std::pair<double, double> detection_calls(settle::Stepper& stepper, const Settings& s,
                                          detect::BackendKind backend) {
  const bool cuda = backend == detect::BackendKind::cuda;
  const DeviceSpheres before(grains_of(stepper.system()), cuda);
  stepper.step(50);
  const std::vector<detect::FloatSphere> later = grains_of(stepper.system());
  const DeviceSpheres after(later, cuda);
  detect::CallOptions options = options_of(s, backend);
  const auto call = [&](bool history) {
    options.history = history;
    detect::Detector detector({backend}, options);
    bool odd = false;
    return median_seconds(60, [&] {
      odd = !odd;
      detect_watched(detector, odd ? before.input() : after.input());
    });
  };
  const double with = call(true);
  return {with, call(false)};
}

// A step of a stepper that asks the detector in each, and of it the detection.
std::pair<double, double> median_step(settle::Stepper& stepper) {
  stepper.step(10);  // the first calls read the scene and find its grid
  const settle::Stepper::Effort& effort = stepper.effort();
  std::vector<double> steps, detections;
  for (int k = 0; k < 41; k++) {
    const double begun = effort.seconds, begun_detection = effort.detection_seconds;
    stepper.step(1);
    steps.push_back(effort.seconds - begun), detections.push_back(effort.detection_seconds - begun_detection);
  }
  return {median(steps), median(detections)};
}

settle::SettleScene silo(std::uint64_t spheres) {
  return settle::settle_scene_from_json(settle::make_scene("silo", {spheres, {}, 1}, "."), "silo", ".");
}

// The silo filled with bodies of three spheres to half its height. They stand upright on a lattice, each
// turned by another angle, and fall.
settle::SettleScene clump_silo(std::uint64_t clumps) {
  const double r = settle::kSiloGrain, arm = 0.6 * r, density = 2500, edge = 2.04 * (r + arm);
  const double one = density * 4 / 3 * std::numbers::pi * r * r * r, own = 0.4 * one * r * r;
  const double radius = std::sqrt(static_cast<double>(clumps) * 3 * one / density /
                                  (std::numbers::pi * 0.5 * settle::kSiloHeight * settle::kSiloPacking));
  settle::SettleScene scene;
  settle::System& system = scene.system;
  std::vector<detect::Sphere> shape;
  for (int k = 0; k < 3; k++) {
    const double angle = 2 * std::numbers::pi * k / 3;
    shape.push_back({arm * std::cos(angle), arm * std::sin(angle), 0, r});
  }
  system.shapes.push_back(shape);
  // As if the spheres did not overlap.
  const double across = 3 * own + 1.5 * one * arm * arm;
  const settle::Mass mass{3 * one, {across, across, 3 * own + 3 * one * arm * arm}};
  system.gravity = {0, 0, -9.81};
  system.law.surfaces[0][0] = {settle::damping_ratio_of(0.3), 0.3};
  system.walls.push_back({settle::Wall::Kind::plane, {0, 0, 0}, {0, 0, 1}, 0, 0.3});
  system.walls.push_back({settle::Wall::Kind::cylinder, {0, 0, 0}, {0, 0, 1}, radius, 0.3});
  detect::SplitMix64 random(1);
  const auto side = static_cast<std::int64_t>(radius / edge) + 1;
  for (double z = 0.6 * edge; system.bodies.size() < clumps; z += edge)
    for (std::int64_t y = -side; y <= side && system.bodies.size() < clumps; y++)
      for (std::int64_t x = -side; x <= side && system.bodies.size() < clumps; x++) {
        const settle::Vec3 at{edge * static_cast<double>(x), edge * static_cast<double>(y), z};
        if (std::hypot(at.x, at.y) > radius - 0.5 * edge) continue;
        const settle::Vec3 turn{random.signed_unit(), random.signed_unit(), random.signed_unit()};
        add_body(system, 0, mass, at, settle::turned({}, 3 * turn));
      }
  system.law.stiffness = settle::chosen_stiffness(system);
  system.law.tangential_stiffness = 2.0 / 7 * system.law.stiffness;
  system.step = step_limits(system).chosen;
  scene.duration = 0.8;
  return scene;
}

Json measure(const Settings& s, std::uint64_t objects, detect::BackendKind backend) {
  const bool clumps = s.scene == "clumps";
  const settle::SettleScene scene = clumps ? clump_silo(objects) : silo(objects);
  settle::Stepper stepper(scene.system, {s.threads, -1, backend});
  run_until_steady(stepper, s, 0.4, scene.duration);
  settle::Stepper every(scene.system, {s.threads, 0, backend});
  every.resume(stepper.snapshot());
  const settle::Stepper::Effort& effort = stepper.effort();
  const double total = effort.seconds, detection = effort.detection_seconds;
  const std::uint64_t first = stepper.steps(), detections = effort.detections;
  stepper.step(400);
  const double total_step = (effort.seconds - total) / 400,
               detection_step = (effort.detection_seconds - detection) / 400;
  const std::uint64_t asked = effort.detections - detections, contacts = stepper.contacts();
  const auto [each_step, each] = median_step(every);
  const auto [history, plain] = clumps ? std::pair(0.0, 0.0) : detection_calls(stepper, s, backend);
  return {{"scene", clumps ? "clumps" : "silo"},
          {"backend", stepper.backend()},
          {"objects", objects},
          {"spheres", scene.system.spheres()},
          {"contacts", contacts},
          {"radius", scene.system.walls[1].radius},
          {"time_step", scene.system.step},
          {"steps_to_steady", first},
          {"seconds", total_step},
          {"seconds_detection", detection_step},
          {"seconds_solver", total_step - detection_step},
          {"seconds_every_step", each},
          {"seconds_step_with_detection", each_step},
          {"seconds_history", history},
          {"seconds_plain", plain},
          {"detections", asked},
          {"seconds_moving", total / static_cast<double>(first)},
          {"seconds_detection_moving", detection / static_cast<double>(first)},
          {"penetration_ratio", stepper.watch().deepest_ratio}};
}

std::vector<std::uint64_t> sizes_for(const Settings& s, detect::BackendKind backend) {
  if (backend == detect::BackendKind::omp) return sizes_or(s, {25000, 50000, 100000});
  std::vector<std::uint64_t> papers;
  for (const auto& row : paper()) papers.push_back(row.first);
  return sizes_or(s, papers);
}

Json cells_of(const Json& r) {
  const auto ms = [&](const char* key) { return number(r[key].get<double>() * 1e3, "%.3f"); };
  const auto n = r["objects"].get<std::uint64_t>();
  Json cells = {r["backend"],
                std::to_string(n),
                std::to_string(r["contacts"].get<std::uint64_t>()),
                ms("seconds"),
                ms("seconds_detection"),
                ms("seconds_solver"),
                ms("seconds_every_step"),
                ms("seconds_history"),
                ms("seconds_moving"),
                ms("seconds_detection_moving"),
                number(1 / r["seconds"].get<double>(), "%.1f")};
  const auto row = r["scene"] == "silo" ? paper().find(n) : paper().end();
  if (row == paper().end()) {
    for (int k = 0; k < 4; k++) cells.push_back("-");
  } else {
    cells.push_back(std::to_string(row->second.contacts));
    for (const double v : {row->second.total, row->second.detection, row->second.solver})
      cells.push_back(number(v, "%.4f"));
  }
  return cells;
}

}  // namespace

Json table3(const Settings& s) {
  Json rows = Json::array(), squares = Json::object(),
       table = Json::array({{"backend", "objects", "contacts", "step [ms]", "detection [ms]", "solver [ms]",
                             "detection in every step [ms]", "one call with a history [ms]",
                             "while settling: step [ms]", "detection [ms]", "steps a second",
                             "paper: contacts", "total [s]", "detection [s]", "solver [s]"}});
  check_scene(s, "table3", {"silo", "clumps"});
  Json result;
  for (const detect::BackendKind backend : backends(s)) {
    std::map<std::string, Points> points;
    for (const std::uint64_t n : sizes_for(s, backend)) {
      const Json r = measure(s, n, backend);
      for (const char* key :
           {"seconds", "seconds_detection_moving", "seconds_every_step", "seconds_history", "seconds_plain"})
        points[key].emplace_back(r["contacts"].get<double>(), r[key].get<double>());
      table.push_back(cells_of(r)), rows.push_back(r);
      for (const auto& [key, of_key] : points) squares[name_of(backend)][key] = fitted_line(of_key).r2;
      result = {{"bench", "table3"},    {"machine", machine()}, {"gpu", device_name()},
                {"r_squared", squares}, {"rows", rows},         {"table", table}};
      write_result(s, result);  // after each row: the next one takes longer
    }
  }
  return result;
}

}  // namespace padder::bench
