// SPDX-License-Identifier: GPL-3.0-or-later
// The fewest spheres for a tolerance or a count: what is asked of cull(), and what it could not do.
#include <algorithm>

#include "padding/asset/excerpt.h"
#include "padding/pad_steps.h"

namespace padder {
namespace {

// The surface that the spheres are made on may be some way from the body that the file describes. What closes
// a crack is as far from the input as the crack is wide, so the spheres may stand out by so much less. The
// chord error is taken off the gap. Far from the origin doubles are coarse: writing the spheres down may move
// them, and joining corners may move the surface. Both are taken off both errors.
CullOptions cull_options(const PadJob& job, const Length& tolerance) {
  const PadOptions& options = job.options;
  const double diagonal = job.frame.scale(), crack = job.body.steps.crack_width,
               chord_error = job.chord_error();
  CullOptions c;
  c.tolerance = tolerance.in_unit_frame(diagonal);
  c.max_spheres = options.max_spheres;
  c.min_radius = options.min_radius.in_unit_frame(diagonal);
  if (options.max_radius.given()) c.max_radius = options.max_radius.in_unit_frame(diagonal);
  if (options.each_error()) {
    c.only_protrusion = options.protrusion_used().in_unit_frame(diagonal);
    c.only_gap = options.gap_used().in_unit_frame(diagonal);
  } else if ((crack > 0 || chord_error > 0) && c.tolerance > 0) {
    if (c.max_spheres == 0 && options.balance == Balance::none && !(options.smooth > 0))
      c.only_protrusion = c.only_gap = c.tolerance;
    else
      c.tolerance = gap_left(c.tolerance, std::max(crack, chord_error));
  }
  if (c.only_protrusion) *c.only_protrusion -= crack;
  if (c.only_gap) *c.only_gap = gap_left(*c.only_gap, chord_error);
  c.keep_back(job.frame.coarseness() + job.body.steps.joined_width);
  c.balance = options.balance, c.smooth = options.smooth, c.effort = options.effort;
  c.tell = job.within_cull;
  // Below a sheet as given nothing bounds the balls: large ones would sag and stand out past its border.
  if (!job.surface.closed()) c.max_radius = std::min(c.max_radius, 0.05);
  return c;
}

// Why the spheres leave some of the surface open, and what to do.
std::string open_text(const PadJob& job, const OpenSpot& open) {
  const std::string place = place_text(job.frame.back(open.at));
  if (open.why == WhyOpen::min_radius)
    return "no sphere as large as --min-radius was found that covers the surface at " + place +
           ": use a smaller one";
  if (open.why == WhyOpen::unfinished)
    return "the search ended before it had covered the surface at " + place + ": use a larger tolerance";
  const std::size_t solid = job.body.mesh.triangles.size() - job.body.sheet;
  if (job.surface.nearest(open.at).triangle >= solid)
    return "the surface at " + place +
           " is a sheet, which has no inside: use a --protrusion above 0, or a --thickness";
  return "no sphere inside of the body was found that comes near enough to the surface at " + place +
         ": use a --protrusion above 0";
}

}  // namespace

RungSpheres spheres_by_tolerance(const PadJob& job, const Length& tolerance) {
  job.step("cull", 4);
  Culled culled = cull(job.surface, cull_options(job, tolerance));
  RungSpheres made;
  made.balls = std::move(culled.balls);
  made.triangle.assign(culled.triangle.begin(), culled.triangle.end());
  made.open = culled.open.why;
  if (!culled.within)
    made.why = "so few spheres cannot keep it";
  else if (made.open != WhyOpen::nothing)
    made.why = open_text(job, culled.open);
  job.report.filled_body = culled.filled && job.body.kind != BodyKind::sheet;
  job.report.seconds.cull += job.clock.lap();
  return made;
}

}  // namespace padder
