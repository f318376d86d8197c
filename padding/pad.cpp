#include "padding/pad.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "padding/accuracy.h"
#include "padding/error.h"
#include "padding/refit.h"

namespace padder {
namespace {

class Clock {
 public:
  double lap() {  // seconds since the last lap
    const auto now = std::chrono::steady_clock::now();
    const double s = std::chrono::duration<double>(now - last_).count();
    last_ = now;
    return s;
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

// Own frame: centred, diagonal 1.
struct Frame {
  Point center;
  double scale;  // length of the mesh's diagonal

  Point into(const Point& p) const {
    constexpr double grid = 68719476736.0;  // 2^36
    return ((p - center) / scale * grid).array().round().matrix() / grid;
  }
  Point back(const Point& p) const { return p * scale + center; }
};

// In the own frame.
double edge_length(const PadOptions& options, double diagonal) {
  if (options.edge_length.value < 0) throw Error("the edge length must be positive");
  if (options.edge_length.given()) return options.edge_length.of(diagonal) / diagonal;
  constexpr double cap = 1.0 / 400;  // an equilateral triangle of edge L has the circumradius L / sqrt(3)
  return std::clamp(std::numbers::sqrt3 * cap / options.depth_used(), 0.002, 0.05);
}

const char* name_of(RepairMode mode) {
  switch (mode) {
    case RepairMode::never:
      return "never";
    case RepairMode::wrap:
      return "wrap";
    default:
      return "auto";
  }
}

const char* name_of(Balance balance) {
  switch (balance) {
    case Balance::volume:
      return "volume";
    case Balance::mean:
      return "mean";
    default:
      return "none";
  }
}

// Lengths in the mesh's unit, as they were used.
std::string settings_json(const PadOptions& options, const PadReport& report) {
  nlohmann::ordered_json j;
  const auto length = [&](const char* name, const Length& l) {
    if (l.given()) j[name] = l.of(report.diagonal);
  };
  if (!options.by_tolerance() || options.depth) {
    j["depth"] = options.depth_used();
    j["edge_length"] = report.edge_length;
    j["sharp_angle"] = options.sharp_angle;
  }
  length("tolerance", options.tolerance);
  if (options.max_spheres > 0) j["max_spheres"] = options.max_spheres;
  length("min_radius", options.min_radius);
  length("max_radius", options.max_radius);
  if (options.by_tolerance()) {
    j["balance"] = name_of(options.balance);
    j["effort"] = options.effort;
  }
  if (options.smooth > 0) j["smooth"] = options.smooth;
  for (const Length& l : options.lod) j["lod"].push_back(l.of(report.diagonal));
  length("reach", options.reach);
  j["repair"] = name_of(options.repair);
  return j.dump();
}

void scale_back(Accuracy& a, double s) {
  for (double* length : {&a.protrusion_max, &a.protrusion_mean, &a.protrusion_p95, &a.gap_max, &a.gap_mean,
                         &a.gap_p95, &a.protrusion_bound, &a.gap_bound, &a.wrap_distance})
    *length *= s;
}

MassProperties scale_back(MassProperties m, const Frame& frame) {
  m.volume *= std::pow(frame.scale, 3);
  m.center = frame.back(m.center);
  m.inertia *= std::pow(frame.scale, 5);
  m.moments *= std::pow(frame.scale, 5);
  return m;
}

// Spheres in the own frame, and where they came from.
struct Made {
  std::vector<Ball> balls;
  std::vector<std::int64_t> triangle;
};

Made by_depth(const PadOptions& options, double length, const Repaired& body, const Surface& surface,
              PadReport& report, const std::function<void(const char*, int)>& step, Clock& clock) {
  step("remesh", 1);
  RemeshOptions remeshing;
  remeshing.edge_length = length;
  remeshing.sharp_angle = body.kind == BodyKind::wrap ? 180 : options.sharp_angle;
  const Remeshed remeshed = remesh(body.mesh, remeshing);
  report.quality = remeshed.quality;
  report.quality.circumradius_max *= report.diagonal;
  report.triangles_remeshed = remeshed.mesh.triangles.size();
  report.edge_length = length * report.diagonal;
  report.seconds.remesh = clock.lap();

  step("fit", 2);
  std::vector<FittedBall> fitted = fit(remeshed.mesh, options.depth_used(), length);
  report.seconds.fit = clock.lap();

  step("refit", 3);
  fitted = refit(surface, remeshed.mesh, std::move(fitted), {.margin = body.offset, .gap = 0});
  Made made;
  for (const auto& f : fitted) made.balls.push_back(f.ball), made.triangle.push_back(f.triangle);
  report.seconds.refit = clock.lap();
  return made;
}

void keep(Made& made, const std::vector<std::uint32_t>& kept) {
  Made fewer;
  for (const auto k : kept) fewer.balls.push_back(made.balls[k]), fewer.triangle.push_back(made.triangle[k]);
  made = std::move(fewer);
}

CullOptions cull_options(const PadOptions& options, const Length& tolerance, double diagonal) {
  CullOptions c;
  c.tolerance = tolerance.of(diagonal) / diagonal;
  c.max_spheres = options.max_spheres;
  c.min_radius = options.min_radius.of(diagonal) / diagonal;
  if (options.max_radius.given()) c.max_radius = options.max_radius.of(diagonal) / diagonal;
  c.balance = options.balance, c.smooth = options.smooth, c.effort = options.effort;
  return c;
}

void check(const PadOptions& options) {
  const double depth = options.depth_used();
  if (!(depth > 0 && depth <= 1)) throw Error("the depth ratio must be above 0 and at most 1");
  for (const Length* l :
       {&options.edge_length, &options.tolerance, &options.min_radius, &options.max_radius, &options.reach})
    if (!(l->value >= 0) || !std::isfinite(l->value)) throw Error("a length must be positive and finite");
  for (const Length& l : options.lod)
    if (!(l.value > 0) || !std::isfinite(l.value))
      throw Error("each tolerance of a ladder must be positive and finite");
  if (!options.lod.empty() && (options.tolerance.given() || options.max_spheres > 0 || options.depth))
    throw Error("a ladder of tolerances stands alone: leave out the depth, the tolerance and the count");
  if (options.depth && options.max_spheres > 0)
    throw Error("a depth ratio and a count exclude each other: leave out one of them");
  if (options.depth && options.by_tolerance() && (options.balance != Balance::none || options.smooth > 0))
    throw Error("balance and smooth choose their own spheres: leave out the depth ratio");
}

}  // namespace

Padded pad(const ReadResult& file, const PadOptions& options, const PadProgress& progress) {
  check(options);
  Padded out;
  PadReport& report = out.report;
  const std::string& name = file.source.file;
  const std::function<void(const char*, int)> step = [&](const char* what, int done) {
    if (progress) progress(what, done, 6);
  };
  Clock clock;
  const Box box = file.mesh.bounds();
  const Frame frame{box.center(), box.diagonal()};
  report.triangles_in = file.mesh.triangles.size();
  report.diagonal = frame.scale;
  if (!(frame.scale > 0)) throw Error(name + ": all its points are one, so there is no surface to pad");
  // Moments of inertia go with the fifth power of the length: they must not overflow, nor vanish.
  if (!(frame.scale < 1e60 && frame.scale > 1e-60) || !frame.center.allFinite())
    throw Error(name +
                ": its size is beyond what double precision can measure: scale it (--scale) to below 1e60");
  Mesh input = file.mesh;
  for (Point& p : input.points) p = frame.into(p);
  // Coarsest first; the last rung is the cluster itself.
  std::vector<Length> rungs = options.lod;
  if (rungs.empty()) rungs.push_back(options.tolerance);
  std::sort(rungs.begin(), rungs.end(),
            [&](const Length& a, const Length& b) { return a.of(frame.scale) > b.of(frame.scale); });
  const double tolerance = rungs.back().of(frame.scale) / frame.scale;
  report.tolerance = tolerance * frame.scale;
  const bool depth_mode = !options.by_tolerance() || options.depth;
  const double length = depth_mode ? edge_length(options, frame.scale) : 0;

  step("repair", 0);
  RepairOptions repairing;
  repairing.mode = options.repair;
  // What the wrap is to be finer than: the cap of a triangle with that edge, or the tolerance.
  repairing.accuracy = depth_mode ? options.depth_used() * length / std::numbers::sqrt3 : tolerance;
  if (options.reach.given()) {
    repairing.mode = RepairMode::wrap;
    repairing.alpha = options.reach.of(frame.scale) / frame.scale;
  }
  const Repaired body = repair(input, repairing, name);
  report.kind = body.kind;
  report.seconds.repair = clock.lap();

  const Surface surface(body.mesh);
  const auto measured = [&](const std::vector<Ball>& balls, double asked, double& volume_union) {
    Measured m = measure(input, body, surface, balls, {.floor = asked});
    // Bounds are always proved; with a tolerance asked for they must keep it, too, but for the last digits.
    // Beyond the border of a sheet there is no side, so nothing is proved there.
    m.accuracy.certified =
        body.kind != BodyKind::sheet && (asked == 0 || (m.accuracy.protrusion_bound <= asked * (1 + 1e-9) &&
                                                        m.accuracy.gap_bound <= asked * (1 + 1e-9)));
    report.buried = m.buried;
    scale_back(m.accuracy, frame.scale);
    volume_union = m.volume_union * std::pow(frame.scale, 3);
    return m.accuracy;
  };
  const auto store = [&](const Made& made, auto& into) {
    for (std::size_t k = 0; k < made.balls.size(); k++) {
      into.centers.push_back(frame.back(made.balls[k].center));
      into.radii.push_back(made.balls[k].radius * frame.scale);
      into.triangle.push_back(made.triangle[k]);
    }
  };

  Cluster& c = out.cluster;
  for (std::size_t rung = 0; rung < rungs.size(); rung++) {
    const double asked = rungs[rung].of(frame.scale) / frame.scale;
    Made made;
    if (depth_mode) {
      made = by_depth(options, length, body, surface, report, step, clock);
      step("cull", 4);
      if (asked > 0) keep(made, thin_balls(surface, made.balls, asked, options.effort));
    } else {
      step("cull", 4);
      CullOptions culling = cull_options(options, rungs[rung], frame.scale);
      // Nothing lies below a sheet, so nothing else bounds its balls, which sag and reach past its border.
      if (body.kind == BodyKind::sheet) culling.max_radius = std::min(culling.max_radius, 0.05);
      const Culled culled = cull(surface, culling);
      made.balls = culled.balls;
      made.triangle.assign(culled.triangle.begin(), culled.triangle.end());
      report.within = report.within && culled.within && culled.proved;
    }
    report.seconds.cull += clock.lap();
    step("accuracy", 5);
    if (rung + 1 < rungs.size()) {
      Lod& lod = c.lods.emplace_back();
      lod.tolerance = asked * frame.scale;
      lod.accuracy = measured(made.balls, asked, lod.volume_union);
      store(made, lod);
    } else {
      c.accuracy = measured(made.balls, asked, c.volume_union);
      store(made, c);
      const auto largest = std::max_element(made.balls.begin(), made.balls.end(),
                                            [](const Ball& a, const Ball& b) { return a.radius < b.radius; });
      if (largest != made.balls.end()) report.grid_entries = grid_entries(made.balls, 2 * largest->radius);
    }
    report.seconds.accuracy += clock.lap();
  }

  c.name = std::filesystem::path(name).stem().string();
  c.unit = file.unit;
  c.program = "padder " PADDER_VERSION;
  c.source = file.source;
  c.source.repair = body.report;
  c.settings = settings_json(options, report);
  c.family = options.family, c.mask = options.mask;
  c.bounds = box;
  if (body.kind != BodyKind::sheet) c.mass = scale_back(mass_properties(body.mesh), frame);
  step("done", 6);
  return out;
}

Padded pad_file(const std::filesystem::path& path, const ReadOptions& reading, const PadOptions& options,
                const PadProgress& progress) {
  Clock clock;
  const ReadResult file = read_mesh(path, reading);
  const double seconds = clock.lap();
  Padded out = pad(file, options, progress);
  out.report.seconds.read = seconds;
  return out;
}

}  // namespace padder
