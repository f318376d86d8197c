// SPDX-License-Identifier: MIT
#include "padding/view/view.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "padding/asset/error.h"
#include "padding/asset/excerpt.h"
#include "padding/geometry/surface.h"
#include "padding/input/read.h"

namespace padder {
namespace {

namespace fs = std::filesystem;

// Neighbouring triangles have neighbouring numbers. Steps of the golden ratio around the circle of hues give
// them colours that differ.
Colour of_triangle(std::int64_t triangle) {
  if (triangle < 0) return palette().none;
  const double turns = std::fmod(double(triangle) * 0.6180339887498949, 1.0);
  Colour c;
  for (int k = 0; k < 3; k++) {
    const double x = std::abs(std::fmod(turns * 6 + (k == 0 ? 0 : k == 1 ? 4 : 2), 6) - 3);
    c[k] = std::uint8_t(std::lround(255 * (0.28 + 0.57 * std::clamp(x - 1, 0.0, 1.0))));
  }
  return c;
}

template <class T>
std::vector<Colour> by_length(const std::vector<T>& lengths, const ColourRange& range) {
  std::vector<Colour> out;
  out.reserve(lengths.size());
  for (const T v : lengths) out.push_back(along_ramp(range.share(double(v))));
  return out;
}

// Equal, but for rounding: the two were scaled in different orders.
bool same_box(const Box& a, const Box& b) {
  const double tolerance = 1e-6 * b.diagonal();
  return (a.low - b.low).cwiseAbs().maxCoeff() <= tolerance &&
         (a.high - b.high).cwiseAbs().maxCoeff() <= tolerance;
}

ReadResult read_for(const Cluster& cluster, const fs::path& path) {
  ReadOptions options;
  options.unit = cluster.unit;
  return read_mesh(path, options);
}

// "within 0.5 %" of the diagonal.
std::string rung_name(const Cluster& cluster, double tolerance) {
  const double diagonal = cluster.bounds.empty() ? 0 : cluster.bounds.diagonal();
  if (diagonal > 0) return "within " + short_number(100 * tolerance / diagonal, 3) + " %";
  return "within " + short_number(tolerance, 3) + (cluster.unit.empty() ? "" : " " + cluster.unit);
}

// The cluster's own spheres have the finest tolerance of the ladder.
std::string finest_name(const Cluster& cluster) {
  const auto settings = nlohmann::json::parse(cluster.settings, nullptr, false);
  double finest = std::numeric_limits<double>::infinity();
  if (settings.is_object() && settings.contains("lod") && settings["lod"].is_array())
    for (const auto& t : settings["lod"])
      if (t.is_number()) finest = std::min(finest, t.get<double>());
  return std::isfinite(finest) ? rung_name(cluster, finest) : "finest";
}

// A file that was written by hand has no accuracy.
std::vector<Accuracy> measured(const Accuracy& a) {
  return a.coverage > 0 || a.gap_max > 0 ? std::vector{a} : std::vector<Accuracy>{};
}

// `most` by rung. Faces inside the body, which repair would take away, bring the nearest point too near: the
// largest protrusion that the rung reports bounds them all.
void add_protrusion(View& v, const std::vector<double>& most) {
  const Surface surface(v.mesh);
  v.protrusion.resize(v.size());
  for (std::size_t rung = 0; rung < v.rungs.size(); rung++) {
    const std::size_t first = v.rungs[rung].first, end = first + v.rungs[rung].count;
#pragma omp parallel for schedule(dynamic, 256)
    for (std::size_t k = first; k < end; k++)
      v.protrusion[k] =
          float(std::clamp(v.radii[k] - surface.nearest(v.centers[k]).distance, 0.0, most[rung]));
  }
}

}  // namespace

Box View::bounds() const {
  Box box = mesh.bounds();
  for (std::size_t k = 0; k < size(); k++) box.add_ball(centers[k], radii[k]);
  return box;
}

View view_of(const Cluster& cluster, const Mesh& mesh) {
  View v;
  v.title = cluster.name;
  v.unit = cluster.unit;
  v.note = cluster.program;
  if (!cluster.source.file.empty())
    v.note += (v.note.empty() ? "" : ", ") + std::string("from ") + cluster.source.file + " (" +
              std::to_string(cluster.source.triangles) + " triangles)";
  v.mesh = mesh;
  std::vector<double> most;  // by rung: the largest protrusion reported
  const auto add = [&](const auto& rung, const std::string& name) {
    v.rungs.push_back({name, v.size(), rung.radii.size(), measured(rung.accuracy)});
    v.centers.insert(v.centers.end(), rung.centers.begin(), rung.centers.end());
    v.radii.insert(v.radii.end(), rung.radii.begin(), rung.radii.end());
    v.triangle.insert(v.triangle.end(), rung.triangle.begin(), rung.triangle.end());
    most.push_back(v.rungs.back().accuracy.empty() ? std::numeric_limits<double>::infinity()
                                                   : rung.accuracy.protrusion_max);
  };
  add(cluster, cluster.lods.empty() ? "all" : finest_name(cluster));
  for (auto lod = cluster.lods.rbegin(); lod != cluster.lods.rend(); ++lod)
    add(*lod, rung_name(cluster, lod->tolerance));
  v.family.assign(v.size(), cluster.family);
  v.mask = cluster.mask;
  // A cluster that was written by hand has no triangles.
  if (std::all_of(v.triangle.begin(), v.triangle.end(), [](std::int64_t t) { return t < 0; }))
    v.triangle.clear();
  v.accuracy = v.rungs[0].accuracy;
  if (v.has_mesh()) {
    add_protrusion(v, most);
    add_errors(v);
  }
  if (cluster.lods.empty()) v.rungs.clear();
  return v;
}

View one_rung(const View& view, std::size_t rung) {
  const std::size_t levels = std::max<std::size_t>(1, view.rungs.size());
  if (rung >= levels)
    throw Error(view.title + " has " + counted(levels, "level") + " of detail, 0 the finest, and no level " +
                std::to_string(rung) + " (pad --lod makes more)");
  View one = view;
  if (view.rungs.empty()) return one;
  const ViewRung& r = view.rungs[rung];
  const auto keep = [&](auto& values) {
    if (values.empty()) return;
    values.erase(values.begin() + std::ptrdiff_t(r.first + r.count), values.end());
    values.erase(values.begin(), values.begin() + std::ptrdiff_t(r.first));
  };
  keep(one.centers), keep(one.radii), keep(one.family), keep(one.triangle), keep(one.protrusion),
      keep(one.gap), keep(one.body);
  if (!one.errors.gap.empty()) one.errors.gap = {view.errors.gap[rung]};
  one.accuracy = r.accuracy;
  one.rungs.clear();
  return one;
}

// The asset does not record --scale, so it is found from the bounds.
Mesh mesh_of(const Cluster& cluster, Mesh mesh, const std::string& name) {
  const double own = mesh.bounds().diagonal(), wanted = cluster.bounds.diagonal();
  if (cluster.bounds.empty() || same_box(mesh.bounds(), cluster.bounds)) return mesh;
  if (own > 0)
    for (Point& p : mesh.points) p *= wanted / own;
  if (!same_box(mesh.bounds(), cluster.bounds))
    throw Error(name + ": this is not the mesh that cluster " + cluster.name +
                " was made from, their bounding boxes differ: name the right one, or pad this one");
  return mesh;
}

Mesh mesh_of(const Cluster& cluster, const fs::path& cluster_path, const fs::path& path) {
  if (!path.empty()) return mesh_of(cluster, read_for(cluster, path).mesh, path.string());
  // A name with folders in it does not come from padder; it must not lead the search elsewhere.
  const fs::path name = fs::path(cluster.source.file).filename();
  if (name.empty() || cluster.source.sha256.empty()) return {};
  for (const fs::path& folder : {cluster_path.parent_path(), fs::path(".")})
    for (const fs::path& candidate : {folder / name, folder / "assets" / name}) {
      std::error_code code;
      if (!fs::is_regular_file(candidate, code)) continue;
      try {
        ReadResult file = read_for(cluster, candidate);
        if (file.source.sha256 == cluster.source.sha256)
          return mesh_of(cluster, std::move(file.mesh), candidate.string());
      } catch (const Error&) {
        // A file of that name, but not the one that the cluster was made from.
      }
    }
  return {};
}

Colour along_ramp(double share) {
  const auto& ramp = palette().ramp;
  const double x = std::clamp(share, 0.0, 1.0) * double(ramp.size() - 1);
  const std::size_t k = std::min(std::size_t(x), ramp.size() - 2);
  Colour c;
  for (int i = 0; i < 3; i++)
    c[i] = std::uint8_t(std::lround(ramp[k][i] + (x - double(k)) * (ramp[k + 1][i] - ramp[k][i])));
  return c;
}

std::optional<ColourRange> range_of(const View& view, ColourBy by) {
  if (by == ColourBy::radius) {
    const auto [low, high] = std::minmax_element(view.radii.begin(), view.radii.end());
    return view.radii.empty() ? ColourRange{} : ColourRange{*low, *high};
  }
  if (by != ColourBy::protrusion && by != ColourBy::gap) return std::nullopt;
  ColourRange range;
  for (const float v : by == ColourBy::gap ? view.gap : view.protrusion)
    range.high = std::max(range.high, double(v));
  for (const float v : mesh_errors(view, by)) range.high = std::max(range.high, double(v));
  return range;
}

std::vector<float> mesh_errors(const View& view, ColourBy by) {
  if ((by != ColourBy::protrusion && by != ColourBy::gap) || view.errors.gap.empty()) return {};
  std::vector<float> out = view.errors.gap[0];
  for (float& v : out) v = std::max(0.f, by == ColourBy::gap ? v : -v);
  return out;
}

std::vector<Colour> colours_of(const View& view, ColourBy by) {
  const auto need = [&](bool there, const char* what) {
    if (!there)
      throw Error(view.title + " has nothing to be coloured by " + what + ": choose another --colour");
  };
  std::vector<Colour> out;
  out.reserve(view.size());
  switch (by) {
    case ColourBy::radius:
      return by_length(view.radii, *range_of(view, by));
    case ColourBy::protrusion:
      need(view.protrusion.size() == view.size(), "protrusion, which needs the mesh");
      return by_length(view.protrusion, *range_of(view, by));
    case ColourBy::gap:
      need(view.gap.size() == view.size(), "gap, which needs the mesh");
      return by_length(view.gap, *range_of(view, by));
    case ColourBy::triangle:
      need(view.triangle.size() == view.size(), "triangle");
      for (const std::int64_t t : view.triangle) out.push_back(of_triangle(t));
      return out;
    case ColourBy::body:
      need(view.body.size() == view.size(), "body");
      for (const std::uint32_t b : view.body)
        out.push_back(colour_of_kind(b < view.bodies.size() ? b + 1 : 0));
      return out;
    default:
      for (const std::uint32_t f : view.family) out.push_back(colour_of_kind(f));
      return out;
  }
}

const char* name_of(ColourBy by) {
  constexpr const char* names[] = {"family", "radius", "protrusion", "gap", "triangle", "body"};
  return names[std::size_t(by)];
}

const char* name_of(MarkKind kind) {
  constexpr const char* names[] = {"patch over a hole", "buried, nothing touches it",
                                   "slot closed by the wrap", "sheet, padded on both sides"};
  return names[std::size_t(kind)];
}

const Palette& palette() {
  static const Palette p{
      .none = kNoKind,
      .mesh = {158, 170, 184},
      .background = {244, 246, 248},
      .marks = {{{0, 158, 115}, {86, 180, 233}, {213, 94, 0}, {204, 121, 167}}},  // told apart by all eyes
      .kinds = {kKinds.begin(), kKinds.end()},
      .ramp = {{38, 48, 120}, {36, 104, 160}, {44, 160, 150}, {146, 200, 90}, {250, 220, 70}},
      .ink = {31, 41, 51},
      .dark_background = {22, 26, 31},
      .dark_ink = {222, 227, 233}};
  return p;
}

}  // namespace padder
