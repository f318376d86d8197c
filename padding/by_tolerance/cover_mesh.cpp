// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/cover_mesh.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "padding/asset/error.h"
#include "padding/by_tolerance/cull.h"
#include "padding/geometry/unit_frame.h"
#include "padding/verify/accuracy.h"

namespace padder {
namespace {

[[noreturn]] void fail(const CoverMeshOptions& options, const std::string& sentence) {
  throw Error(options.name + ": " + sentence);
}

void check_options(const Length& tolerance, const CoverMeshOptions& options) {
  const bool needed = !(options.protrusion && options.gap);
  if (!(tolerance.value() > 0 || (!needed && tolerance.value() == 0)) || !std::isfinite(tolerance.value()))
    fail(options, "the tolerance must be positive and finite");
  for (const auto& l : {options.protrusion, options.gap})
    if (l && (!(l->value() >= 0) || !std::isfinite(l->value())))
      fail(options, "a protrusion and a gap must be 0 or positive, and finite");
  if (!options.protrusion.value_or(tolerance).given() && !options.gap.value_or(tolerance).given())
    fail(options,
         "spheres that neither stand out of the body nor leave a gap do not exist: allow one of both errors");
  for (const Length* radius : {&options.min_radius, &options.max_radius})
    if (!(radius->value() >= 0) || !std::isfinite(radius->value()))
      fail(options, "a limit of the radius must be positive and finite");
  if (!(options.effort >= 0 && options.effort <= 3)) fail(options, "the effort must be 0, 1, 2 or 3");
}

void check_indices(const Mesh& mesh, const CoverMeshOptions& options) {
  if (mesh.triangles.empty()) fail(options, "the mesh has no triangles");
  for (std::size_t t = 0; t < mesh.triangles.size(); t++)
    for (const std::uint32_t v : mesh.triangles[t]) {
      if (v >= mesh.points.size())
        fail(options, "triangle " + std::to_string(t) + " names vertex " + std::to_string(v) +
                          ", but there are only " + std::to_string(mesh.points.size()));
      if (!mesh.points[v].allFinite()) fail(options, "vertex " + std::to_string(v) + " is not finite");
    }
}

std::string settings_json(const Length& tolerance, const CoverMeshOptions& options, double diagonal) {
  nlohmann::ordered_json j;
  if (tolerance.given()) j["tolerance"] = tolerance.absolute(diagonal);
  if (options.protrusion) j["protrusion"] = options.protrusion->absolute(diagonal);
  if (options.gap) j["gap"] = options.gap->absolute(diagonal);
  if (options.min_radius.given()) j["min_radius"] = options.min_radius.absolute(diagonal);
  if (options.max_radius.given()) j["max_radius"] = options.max_radius.absolute(diagonal);
  j["effort"] = options.effort;
  return j.dump();
}

}  // namespace

Cluster cover_mesh(const Mesh& mesh, const Length& tolerance, const CoverMeshOptions& options) {
  check_options(tolerance, options);
  check_indices(mesh, options);
  Cluster cluster;
  cluster.bounds = mesh.bounds();
  const UnitFrame frame(cluster.bounds, options.name);
  Repaired body;
  body.mesh = mesh;
  for (Point& p : body.mesh.points) p = frame.into(p);
  const Surface surface(body.mesh, body.side());
  if (!surface.closed())
    fail(options,
         std::to_string(surface.open_edges()) +
             " of its edges are open: close the surface, and let triangles that meet share vertices");
  const MassProperties mass = mass_properties(body.mesh);
  if (!(mass.volume > 0)) fail(options, "it encloses no volume: turn its triangles to face outward");

  CullOptions culling;
  culling.tolerance = tolerance.in_unit_frame(frame.scale());
  const double protrusion = options.protrusion.value_or(tolerance).in_unit_frame(frame.scale());
  const double gap = options.gap.value_or(tolerance).in_unit_frame(frame.scale());
  const bool each_error = options.protrusion || options.gap;
  if (each_error) culling.only_protrusion = protrusion, culling.only_gap = gap;
  culling.min_radius = options.min_radius.in_unit_frame(frame.scale());
  if (options.max_radius.given()) culling.max_radius = options.max_radius.in_unit_frame(frame.scale());
  culling.effort = options.effort;
  culling.keep_back(frame.coarseness());
  Culled culled = cull(surface, culling);
  for (Ball& ball : culled.balls) ball.center = frame.written(ball.center);
  const Measured measured = measure(body.mesh, body, surface, culled.balls, {.floor = gap});

  for (const Ball& ball : culled.balls) {
    cluster.centers.push_back(frame.back(ball.center));
    cluster.radii.push_back(ball.radius * frame.scale());
  }
  cluster.triangle.assign(culled.triangle.begin(), culled.triangle.end());
  const double rounding = kKeptBack * (protrusion + gap);
  const bool kept = measured.accuracy.protrusion_max <= protrusion + rounding &&
                    measured.accuracy.gap_max <= gap + rounding && (!each_error || gap > 0 || culled.filled);
  cluster.accuracy = frame.back(measured.accuracy);
  cluster.accuracy.certified =
      measured.accuracy.proved_against == SurfaceKind::input && measured.outside == 0 && kept;
  cluster.volume_union = frame.back_volume(measured.volume_union);
  cluster.mass = frame.back(mass);
  cluster.name = options.name;
  cluster.unit = options.unit;
  cluster.program = "padder " PADDER_VERSION;
  cluster.source.file = options.name;
  cluster.source.triangles = mesh.triangles.size();
  cluster.source.repair = "none (as given)";
  cluster.settings = settings_json(tolerance, options, frame.scale());
  return cluster;
}

}  // namespace padder
