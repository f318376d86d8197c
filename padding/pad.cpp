// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/pad.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "padding/asset/error.h"
#include "padding/by_depth/refit.h"
#include "padding/verify/accuracy.h"

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
  if (options.edge_length.given()) return options.edge_length.of(diagonal) / diagonal;
  constexpr double cap = 1.0 / 400;  // an equilateral triangle of edge L has the circumradius L / sqrt(3)
  return std::clamp(std::numbers::sqrt3 * cap / options.depth_used(), 0.002, 0.05);
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
  Mesh mesh;  // that has these triangles; left empty where it is the repaired one
};

Made by_depth(const PadOptions& options, double length, const Repaired& body, const Surface& surface,
              PadReport& report, const std::function<void(const char*, int)>& step, Clock& clock) {
  step("remesh", 1);
  RemeshOptions remeshing;
  remeshing.edge_length = length;
  remeshing.sharp_angle = body.kind == BodyKind::wrap ? 180 : options.sharp_angle;
  Remeshed remeshed = remesh(body.mesh, remeshing);
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
  made.mesh = std::move(remeshed.mesh);
  report.seconds.refit = clock.lap();
  return made;
}

void keep(Made& made, const std::vector<std::uint32_t>& kept) {
  Made fewer;
  fewer.mesh = std::move(made.mesh);
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

// What every step works on, in the own frame.
struct Job {
  const PadOptions& options;
  const Mesh& input;
  const Repaired& body;
  const Surface& surface;
  const Frame& frame;
  double length;  // of edges; 0: nothing is remeshed
  PadReport& report;
  const std::function<void(const char*, int)>& step;
  Clock& clock;
};

// The spheres of one rung, with the surface they are counted on; `why` says what kept them from the
// tolerance, if anything did.
Made make(const Job& job, const Length& tolerance, std::string& why) {
  const PadOptions& options = job.options;
  const double asked = tolerance.of(job.frame.scale) / job.frame.scale;
  Made made;
  if (job.length > 0) {
    made = by_depth(options, job.length, job.body, job.surface, job.report, job.step, job.clock);
    job.step("cull", 4);
    if (asked > 0) keep(made, thin_balls(job.surface, made.balls, asked, options.effort));
    why = "the spheres of the depth ratio stand out farther, or leave more open";
  } else {
    job.step("cull", 4);
    CullOptions culling = cull_options(options, tolerance, job.frame.scale);
    // Nothing lies below a sheet, so nothing else bounds its balls, which sag and reach past its border.
    if (job.body.kind == BodyKind::sheet) culling.max_radius = std::min(culling.max_radius, 0.05);
    const Culled culled = cull(job.surface, culling);
    made.balls = culled.balls;
    made.triangle.assign(culled.triangle.begin(), culled.triangle.end());
    if (!culled.within)
      why = "so few spheres cannot keep it";
    else if (!culled.covered)
      why = "the limits of the radius leave some of the surface open";
  }
  job.report.seconds.cull += job.clock.lap();
  return made;
}

std::string count_of(std::size_t n, const std::string& one) {
  return std::to_string(n) + " " + one + (n == 1 ? "" : "s");
}

// Why the proof is none against the input; empty when it is one.
std::string unproved(const Job& job, const Measured& m, std::size_t spheres) {
  switch (m.accuracy.proved_against) {
    case SurfaceKind::none:
      return "the surface is open and has no inside, so that the protrusion is sampled";
    case SurfaceKind::wrap:
      return "the input bounds no body, so that the proof is against the wrap around it";
    case SurfaceKind::filled: {
      char area[40];
      std::snprintf(area, sizeof area, "%.3g", job.report.filled_area);
      return count_of(job.body.filled, "hole") + " of the input " + (job.body.filled == 1 ? "was" : "were") +
             " filled (area " + area + "), so that the proof is against the input with the patches";
    }
    default:
      break;
  }
  if (m.outside == 0) return "";
  return std::to_string(m.outside) + " of " + count_of(spheres, "sphere") +
         " have their centres outside of the body, whose triangles face inward there";
}

// Measures a rung and judges it by what was asked. `why` as make() left it.
Accuracy judge(const Job& job, const std::vector<Ball>& balls, double asked, std::string why,
               double& volume_union) {
  job.step("accuracy", 5);
  Measured m = measure(job.input, job.body, job.surface, balls, {.floor = asked});
  Accuracy& a = m.accuracy;
  // But for the last digits, which scaling costs.
  const double most = asked > 0 ? asked * (1 + 1e-9) : std::numeric_limits<double>::infinity();
  const bool within = a.protrusion_max <= most && a.gap_max <= most;
  std::string reason = unproved(job, m, balls.size());
  a.certified = within && reason.empty();
  if (!within) {
    if (why.empty() && a.proved_against == SurfaceKind::wrap)
      why = "a wrap keeps away from slots and creases of the input";
    if (why.empty() && a.proved_against == SurfaceKind::none)
      why = "spheres reach around the border of the sheet";
    char text[80];
    std::snprintf(text, sizeof text, "the tolerance of %.4g is not kept", asked * job.frame.scale);
    reason += (reason.empty() ? "" : "; ") + std::string(text) + (why.empty() ? "" : ", because " + why);
  }
  PadReport& report = job.report;
  report.within = report.within && within;
  if (report.reason.empty()) report.reason = reason;
  report.buried = m.buried;
  scale_back(a, job.frame.scale);
  volume_union = m.volume_union * std::pow(job.frame.scale, 3);
  job.report.seconds.accuracy += job.clock.lap();
  return a;
}

template <class T>
void store(const Made& made, const Frame& frame, T& into) {
  for (std::size_t k = 0; k < made.balls.size(); k++) {
    into.centers.push_back(frame.back(made.balls[k].center));
    into.radii.push_back(made.balls[k].radius * frame.scale);
    into.triangle.push_back(made.triangle[k]);
  }
}

// Of the repaired body: a sheet has none, nor has what faces inward on the whole.
void set_mass(Cluster& c, const Repaired& body, const Frame& frame, PadReport& report) {
  if (body.kind == BodyKind::sheet) return;
  const MassProperties mass = mass_properties(body.mesh);
  if (!(mass.volume > 0)) {
    report.warnings.push_back(c.source.file +
                              ": the triangles face inward on the whole, so that there is no inside to fill "
                              "and no mass: leave out --repair never");
    return;
  }
  c.mass = scale_back(mass, frame);
  c.mass_of = body.kind == BodyKind::wrap ? SurfaceKind::wrap
              : body.filled > 0           ? SurfaceKind::filled
                                          : SurfaceKind::input;
}

Frame frame_of(const Box& box, const std::string& name) {
  const Frame frame{box.center(), box.diagonal()};
  if (!(frame.scale > 0)) throw Error(name + ": all its points are one, so there is no surface to pad");
  // Moments of inertia go with the fifth power of the length: they must not overflow, nor vanish.
  if (!(frame.scale < 1e60 && frame.scale > 1e-60) || !frame.center.allFinite())
    throw Error(name +
                ": its size is beyond what double precision can measure: scale it (--scale) to below 1e60");
  return frame;
}

// Coarsest first; the last rung is the cluster itself.
std::vector<Length> rungs_of(const PadOptions& options, double diagonal) {
  std::vector<Length> rungs = options.lod;
  if (rungs.empty()) rungs.push_back(options.tolerance);
  std::sort(rungs.begin(), rungs.end(),
            [&](const Length& a, const Length& b) { return a.of(diagonal) > b.of(diagonal); });
  return rungs;
}

RepairOptions repairing(const PadOptions& options, double length, double tolerance, double diagonal) {
  RepairOptions r;
  r.mode = options.repair;
  // What the wrap is to be finer than: the cap of a triangle with that edge, or the tolerance.
  r.accuracy = length > 0 ? options.depth_used() * length / std::numbers::sqrt3 : tolerance;
  if (options.reach.given()) {
    r.mode = RepairMode::wrap;
    r.alpha = options.reach.of(diagonal) / diagonal;
  }
  return r;
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
  const Frame frame = frame_of(box, name);
  check_meant(options, box, name);
  report.triangles_in = file.mesh.triangles.size();
  report.diagonal = frame.scale;
  Mesh input = file.mesh;
  for (Point& p : input.points) p = frame.into(p);
  const std::vector<Length> rungs = rungs_of(options, frame.scale);
  const double tolerance = rungs.back().of(frame.scale) / frame.scale;
  report.tolerance = tolerance * frame.scale;
  const bool depth_mode = !options.by_tolerance() || options.depth;
  const double length = depth_mode ? edge_length(options, frame.scale) : 0;

  step("repair", 0);
  const Repaired body = repair(input, repairing(options, length, tolerance, frame.scale), name);
  report.kind = body.kind;
  report.filled = body.filled, report.filled_area = body.filled_area * frame.scale * frame.scale;
  report.seconds.repair = clock.lap();

  const Surface surface(body.mesh, body.side());
  const Job job{options, input, body, surface, frame, length, report, step, clock};
  Cluster& c = out.cluster;
  for (std::size_t rung = 0; rung < rungs.size(); rung++) {
    const double asked = rungs[rung].of(frame.scale) / frame.scale;
    std::string why;
    Made made = make(job, rungs[rung], why);
    if (rung + 1 < rungs.size()) {
      Lod& lod = c.lods.emplace_back();
      lod.tolerance = asked * frame.scale;
      lod.accuracy = judge(job, made.balls, asked, why, lod.volume_union);
      store(made, frame, lod);
    } else {
      c.accuracy = judge(job, made.balls, asked, why, c.volume_union);
      store(made, frame, c);
      const auto largest = std::max_element(made.balls.begin(), made.balls.end(),
                                            [](const Ball& a, const Ball& b) { return a.radius < b.radius; });
      if (largest != made.balls.end()) report.grid_entries = grid_entries(made.balls, 2 * largest->radius);
      out.mesh = depth_mode ? std::move(made.mesh) : body.mesh;
    }
  }
  for (Point& p : out.mesh.points) p = frame.back(p);

  c.name = std::filesystem::path(name).stem().string();
  c.unit = file.unit;
  c.program = "padder " PADDER_VERSION;
  c.source = file.source;
  c.source.repair = body.report;
  c.settings = settings_json(options, report.diagonal, report.edge_length);
  c.family = options.family, c.mask = options.mask;
  c.bounds = box;
  set_mass(c, body, frame, report);
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
