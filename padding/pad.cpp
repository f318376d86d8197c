// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/pad.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

#include "padding/asset/error.h"
#include "padding/asset/excerpt.h"
#include "padding/by_tolerance/lower_bound.h"
#include "padding/pad_steps.h"
#include "padding/verify/accuracy.h"

namespace padder {
namespace {

// The largest errors that are asked for, in the unit frame; both 0: none.
struct Asked {
  double protrusion = 0, gap = 0;
  bool filled = false;  // a gap of 0, with which the inside of the body is covered, too

  Asked(const PadOptions& options, const Length& tolerance, double diagonal) {
    protrusion = options.protrusion.value_or(tolerance).in_unit_frame(diagonal);
    gap = options.gap.value_or(tolerance).in_unit_frame(diagonal);
    filled = options.each_error() && !(gap > 0);
  }
  bool kept_by(const Accuracy& a) const {
    const double rounding = kKeptBack * (protrusion + gap);
    return !(protrusion + gap > 0) ||
           (a.protrusion_max <= protrusion + rounding && a.gap_max <= gap + rounding);
  }
};

// "the wrap closes 12 slots wider than twice the tolerance, the widest 3.1 at (1, 2, 3): a smaller …"
std::string slots_text(const PadJob& job) {
  const std::vector<ClosedSlot>& slots = job.report.slots;
  const ClosedSlot& widest = slots.front();
  return "the wrap closes " + counted(slots.size(), "slot") + " wider than twice the tolerance, the widest " +
         short_number(widest.width, 3) + " at " + place_text(widest.place) + ": " +
         (job.options.min_grain_radius.given() ? "a smaller --reach opens them"
                                               : "--repair auto, or a larger tolerance, may help");
}

// A wrap lies outside of the input, so that no sphere can be proved to stay inside of the input.
std::string standoff_text(const PadJob& job, double standoff) {
  return "the wrap stands off the input by up to " + short_number(standoff * job.frame.scale(), 3) +
         ": use a --protrusion above 0, or " +
         (job.options.min_grain_radius.given() ? "leave out --reach" : "--repair auto");
}

// Why the figures are no proof against the input; empty when they are.
std::string unproved(const Measured& m, std::size_t spheres) {
  if (m.accuracy.proved_against == SurfaceKind::none)
    return "the surface is open and has no inside, so that the protrusion is sampled";
  if (m.outside == 0) return "";
  return std::to_string(m.outside) + " of " + counted(spheres, "sphere") +
         " have their centres outside of the body, whose triangles face inward there";
}

// Measures the spheres of one level of detail, as they will be written, and compares them with the tolerance
// asked for.
Accuracy measure_spheres(const PadJob& job, const RungSpheres& made, const Asked& asked,
                         double& volume_union) {
  job.step("accuracy", 5);
  std::string why = made.why;
  std::vector<Ball> balls = made.balls;
  double moved = 0;
  for (Ball& b : balls) {
    const Point there = job.frame.written(b.center);
    moved = std::max(moved, (there - b.center).norm()), b.center = there;
  }
  Measured m = measure(job.input, job.body, job.surface, balls,
                       {.floor = asked.gap, .chord_error = job.chord_error()});
  Accuracy& a = m.accuracy;
  PadReport& report = job.report;
  const bool hollow = asked.filled && !report.filled_body && job.body.kind != BodyKind::sheet;
  const bool within_tolerance = asked.kept_by(a) && !hollow;
  if (hollow && why.empty())
    why = std::string("the inside of the body could not be proved to be covered") +
          (job.options.repair == RepairMode::wrap ? ": --repair auto may help" : "");
  std::string reason = unproved(m, balls.size());
  a.certified = within_tolerance && reason.empty();
  if (!within_tolerance) {
    if (!report.slots.empty()) why = slots_text(job);
    if (a.wrap_distance > 0 && !(asked.protrusion > 0)) why = standoff_text(job, a.wrap_distance);
    if (moved > 0.1 * std::max(asked.protrusion, asked.gap) && why.empty())
      why = "so far from the origin doubles are too coarse to write the spheres down: move the mesh";
    if (why.empty() && m.flat_gap > asked.gap)
      why = "triangles without area lie apart from the surface: remove them";
    if (why.empty() && a.proved_against == SurfaceKind::none)
      why = "spheres reach around the border of the sheet";
    const auto length = [&](double share) { return short_number(share * job.frame.scale(), 4); };
    const std::string what = asked.protrusion == asked.gap ? "the tolerance of " + length(asked.gap)
                                                           : "the protrusion of " + length(asked.protrusion) +
                                                                 " or the gap of " + length(asked.gap);
    reason += (reason.empty() ? "" : "; ") + what + " is not kept" + (why.empty() ? "" : ", because " + why);
  }
  report.within = report.within && within_tolerance;
  if (report.reason.empty()) report.reason = reason;
  volume_union = job.frame.back_volume(m.volume_union);
  report.seconds.accuracy += job.clock.lap();
  return job.frame.back(a);
}

// A cluster without spheres is no answer.
[[noreturn]] void refuse_nothing(const PadOptions& options, const std::string& name, WhyOpen why) {
  if (options.by_depth())
    throw Error(name +
                ": it is so thin that no triangle is as high as a fiftieth of the edge length: use a "
                "shorter --edge-length, or --tolerance");
  if (why == WhyOpen::no_inside)
    throw Error(
        name +
        ": no sphere lies inside of it: use a --protrusion above 0, or --repair fill where holes are open");
  const bool small = options.max_radius.given(), large = options.min_radius.given();
  throw Error(name + ": no sphere is as " +
              (small && large ? "large and as small as --min-radius and --max-radius ask"
               : small        ? "small as --max-radius asks"
                              : "large as --min-radius asks") +
              " for");
}

// T: Cluster or Lod.
template <class T>
void store(const PadJob& job, const RungSpheres& made, const Asked& asked, T& into) {
  into.accuracy = measure_spheres(job, made, asked, into.volume_union);
  for (const Ball& ball : made.balls) {
    into.centers.push_back(job.frame.back(ball.center));
    into.radii.push_back(ball.radius * job.frame.scale());
  }
  into.triangle = made.triangle;
}

// The expected number of entries in a uniform grid with cells as wide as the largest ball, when each ball at
// a random position is entered in every cell that its box touches.
double grid_entries(const std::vector<Ball>& balls) {
  double largest = 0, entries = 0;
  for (const Ball& ball : balls) largest = std::max(largest, ball.radius);
  for (const Ball& ball : balls) entries += std::pow(1 + ball.radius / largest, 3);
  return entries;
}

// A planner that asks for a gap of 0 may take a solid with holes for covered, and a sheet with its thickness.
void warn_of_sheet(const Repaired& body, const std::string& name, PadReport& report) {
  const bool alone = body.kind == BodyKind::sheet;
  // Of a solid, what is folded over may be a sheet, too: all of it is covered, unless it is thick.
  const bool beside = body.sheet > 0 && (body.thickness > 0 || body.steps.sheet_pieces > 0);
  if (!alone && !beside) return;
  report.filled_body = false;
  report.warnings.push_back(
      name +
      (alone ? ": an open sheet has no inside, so that a gap of 0 covers its triangles alone"
             : ": some of its surface is a sheet, which has no inside, so that a gap of 0 covers the "
               "triangles of the sheet alone") +
      (body.thickness > 0 ? ", and not its thickness" : "") +
      ": if it is a solid with holes, use --repair fill");
}

void add_warnings(const PadOptions& options, const Asked& asked, const Repaired& body, const Cluster& c,
                  PadReport& report) {
  const double error = c.accuracy.normal_error_mean_deg;
  if (options.smooth > 0 && error > options.smooth)
    report.warnings.push_back(c.source.file + ": the normals are off by " + short_number(error, 3) +
                              " degrees in the mean, and --smooth asks for " +
                              short_number(options.smooth, 3) + ": use a smaller tolerance or more spheres");
  if (options.thickness.given() && body.kind != BodyKind::sheet && body.sheet == 0)
    report.warnings.push_back(c.source.file +
                              ": it has no sheet, so that a thickness has no effect: leave it out");
  if (asked.filled) warn_of_sheet(body, c.source.file, report);
  constexpr double much = 0.1;
  if (const double sheet = body.steps.sheet_area / body.mesh.area(); c.mass.volume > 0 && sheet > much)
    report.warnings.push_back(c.source.file + ": volume and mass are those of a part of it, as " +
                              short_number(100 * sheet, 3) + " % of its surface is a sheet" +
                              (options.repair == RepairMode::fill
                                   ? ": set the mass by hand"
                                   : ": use --repair fill, if it is a solid with holes"));
}

// The mass of the repaired body. A sheet has none, nor has a surface that faces inward on the whole.
void set_mass(Cluster& c, const Repaired& body, const UnitFrame& frame, PadReport& report) {
  if (body.kind == BodyKind::sheet) return;
  const MassProperties mass = mass_properties(body.boundary());
  if (!(mass.volume > 0)) {
    report.warnings.push_back(c.source.file +
                              ": the triangles face inward on the whole, so that there is no inside to fill "
                              "and no mass: leave out --repair never");
    return;
  }
  c.mass = frame.back(mass);
  c.mass_of = body.kind == BodyKind::wrap ? SurfaceKind::wrap
              : body.filled > 0           ? SurfaceKind::filled
                                          : SurfaceKind::input;
}

// The tolerances of all levels of detail, the coarsest first. The last one is that of the cluster itself.
std::vector<Length> rungs_of(const PadOptions& options, double diagonal) {
  std::vector<Length> rungs = options.lod;
  if (rungs.empty()) rungs.push_back(options.tolerance);
  std::sort(rungs.begin(), rungs.end(),
            [&](const Length& a, const Length& b) { return a.absolute(diagonal) > b.absolute(diagonal); });
  return rungs;
}

// The input with the wrap as its hull: covers and proofs are of the input's own triangles, and the wrap says
// what is inside. What a grain cannot touch is left out where one was given; otherwise all of it is covered.
Surface surface_in_wrap(const Mesh& input, Repaired& wrap, bool by_grain, PadReport& report) {
  Surface triangles(input);
  const auto hull = std::make_shared<const Surface>(wrap.mesh, wrap.side(), wrap.standoff);
  if (by_grain) {
    Touchable kept = touchable(input, *hull, 2 * wrap.offset, 0.5 * wrap.alpha);
    const double area = input.area();
    report.buried = area > 0 ? kept.buried.area() / area : 0;
    triangles = Surface(kept.mesh);
    if (!kept.buried.triangles.empty()) wrap.marks.push_back({MarkKind::buried, std::move(kept.buried)});
  }
  return {std::move(triangles), hull};
}

RepairOptions repairing(const PadOptions& options, double length, double tolerance, double diagonal) {
  RepairOptions r;
  r.mode = options.repair;
  // Joining moves the surface, which is taken off both errors; one of 0 falls below 0.
  if (options.each_error()) {
    const auto [small, large] = std::minmax(
        {options.protrusion_used().in_unit_frame(diagonal), options.gap_used().in_unit_frame(diagonal)});
    r.join_width = 0.25 * (small > 0 ? small : large);
  }
  // One sphere for each triangle needs room below it.
  r.below_terrain = length > 0;
  r.thickness = options.thickness.in_unit_frame(diagonal);
  // The wrap must be finer than the cap over a triangle with that edge, or than the tolerance.
  r.accuracy = length > 0 ? options.depth_ratio_used() * length / std::numbers::sqrt3 : tolerance;
  r.tolerance = tolerance;
  // What a fold buries is too near to the surface to take much room from the balls. A remesh needs the cells.
  r.fold_size = length > 0 ? 0 : tolerance;
  if (options.min_grain_radius.given()) {
    r.mode = RepairMode::wrap, r.tolerance = 0;
    r.alpha = options.min_grain_radius.in_unit_frame(diagonal);
  }
  return r;
}

Mark mark_of(MarkKind kind, const Mesh& mesh, const std::vector<std::uint32_t>& triangles) {
  Mark mark{kind, {}};
  for (const std::uint32_t t : triangles) mark.mesh.add(mesh.corners(t));
  return mark;
}

// In the input's frame and unit: what repair did to the surface, as a list and to be shown.
void show_repair(Repaired& body, double area, const UnitFrame& frame, Padded& out) {
  PadReport& report = out.report;
  const double scale = frame.scale();
  report.kind = body.kind;
  report.filled = body.filled, report.filled_area = body.filled_area * scale * scale;
  if (area > 0) report.buried = std::max(report.buried, body.steps.buried_area / area);
  report.steps = body.steps;
  report.steps.crack_width *= scale, report.steps.joined_width *= scale;
  report.steps.buried_area *= scale * scale, report.steps.sheet_area *= scale * scale;
  out.marks = std::move(body.marks);
  for (const Patch& patch : body.patches) {
    report.patches.push_back({patch.area * scale * scale, patch.rim * scale, frame.back(patch.place), {}});
    out.marks.push_back(mark_of(MarkKind::patch, body.mesh, patch.triangles));
  }
  for (ClosedSlot& slot : report.slots) {
    slot.width *= scale, slot.area *= scale * scale, slot.place = frame.back(slot.place);
    out.marks.push_back(mark_of(MarkKind::slot, body.mesh, slot.triangles));
  }
  if (body.kind == BodyKind::solid && body.sheet > 0) {
    std::vector<std::uint32_t> sheet(body.sheet);
    std::iota(sheet.begin(), sheet.end(),
              static_cast<std::uint32_t>(body.mesh.triangles.size() - body.sheet));
    out.marks.push_back(mark_of(MarkKind::sheet, body.mesh, sheet));
  }
  for (Mark& mark : out.marks)
    for (Point& p : mark.mesh.points) p = frame.back(p);
}

// Leaves out triangles with two corners at one point: lines and points. They bound and join nothing, and may
// lie far from the part, as the zeros that some exporters write. If there is nothing else, all are kept.
Mesh without_lines(const Mesh& mesh) {
  const auto is_line = [&mesh](const std::array<std::uint32_t, 3>& t) {
    const Point &a = mesh.points[t[0]], &b = mesh.points[t[1]], &c = mesh.points[t[2]];
    return a == b || b == c || c == a;
  };
  Mesh kept = mesh;
  std::erase_if(kept.triangles, is_line);
  return kept.triangles.empty() ? mesh : kept;
}

std::string repair_text(const std::string& repair, std::size_t lines) {
  if (lines == 0) return repair;
  return "dropped " + counted(lines, "triangle") + " with two corners at one point" +
         (repair == "none needed" ? "" : "; " + repair);
}

// Repairs, and says on what surface the balls are made. CGAL may fill a wrap beyond alpha, to keep it
// manifold: another alpha mends that.
Surface repaired_surface(const Mesh& input, RepairOptions options, const std::string& name, double tolerance,
                         Repaired& body, PadReport& report) {
  const bool by_grain = options.alpha > 0;
  constexpr int tries = 3;
  for (int k = 0; k < tries; k++, options.tolerance *= 0.9) {
    body = repair(input, options, name);
    if (body.ready) return *std::exchange(body.ready, std::nullopt);
    if (body.kind != BodyKind::wrap) return body.surface();
    body.standoff = standoffs(body.mesh, Surface(input), 0.03 * (body.alpha + body.offset));
    if (tolerance > 0) report.slots = closed_slots(body.mesh, body.standoff, tolerance);
    if (report.slots.empty() || by_grain || body.alpha + body.offset > tolerance) break;
  }
  return surface_in_wrap(input, body, by_grain, report);
}

// Refuses a thickness where spheres lie below the normals of a sheet and know of none, and a body without
// volume for a program that wants its mass.
void check_fits(const PadOptions& options, const Surface& surface, const Repaired& body,
                const std::string& name) {
  if (options.thickness.given() && !surface.closed())
    throw Error(
        name +
        ": a thickness has no effect on an open sheet that is padded below its normals: leave it out, or " +
        (options.by_depth() ? "ask for a tolerance or a count, without a depth ratio"
                            : "leave out --repair never"));
  const bool sheet = body.kind == BodyKind::sheet;
  if (!options.volume_for.empty() && (sheet || !(mass_properties(body.boundary()).volume > 0)))
    throw Error(name + ": it has no volume (" +
                (sheet ? "an open sheet" : "its triangles face inward on the whole") + "), and " +
                options.volume_for + " wants mass and moments: close the mesh, or pad it with --repair wrap");
}

}  // namespace

Padded pad(const ReadResult& file, const PadOptions& options, const PadProgress& progress) {
  check(options);
  Mesh input = without_lines(file.mesh);
  Padded out;
  PadReport& report = out.report;
  const std::string& name = file.source.file;
  const std::function<void(const char*, int)> step = [&](const char* what, int done) {
    if (progress) progress(what, 100 * done, 600);
  };
  StepClock clock;
  const Box box = input.bounds();
  const UnitFrame frame(box, name);
  check_meant(options, box, name);
  report.triangles_in = file.mesh.triangles.size(), report.diagonal = frame.scale();
  for (Point& p : input.points) p = frame.into(p);
  const std::vector<Length> rungs = rungs_of(options, frame.scale());
  report.tolerance = rungs.back().absolute(frame.scale());
  const Asked finest(options, rungs.back(), frame.scale());
  // A wrap may stand off the input by no more than the spheres.
  const double tolerance = finest.protrusion > 0 ? finest.protrusion : finest.gap;
  const bool depth_mode = options.by_depth();
  const double length = depth_mode ? edge_length_by_depth(options, frame.scale()) : 0;

  step("repair", 0);
  Repaired body;
  const Surface surface = repaired_surface(input, repairing(options, length, tolerance, frame.scale()), name,
                                           tolerance, body, report);
  check_fits(options, surface, body, name);
  show_repair(body, input.area(), frame, out);
  report.seconds.repair = clock.lap();

  TellShare within_cull;
  if (progress) within_cull = [&](double share) { progress("cull", 400 + int(100 * share), 600); };
  const PadJob job{options, file, input, body, surface, frame, length, report, step, within_cull, clock};
  Cluster& c = out.cluster;
  for (std::size_t rung = 0; rung < rungs.size(); rung++) {
    const Asked asked(options, rungs[rung], frame.scale());
    RungSpheres made =
        depth_mode ? spheres_by_depth(job, rungs[rung]) : spheres_by_tolerance(job, rungs[rung]);
    if (made.balls.empty()) refuse_nothing(options, name, made.open);
    if (rung + 1 < rungs.size()) {
      Lod& lod = c.lods.emplace_back();
      lod.tolerance = rungs[rung].absolute(frame.scale());
      store(job, made, asked, lod);
    } else {
      store(job, made, asked, c);
      report.grid_entries = grid_entries(made.balls);
      out.mesh = depth_mode ? std::move(made.mesh) : surface.mesh();
    }
  }
  for (Point& p : out.mesh.points) p = frame.back(p);
  if (options.lower_bound) {
    LowerBoundOptions bounding;
    const Accuracy& kept = c.accuracy;
    const bool asked = finest.protrusion + finest.gap > 0;
    bounding.protrusion = asked ? finest.protrusion : kept.protrusion_bound / frame.scale();
    bounding.gap = asked ? finest.gap : kept.gap_bound / frame.scale();
    if (options.max_radius.given()) bounding.max_radius = options.max_radius.in_unit_frame(frame.scale());
    clock.lap();
    report.fewest = fewest_balls(surface, bounding);
    report.seconds.lower_bound = clock.lap();
  }

  c.name = std::filesystem::path(name).stem().string();
  c.unit = file.unit, c.program = "padder " PADDER_VERSION;
  c.source = file.source;
  c.source.repair = repair_text(body.report, file.mesh.triangles.size() - input.triangles.size());
  c.settings = settings_json(options, report.diagonal, report.edge_length);
  c.family = options.family, c.mask = options.mask;
  c.bounds = box;
  set_mass(c, body, frame, report);
  add_warnings(options, finest, body, c, report);
  step("done", 6);
  return out;
}

Padded pad_file(const std::filesystem::path& path, const ReadOptions& reading, const PadOptions& options,
                const PadProgress& progress) {
  StepClock clock;
  const ReadResult file = read_mesh(path, reading);
  const double seconds = clock.lap();
  try {
    Padded out = pad(file, options, progress);
    out.report.seconds.read = seconds, out.report.notes = file.notes;
    return out;
  } catch (const Error& e) {  // of a batch, which mesh?
    const std::string what = e.what(), name = path.string(), own = path.filename().string() + ": ";
    if (what.starts_with(name)) throw;
    throw Error(name + ": " + (what.starts_with(own) ? what.substr(own.size()) : what));
  }
}

}  // namespace padder
