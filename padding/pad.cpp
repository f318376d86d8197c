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
  if (options.edge_length < 0 || options.edge_share < 0) throw Error("the edge length must be positive");
  if (options.edge_length > 0) return options.edge_length / diagonal;
  if (options.edge_share > 0) return options.edge_share;
  constexpr double cap = 1.0 / 400;  // an equilateral triangle of edge L has the circumradius L / sqrt(3)
  return std::clamp(std::numbers::sqrt3 * cap / options.depth, 0.002, 0.05);
}

const char* name_of(RepairMode mode) {
  switch (mode) {
    case RepairMode::never: return "never";
    case RepairMode::wrap: return "wrap";
    default: return "auto";
  }
}

std::string settings_json(const PadOptions& options, const PadReport& report) {
  nlohmann::ordered_json j;
  j["depth"] = options.depth;
  j["edge_length"] = report.edge_length;
  j["sharp_angle"] = options.sharp_angle;
  j["repair"] = name_of(options.repair);
  return j.dump();
}

void scale_back(Accuracy& a, double s) {
  for (double* length : {&a.protrusion_max, &a.protrusion_mean, &a.protrusion_p95, &a.gap_max, &a.gap_mean, &a.gap_p95})
    *length *= s;
}

MassProperties scale_back(MassProperties m, const Frame& frame) {
  m.volume *= std::pow(frame.scale, 3);
  m.center = frame.back(m.center);
  m.inertia *= std::pow(frame.scale, 5);
  m.moments *= std::pow(frame.scale, 5);
  return m;
}

}  // namespace

Padded pad(const ReadResult& file, const PadOptions& options, const PadProgress& progress) {
  Padded out;
  PadReport& report = out.report;
  const std::string& name = file.source.file;
  const auto step = [&](const char* what, int done) {
    if (progress) progress(what, done, 5);
  };
  Clock clock;
  const Box box = file.mesh.bounds();
  const Frame frame{box.center(), box.diagonal()};
  report.triangles_in = file.mesh.triangles.size();
  report.diagonal = frame.scale;
  if (!(frame.scale > 0)) throw Error(name + ": all its points are one, so there is no surface to pad");
  // Moments of inertia go with the fifth power of the length: they must not overflow, nor vanish.
  if (!(frame.scale < 1e60 && frame.scale > 1e-60) || !frame.center.allFinite())
    throw Error(name + ": its size is beyond what double precision can measure: scale it (--scale) to below 1e60");
  if (!(options.depth > 0 && options.depth <= 1)) throw Error("the depth ratio must be above 0 and at most 1");
  Mesh input = file.mesh;
  for (Point& p : input.points) p = frame.into(p);
  const double length = edge_length(options, frame.scale);
  report.edge_length = length * frame.scale;

  step("repair", 0);
  RepairOptions repairing;
  repairing.mode = options.repair;
  repairing.accuracy = options.depth * length / std::numbers::sqrt3;  // the cap of a triangle with that edge
  const Repaired body = repair(input, repairing, name);
  const Surface surface(body.mesh);
  report.kind = body.kind;
  report.seconds.repair = clock.lap();

  step("remesh", 1);
  RemeshOptions remeshing;
  remeshing.edge_length = length;
  remeshing.sharp_angle = body.kind == BodyKind::wrap ? 180 : options.sharp_angle;
  const Remeshed remeshed = remesh(body.mesh, remeshing);
  report.quality = remeshed.quality;
  report.quality.circumradius_max *= frame.scale;
  report.triangles_remeshed = remeshed.mesh.triangles.size();
  report.seconds.remesh = clock.lap();

  step("fit", 2);
  std::vector<FittedBall> fitted = fit(remeshed.mesh, options.depth, length);
  report.seconds.fit = clock.lap();

  step("refit", 3);
  fitted = refit(surface, remeshed.mesh, std::move(fitted), {.margin = body.offset, .gap = 0});
  report.seconds.refit = clock.lap();

  step("accuracy", 4);
  std::vector<Ball> balls;
  for (const auto& f : fitted) balls.push_back(f.ball);
  Measured measured = measure(input, body, surface, balls);
  report.buried = measured.buried;
  report.seconds.accuracy = clock.lap();

  Cluster& c = out.cluster;
  c.name = std::filesystem::path(name).stem().string();
  c.unit = file.unit;
  c.program = "padder " PADDER_VERSION;
  c.source = file.source;
  c.source.repair = body.report;
  c.settings = settings_json(options, report);
  c.family = options.family, c.mask = options.mask;
  c.bounds = box;
  if (body.kind != BodyKind::sheet) c.mass = scale_back(mass_properties(body.mesh), frame);
  c.volume_union = measured.volume_union * std::pow(frame.scale, 3);
  c.accuracy = measured.accuracy;
  scale_back(c.accuracy, frame.scale);
  for (const auto& f : fitted) {
    c.centers.push_back(frame.back(f.ball.center));
    c.radii.push_back(f.ball.radius * frame.scale);
    c.triangle.push_back(f.triangle);
  }
  step("done", 5);
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
