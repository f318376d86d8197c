// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/pad/report.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "padding/export/model.h"
#include "tools/streams.h"

namespace padder {

using Json = nlohmann::ordered_json;

namespace {

// In kg, if the unit of lengths is known; else in units of the density times the unit of lengths cubed.
double mass_of(const Cluster& c, double density) {
  return density * c.mass.volume * std::pow(metres(c.unit), 3);
}

Json json_of(const Point& p) { return Json::array({p.x(), p.y(), p.z()}); }

Json patches_json(const std::vector<Patch>& patches) {
  Json j = Json::array();
  for (const Patch& p : patches) j.push_back({{"area", p.area}, {"rim", p.rim}, {"place", json_of(p.place)}});
  return j;
}

Json slots_json(const std::vector<ClosedSlot>& slots) {
  Json j = Json::array();
  for (const ClosedSlot& s : slots)
    j.push_back({{"width", s.width}, {"area", s.area}, {"place", json_of(s.place)}});
  return j;
}

// What repair did to the surface, beside what its own report says: one line for each.
void print_repair(const PadReport& r, const Accuracy& a) {
  if (r.filled > 0) {
    std::printf("  %s of the input filled: area %.3g", counted(r.filled, "hole").c_str(), r.filled_area);
    const auto longest = std::max_element(r.patches.begin(), r.patches.end(),
                                          [](const Patch& p, const Patch& q) { return p.rim < q.rim; });
    if (longest != r.patches.end())
      std::printf(", longest rim %.3g around %s", longest->rim, place_text(longest->place).c_str());
    std::printf("\n");
  }
  if (r.buried > 0)
    std::printf("  %.3g %% of the input's surface is not covered: nothing outside can touch it\n",
                100 * r.buried);
  if (r.kind == BodyKind::wrap)
    std::printf("  body is all that a wrap around the input encloses; it stands off by at most %.3f %%\n",
                100 * a.wrap_distance / r.diagonal);
  for (std::size_t k = 0; k < std::min<std::size_t>(r.slots.size(), 5); k++)
    std::printf("  closed slot: at most %.3g wide, area %.3g, at %s\n", r.slots[k].width, r.slots[k].area,
                place_text(r.slots[k].place).c_str());
  if (r.slots.size() > 5)
    std::printf("  and %zu closed slots more (--json lists them)\n", r.slots.size() - 5);
}

// The bounds of both errors in percent of the diagonal, each with what stands behind it: "protrusion at most
// 0.43 % (mean 0.17 %), gap at most 0.37 % (mean 0.004 %), both proved against the input".
std::string errors_text(const Accuracy& a, double diagonal) {
  const auto percent = [&](double length) { return 100 * length / diagonal; };
  // The proof of the gap needs no inside, so it also holds for an open sheet.
  const bool proved = a.proved_against != SurfaceKind::none;
  char text[400];
  std::snprintf(text, sizeof text,
                "protrusion %s%.3f %% (mean %.3f %%)%s, gap at most %.3f %% (mean %.4f %%), %s",
                proved ? "at most " : "", percent(proved ? a.protrusion_bound : a.protrusion_max),
                percent(a.protrusion_mean), proved ? "" : " in the samples", percent(a.gap_bound),
                percent(a.gap_mean), proved ? "both proved against the input" : "only the gap proved");
  return text;
}

}  // namespace

Json report_json(const PadArguments& a, const std::string& file, const PadTarget& target, const Padded& p,
                 const std::vector<std::string>& warnings) {
  const PadOptions& options = a.options;
  const auto& r = p.report;
  const auto& s = r.seconds;
  const bool depth_mode = options.by_depth();
  Json lods = Json::array();
  for (const auto& lod : p.cluster.lods)
    lods.push_back({{"tolerance", lod.tolerance},
                    {"spheres", lod.radii.size()},
                    {"accuracy", Json::parse(to_json(lod.accuracy))}});
  const auto [least, most] = std::minmax_element(p.cluster.radii.begin(), p.cluster.radii.end());
  return {{"input", cli::StreamFiles::spoken(file)},
          {"output", target.outputs[0].path.string()},
          {"mesh", target.mesh.empty() ? Json(nullptr) : Json(target.mesh.string())},
          {"triangles_in", r.triangles_in},
          {"triangles_remeshed", r.triangles_remeshed},
          {"repair", p.cluster.source.repair},
          {"filled", {{"holes", r.filled}, {"area", r.filled_area}}},
          {"depth", depth_mode ? Json(options.depth_ratio_used()) : Json(nullptr)},
          {"tolerance", r.tolerance > 0 ? Json(r.tolerance) : Json(nullptr)},
          {"protrusion", options.protrusion ? Json(options.protrusion->absolute(r.diagonal)) : Json(nullptr)},
          {"gap", options.gap ? Json(options.gap->absolute(r.diagonal)) : Json(nullptr)},
          {"body_covered", r.filled_body},
          {"within", r.within},
          {"reason", r.reason.empty() ? Json(nullptr) : Json(r.reason)},
          {"notes", r.notes},
          {"warnings", warnings},
          {"grid_entries", r.grid_entries},
          {"lods", lods},
          {"edge_length", r.edge_length},
          {"spheres", p.cluster.size()},
          {"lower_bound", r.fewest > 0 ? Json(r.fewest) : Json(nullptr)},
          {"diagonal", r.diagonal},
          {"radius_min", *least},
          {"radius_max", *most},
          {"accuracy", Json::parse(to_json(p.cluster.accuracy))},
          {"volume", p.cluster.mass.volume > 0 ? Json(p.cluster.mass.volume) : Json(nullptr)},
          {"density", a.density},
          {"mass", p.cluster.mass.volume > 0 ? Json(mass_of(p.cluster, a.density)) : Json(nullptr)},
          {"buried", r.buried},
          {"repair_steps",
           {{"pieces", r.steps.pieces},
            {"crossing_pairs", r.steps.crossing_pairs},
            {"repeated_triangles", r.steps.repeated},
            {"turned_triangles", r.steps.turned},
            {"turned_pieces", r.steps.turned_pieces},
            {"cavities", r.steps.cavities},
            {"copies", r.steps.copies},
            {"buried_area", r.steps.buried_area},
            {"split_edges", r.steps.split},
            {"joined_corners", r.steps.joined},
            {"joined_width", r.steps.joined_width},
            {"cracks", r.steps.cracks},
            {"crack_width", r.steps.crack_width},
            {"sheet_area", r.steps.sheet_area},
            {"sheet_pieces", r.steps.sheet_pieces},
            {"sheet_winding", r.steps.sheet_winding},
            {"sheet_rim", r.steps.sheet_rim}}},
          {"patches", patches_json(r.patches)},
          {"slots", slots_json(r.slots)},
          {"quality",
           {{"min_angle_deg", r.quality.min_angle_deg},
            {"share_under_20_deg", r.quality.share_under_20_deg},
            {"angles_under_20_deg", r.quality.angles_under_20_deg},
            {"free_angles_under_20_deg", r.quality.free_angles_under_20_deg},
            {"share_non_delaunay", r.quality.share_non_delaunay},
            {"circumradius_max", r.quality.circumradius_max},
            {"sharp_edges", r.quality.sharp_edges}}},
          {"seconds",
           {{"read", s.read},
            {"repair", s.repair},
            {"remesh", s.remesh},
            {"fit", s.fit},
            {"refit", s.refit},
            {"cull", s.cull},
            {"accuracy", s.accuracy},
            {"total", s.total()}}}};
}

void print_report(const PadArguments& a, const std::string& file, const PadTarget& target, const Padded& p) {
  const auto& r = p.report;
  const auto& c = p.cluster;
  std::printf("%s: %s", cli::StreamFiles::spoken(file).c_str(), counted(r.triangles_in, "triangle").c_str());
  if (r.triangles_remeshed > 0) std::printf(", remeshed to %llu", (unsigned long long)r.triangles_remeshed);
  std::printf("; repair: %s\n", c.source.repair.c_str());
  for (const std::string& note : r.notes) std::printf("  note: %s\n", note.c_str());
  for (const auto& lod : c.lods)
    std::printf("  %s: %s\n", counted(lod.radii.size(), "sphere").c_str(),
                errors_text(lod.accuracy, r.diagonal).c_str());
  std::printf("  %s: %s\n", counted(c.size(), "sphere").c_str(), errors_text(c.accuracy, r.diagonal).c_str());
  print_repair(r, c.accuracy);
  if (c.accuracy.proved_against == SurfaceKind::none)
    std::printf("  an open sheet has no inside: its protrusion is measured, not proved\n");
  if (r.fewest > 0)
    std::printf(
        "  no such cover has fewer than %llu spheres, proved in %.2f s: this one has %.2f times as many\n",
        (unsigned long long)r.fewest, r.seconds.lower_bound, double(c.size()) / double(r.fewest));
  if (r.filled_body) std::printf("  the whole body is inside the spheres, proved\n");
  if (!r.reason.empty())
    std::printf("  not certified%s: %s\n", r.within ? "" : ", nor within the tolerance", r.reason.c_str());
  std::printf("  of the diagonal %g%s; normals off by %.1f degrees in the mean; %.2f s\n", r.diagonal,
              (c.unit.empty() ? "" : " " + c.unit).c_str(), c.accuracy.normal_error_mean_deg,
              r.seconds.total());
  if (c.mass.volume > 0) {
    const bool known = !c.unit.empty();
    std::printf("  volume %.4g%s, mass %.4g%s at a density of %g%s\n", c.mass.volume,
                known ? (" " + c.unit + "^3").c_str() : "", mass_of(c, a.density), known ? " kg" : "",
                a.density, known ? " kg/m^3" : "");
  }
  for (const OutputFile& output : target.outputs) std::printf("  wrote %s\n", output.path.c_str());
  if (!target.mesh.empty()) std::printf("  wrote %s\n", target.mesh.c_str());
}

void print_seconds(const Json& report) {
  for (const auto& [step, seconds] : report["seconds"].items())
    std::fprintf(stderr, "pad: %-8s %8.3f s\n", step.c_str(), seconds.get<double>());
}

}  // namespace padder
