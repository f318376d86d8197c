// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/pad/report.h"

#include <algorithm>
#include <cstdio>

namespace padder {

using Json = nlohmann::ordered_json;

Json report_json(const PadFiles& files, const PadOptions& options, const Padded& p,
                 const std::vector<std::string>& warnings) {
  const auto& r = p.report;
  const auto& s = r.seconds;
  const bool depth_mode = options.by_depth();
  Json lods = Json::array();
  for (const auto& lod : p.cluster.lods)
    lods.push_back({{"tolerance", lod.tolerance},
                    {"spheres", lod.radii.size()},
                    {"accuracy", Json::parse(to_json(lod.accuracy))}});
  const auto [least, most] = std::minmax_element(p.cluster.radii.begin(), p.cluster.radii.end());
  return {{"input", files.input},
          {"output", files.output.string()},
          {"mesh", files.mesh.empty() ? Json(nullptr) : Json(files.mesh.string())},
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
          {"buried", r.buried},
          {"quality",
           {{"min_angle_deg", r.quality.min_angle_deg},
            {"share_under_20_deg", r.quality.share_under_20_deg},
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

std::string errors_text(const Accuracy& a, double diagonal) {
  const auto percent = [&](double length) { return 100 * length / diagonal; };
  const bool against_input =
      a.proved_against == SurfaceKind::input || a.proved_against == SurfaceKind::filled;
  // The proof of the gap needs no inside, so it also holds for a sheet.
  const bool gap_proved = a.proved_against != SurfaceKind::wrap;
  char text[400];
  std::snprintf(text, sizeof text, "protrusion %s%.3f %% (mean %.3f %%)%s, gap %s%.3f %% (mean %.4f %%)",
                against_input ? "at most " : "", percent(a.protrusion_max), percent(a.protrusion_mean),
                against_input || !gap_proved ? "" : " in the samples", gap_proved ? "at most " : "",
                percent(a.gap_max), percent(a.gap_mean));
  std::string out = text;
  switch (a.proved_against) {
    case SurfaceKind::input:
      return out + ", both proved against the input";
    case SurfaceKind::filled:
      return out + ", both proved against the input with its holes filled";
    case SurfaceKind::none:
      return out + ", only the gap proved";
    case SurfaceKind::wrap:
      std::snprintf(
          text, sizeof text,
          " in the samples; proved against the wrap: protrusion at most %.3f %%, gap at most %.3f %%",
          percent(a.protrusion_bound), percent(a.gap_bound));
      return out + text;
  }
  return out;
}

void print_report(const PadFiles& files, const Padded& p) {
  const auto& r = p.report;
  const auto& c = p.cluster;
  std::printf("%s: %llu triangles", files.input.c_str(), (unsigned long long)r.triangles_in);
  if (r.triangles_remeshed > 0) std::printf(", remeshed to %llu", (unsigned long long)r.triangles_remeshed);
  std::printf("; repair: %s\n", c.source.repair.c_str());
  for (const auto& lod : c.lods)
    std::printf("  %zu spheres: %s\n", lod.radii.size(), errors_text(lod.accuracy, r.diagonal).c_str());
  std::printf("  %zu spheres: %s\n", c.size(), errors_text(c.accuracy, r.diagonal).c_str());
  if (r.kind == BodyKind::wrap)
    std::printf("  the wrap lies up to %.3f %% from the input in the samples\n",
                100 * c.accuracy.wrap_distance / r.diagonal);
  if (r.kind == BodyKind::sheet)
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
  std::printf("  wrote %s\n", files.output.c_str());
  if (!files.mesh.empty()) std::printf("  wrote %s\n", files.mesh.c_str());
}

}  // namespace padder
