// SPDX-License-Identifier: GPL-3.0-or-later
// Spheres against error: the tolerance ladder, the depth ladder, and the paper's fit as it is (section 2.3:
// one sphere a triangle at a fixed depth ratio, no refit). Seconds are from input to finished cluster,
// without the repair.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <utility>

#include "padding/by_depth/fit.h"
#include "padding/pad.h"
#include "padding/verify/accuracy.h"
#include "tools/bench/bench.h"

namespace padder::bench {
namespace {

constexpr double kTolerances[] = {2, 1, 0.5, 0.25, 0.1};  // % of the diagonal
constexpr double kEdges[] = {4, 2, 1, 0.5};  // %, of the remeshed triangles, at a depth ratio of 0.2

struct Row {
  std::string mesh, method;
  double setting = 0;  // % of the diagonal
  std::uint64_t spheres = 0;
  std::uint64_t fewest = 0;  // proved: no cover within this tolerance has fewer; 0: not asked
  double seconds = 0;
  Accuracy accuracy;  // lengths in % of the diagonal

  double error() const { return std::max(accuracy.protrusion_bound, accuracy.gap_bound); }
};

Row row_of(const std::string& mesh, const std::string& method, double setting, const Accuracy& accuracy,
           double diagonal) {
  Row row{mesh, method, setting, 0, 0, 0, accuracy};
  row.accuracy.scale(100 / diagonal);
  return row;
}

Row padded(const ReadResult& file, const std::string& method, double setting, const PadOptions& options) {
  const Padded p = pad(file, options);
  Row row = row_of(p.cluster.name, method, setting, p.cluster.accuracy, p.report.diagonal);
  row.fewest = p.report.fewest;
  row.spheres = p.cluster.size(), row.seconds = p.report.seconds.total() - p.report.seconds.repair;
  return row;
}

// Repaired and remeshed as `pad` does it, then nothing but the fit.
Row paper(const ReadResult& file, const std::string& name, double edge) {
  Mesh input = file.mesh;
  const Box box = input.bounds();
  for (Point& p : input.points) p = (p - box.center()) / box.diagonal();
  const double length = 0.01 * edge, depth = 0.2;
  const Repaired body = repair(input, {.accuracy = depth * length / std::numbers::sqrt3}, name);
  std::vector<Ball> balls;
  const double seconds = seconds_of([&] {
    RemeshOptions options;
    options.edge_length = length;
    if (body.kind == BodyKind::wrap) options.sharp_angle = 180;
    for (const FittedBall& f : fit(remesh(body.mesh, options).mesh, depth, length)) balls.push_back(f.ball);
  });
  Row row = row_of(name, "paper", edge, measure(input, body, body.surface(), balls).accuracy, 1);
  row.spheres = balls.size(), row.seconds = seconds;
  return row;
}

// Least-squares slope of log count over -log error: the p of count ~ 1 / error^p.
double growth(const std::vector<Row>& rows, const std::string& mesh, const std::string& method) {
  Points points;
  for (const Row& r : rows)
    if (r.mesh == mesh && r.method == method && r.error() > 0 && r.spheres > 0)
      points.push_back({-std::log(r.error()), std::log(static_cast<double>(r.spheres))});
  return fitted_line(points).slope;
}

// The same between the first and the last rung alone.
double growth_of_ends(const std::vector<Row>& rows, const std::string& mesh, const std::string& method) {
  const Row *first = nullptr, *last = nullptr;
  for (const Row& r : rows)
    if (r.mesh == mesh && r.method == method && r.error() > 0 && r.spheres > 0) (first ? last : first) = &r;
  if (!last || first->error() == last->error()) return 0;
  return std::log(static_cast<double>(last->spheres) / static_cast<double>(first->spheres)) /
         std::log(first->error() / last->error());
}

Json json_of(const Row& r) {
  const Accuracy& a = r.accuracy;
  return {{"mesh", r.mesh},
          {"method", r.method},
          {"setting_percent", r.setting},
          {"spheres", r.spheres},
          {"lower_bound", r.fewest > 0 ? Json(r.fewest) : Json(nullptr)},
          {"seconds", r.seconds},
          {"protrusion_bound", a.protrusion_bound},
          {"protrusion_max", a.protrusion_max},
          {"protrusion_mean", a.protrusion_mean},
          {"gap_bound", a.gap_bound},
          {"gap_max", a.gap_max},
          {"gap_mean", a.gap_mean},
          {"normal_error_mean_deg", a.normal_error_mean_deg},
          {"normal_error_p95_deg", a.normal_error_p95_deg},
          {"volume_ratio", a.volume_ratio},
          {"wrap_distance", a.wrap_distance},
          {"certified", a.certified}};
}

}  // namespace

Json frontier(const Settings& s) {
  if (s.files.empty()) wrong_usage("name at least one mesh: bench frontier MESH...");
  std::vector<Row> rows;
  Json growths = Json::array();
  // All are read before any is padded: what is wrong with the last should not come to light after hours.
  std::vector<std::pair<std::string, ReadResult>> meshes;
  std::set<std::string> names;
  for (const std::string& path : s.files) {
    const std::string name = std::filesystem::path(path).stem().string();
    if (!names.insert(name).second)
      wrong_usage(path + " has the name of another mesh, and rows go by names: rename one");
    meshes.emplace_back(name, read_mesh(path));
  }
  for (const auto& [name, file] : meshes) {
    for (const double t : kTolerances) {
      say(s, name + ": tolerance " + number(t, "%g %%"));
      PadOptions options;
      options.tolerance = Length::share(0.01 * t);
      options.lower_bound = t >= 0.5;  // the proof takes minutes for thousands of spheres
      rows.push_back(padded(file, "tolerance", t, options));
    }
    for (const double e : kEdges) {
      say(s, name + ": depth 0.2, edges " + number(e, "%g %%"));
      PadOptions options;
      options.depth_ratio = 0.2, options.edge_length = Length::share(0.01 * e);
      rows.push_back(padded(file, "depth", e, options));
      rows.push_back(paper(file, name, e));
    }
    for (const char* method : {"tolerance", "depth", "paper"})
      growths.push_back({{"mesh", name},
                         {"method", method},
                         {"power", growth(rows, name, method)},
                         {"power_of_ends", growth_of_ends(rows, name, method)}});
  }
  Json table = Json::array({{"mesh", "method", "setting [%]", "spheres", "at least", "s", "protrusion <= [%]",
                             "mean", "gap <= [%]", "mean", "normal error [deg]", "certified"}});
  Json all = Json::array();
  for (const Row& r : rows) {
    const Accuracy& a = r.accuracy;
    all.push_back(json_of(r));
    table.push_back({r.mesh, r.method, number(r.setting, "%g"), std::to_string(r.spheres),
                     r.fewest > 0 ? std::to_string(r.fewest) : "", number(r.seconds, "%.1f"),
                     number(a.protrusion_bound, "%.3f"), number(a.protrusion_mean, "%.3f"),
                     number(a.gap_bound, "%.3f"), number(a.gap_mean, "%.4f"),
                     number(a.normal_error_mean_deg, "%.1f"), a.certified ? "yes" : "no"});
  }
  for (const Json& g : growths)
    table.push_back({g["mesh"], g["method"], "count ~ error^-" + number(g["power"].get<double>(), "%.2f"),
                     "ends alone: " + number(g["power_of_ends"].get<double>(), "%.3f"), "", "", "", "", "",
                     "", "", ""});
  return {
      {"bench", "frontier"}, {"machine", machine()}, {"rows", all}, {"growth", growths}, {"table", table}};
}

}  // namespace padder::bench
