// SPDX-License-Identifier: MIT
#include "padding/asset/cluster.h"

#include <cmath>

#include "padding/asset/error.h"
#include "padding/asset/excerpt.h"
#include "padding/asset/file.h"
#include "padding/asset/json.h"

namespace padder {
namespace {

using Json = nlohmann::ordered_json;
using Place = JsonPlace<Json>;

Json vector_json(const Vector& v) { return Json::array({v.x(), v.y(), v.z()}); }

Json matrix_json(const Eigen::Matrix3d& m) {  // rows
  Json rows = Json::array();
  for (int k = 0; k < 3; k++) rows.push_back(vector_json(m.row(k).transpose()));
  return rows;
}

void require(bool condition, const std::string& where, const std::string& sentence) {
  if (!condition) throw Error(where + ": " + sentence);
}

Vector vector_from(const Place& p) {
  double v[3];
  p.reals(v);
  return {v[0], v[1], v[2]};
}

Eigen::Matrix3d matrix_from(const Place& p) {
  if (p.size() != 3) p.fail("three rows are wanted");
  Eigen::Matrix3d m;
  for (int k = 0; k < 3; k++) m.row(k) = vector_from(p.at(static_cast<std::size_t>(k))).transpose();
  return m;
}

// The numbers of the accuracy block with their names in JSON, for writing and for reading.
constexpr std::pair<const char*, double Accuracy::*> kAccuracyNumbers[] = {
    {"protrusion_max", &Accuracy::protrusion_max},
    {"protrusion_mean", &Accuracy::protrusion_mean},
    {"protrusion_p95", &Accuracy::protrusion_p95},
    {"gap_max", &Accuracy::gap_max},
    {"gap_mean", &Accuracy::gap_mean},
    {"gap_p95", &Accuracy::gap_p95},
    {"coverage", &Accuracy::coverage},
    {"normal_error_mean_deg", &Accuracy::normal_error_mean_deg},
    {"normal_error_p95_deg", &Accuracy::normal_error_p95_deg},
    {"volume_ratio", &Accuracy::volume_ratio},
    {"protrusion_bound", &Accuracy::protrusion_bound},
    {"gap_bound", &Accuracy::gap_bound},
    {"wrap_distance", &Accuracy::wrap_distance},
};

Json kind_json(SurfaceKind kind) { return kind == SurfaceKind::none ? Json(nullptr) : Json(name_of(kind)); }

Json accuracy_object(const Accuracy& a) {
  Json j;
  for (const auto& [name, member] : kAccuracyNumbers) j[name] = a.*member;
  j["proved_against"] = kind_json(a.proved_against);
  j["certified"] = a.certified;
  return j;
}

// These leave `to` as it is when the key is missing.
void read_text(const Place& p, const char* key, std::string& to) {
  if (p.has(key)) to = p.at(key).text();
}
void read_real(const Place& p, const char* key, double& to) {
  if (p.has(key)) to = p.at(key).real();
}
void read_kind(const Place& p, const char* key, SurfaceKind& to) {
  if (!p.has(key)) return;
  const Place at = p.at(key);
  to = SurfaceKind::none;
  if (at.json().is_null()) return;
  const std::string name = at.text();
  for (const auto kind : {SurfaceKind::input, SurfaceKind::filled, SurfaceKind::wrap})
    if (name == name_of(kind)) to = kind;
  if (to == SurfaceKind::none) at.fail("\"input\", \"filled\", \"wrap\" or null is wanted");
}

Accuracy accuracy_from(const Place& p) {
  p.object();
  Accuracy a;
  for (const auto& [name, member] : kAccuracyNumbers) read_real(p, name, a.*member);
  read_kind(p, "proved_against", a.proved_against);
  if (p.has("certified")) a.certified = p.at("certified").truth();
  return a;
}

// T: Cluster or Lod.
template <class T>
void check_spheres(const T& c, const std::string& where) {
  require(c.centers.size() == c.radii.size() && c.triangle.size() == c.radii.size(), where,
          "spheres.centers, spheres.radii and spheres.triangle must be of one length");
  for (std::size_t k = 0; k < c.radii.size(); k++) {
    require(c.centers[k].allFinite(), where,
            "sphere " + std::to_string(k) + " has a centre that is not finite");
    require(std::isfinite(c.radii[k]) && c.radii[k] > 0, where,
            "sphere " + std::to_string(k) + " has a radius that is not positive and finite");
  }
}

void check(const Cluster& c, const std::string& where) {
  check_spheres(c, where);
  for (const Lod& lod : c.lods) check_spheres(lod, where + ", lods");
  const auto finite = [&](const char* key, bool yes) {
    require(yes, where,
            std::string("\"") + key + "\" holds a number that is not finite: is the mesh too large?");
  };
  const MassProperties& m = c.mass;
  finite("bounds", c.bounds.empty() || (c.bounds.low.allFinite() && c.bounds.high.allFinite()));
  finite("mass_properties", std::isfinite(m.volume) && m.center.allFinite() && m.inertia.allFinite() &&
                                m.axes.allFinite() && m.moments.allFinite());
  finite("volume_union", std::isfinite(c.volume_union));
  for (const auto& [name, member] : kAccuracyNumbers) {
    finite("accuracy", std::isfinite(c.accuracy.*member));
    for (const Lod& lod : c.lods) finite("lods.accuracy", std::isfinite(lod.accuracy.*member));
  }
  for (const Lod& lod : c.lods)
    finite("lods", std::isfinite(lod.tolerance) && std::isfinite(lod.volume_union));
}

// The name of a file may hold bytes that are not UTF-8. They become the replacement character.
std::string text_of(const Json& j) { return j.dump(-1, ' ', false, Json::error_handler_t::replace); }

template <class T>
Json spheres_object(const T& c) {
  Json centers = Json::array();
  for (const Point& p : c.centers) centers.push_back(vector_json(p));
  return {{"count", c.radii.size()},
          {"centers", std::move(centers)},
          {"radii", c.radii},
          {"triangle", c.triangle}};
}

template <class T>
void spheres_from(const Place& p, T& c) {
  const Place centers = p.at("centers"), radii = p.at("radii");
  c.centers.resize(centers.size()), c.radii.resize(radii.size());
  for (std::size_t k = 0; k < c.centers.size(); k++) centers.at(k).reals(c.centers[k].data(), 3);
  for (std::size_t k = 0; k < c.radii.size(); k++) c.radii[k] = radii.at(k).real();
  c.triangle.assign(c.radii.size(), -1);
  if (p.has("triangle")) {
    const Place triangle = p.at("triangle");
    c.triangle.resize(triangle.size());
    for (std::size_t k = 0; k < c.triangle.size(); k++) c.triangle[k] = triangle.at(k).integer();
  }
  if (p.has("count") && p.at("count").whole(UINT64_MAX) != c.radii.size())
    p.at("count").fail("it is not the number of spheres: is the file whole?");
}

// Writes one line for each key, also for each array of spheres: the file stays small, and a diff can be read.
void append_lines(std::string& text, const Json& object, int indent) {
  const std::string pad(indent, ' ');
  text += "{";
  for (auto it = object.begin(); it != object.end(); ++it) {
    text += (it == object.begin() ? "\n" : ",\n") + pad + "\"" + it.key() + "\": ";
    if (it.key() == "spheres") {
      append_lines(text, *it, indent + 2);
    } else if (it.key() == "lods") {
      text += "[";
      for (std::size_t k = 0; k < it->size(); k++) {
        if (k > 0) text += ", ";
        append_lines(text, (*it)[k], indent + 2);
      }
      text += "]";
    } else {
      text += text_of(*it);
    }
  }
  text += "\n" + pad.substr(2) + "}";
}

// T: Cluster or Lod.
template <class T>
void scale_spheres(T& c, double factor) {
  for (Point& p : c.centers) p *= factor;
  for (double& r : c.radii) r *= factor;
  c.accuracy.scale(factor), c.volume_union *= std::pow(factor, 3);
}

// The lengths among the settings that pad writes. Others are kept, and so is what is no JSON object.
std::string scaled_settings(const std::string& settings, double factor) {
  Json j = Json::parse(settings, nullptr, false);
  if (!j.is_object()) return settings;
  const auto scale = [&](Json& length) {
    if (length.is_number()) length = length.get<double>() * factor;
  };
  for (const char* name : {"edge_length", "tolerance", "protrusion", "gap", "min_radius", "max_radius", "lod",
                           "reach", "thickness"}) {
    const auto at = j.find(name);
    if (at == j.end()) continue;
    if (at->is_array())
      for (Json& length : *at) scale(length);
    else
      scale(*at);
  }
  return text_of(j);
}

}  // namespace

void Accuracy::scale(double factor) {
  for (double* length : {&protrusion_max, &protrusion_mean, &protrusion_p95, &gap_max, &gap_mean, &gap_p95,
                         &protrusion_bound, &gap_bound, &wrap_distance})
    *length *= factor;
}

void Lod::scale(double factor) {
  scale_spheres(*this, factor);
  tolerance *= factor;
}

void Cluster::scale(double factor) {
  scale_spheres(*this, factor);
  if (!bounds.empty()) bounds.low *= factor, bounds.high *= factor;
  mass.volume *= std::pow(factor, 3), mass.center *= factor;
  mass.inertia *= std::pow(factor, 5), mass.moments *= std::pow(factor, 5);
  for (Lod& lod : lods) lod.scale(factor);
  settings = scaled_settings(settings, factor);
}

const char* name_of(SurfaceKind kind) {
  constexpr const char* names[] = {"", "input", "filled", "wrap"};
  return names[static_cast<std::size_t>(kind)];
}

std::string to_json(const Cluster& c) {
  check(c, "cluster " + c.name);
  Json j;
  j["format"] = "padder.cluster";
  j["version"] = 1;
  j["name"] = c.name;
  j["unit"] = c.unit;
  j["program"] = c.program;
  j["source"] = {{"file", c.source.file},
                 {"sha256", c.source.sha256},
                 {"triangles", c.source.triangles},
                 {"repair", c.source.repair}};
  j["settings"] = Json::parse(c.settings, nullptr, false);
  require(j["settings"].is_object(), "cluster " + c.name, "its settings are not a JSON object");
  j["family"] = c.family;
  j["mask"] = c.mask;
  if (!c.bounds.empty())
    j["bounds"] = {{"low", vector_json(c.bounds.low)}, {"high", vector_json(c.bounds.high)}};
  const MassProperties& m = c.mass;
  j["mass_properties"] = {{"volume", m.volume},
                          {"center", vector_json(m.center)},
                          {"inertia", matrix_json(m.inertia)},
                          {"axes", matrix_json(m.axes.transpose())},
                          {"moments", vector_json(m.moments)},
                          {"of", kind_json(c.mass_of)}};
  j["volume_union"] = c.volume_union;
  j["accuracy"] = accuracy_object(c.accuracy);
  j["spheres"] = spheres_object(c);
  if (!c.lods.empty()) {
    Json& lods = j["lods"] = Json::array();
    for (const Lod& lod : c.lods)
      lods.push_back({{"tolerance", lod.tolerance},
                      {"volume_union", lod.volume_union},
                      {"accuracy", accuracy_object(lod.accuracy)},
                      {"spheres", spheres_object(lod)}});
  }
  std::string text;
  append_lines(text, j, 2);
  return text + "\n";
}

std::string to_json(const Accuracy& accuracy) { return accuracy_object(accuracy).dump(); }

double metres(const std::string& unit) {
  if (unit.empty() || unit == "m") return 1;
  if (unit == "cm") return 0.01;
  if (unit == "mm") return 0.001;
  if (unit == "in") return 0.0254;
  throw Error("\"" + excerpt(unit) + "\" is no unit of length known here: use m, cm, mm or in");
}

Cluster cluster_from_json(std::string_view text, const std::string& where) {
  const Json document =
      parse_json<Json>(text, where, "a cluster of padder is wanted, which pad makes of a mesh or a robot");
  const Place p(document, where);
  const auto is = [&](const char* key, const Json& value) { return p.has(key) && p.at(key).json() == value; };
  require(is("format", "padder.cluster"), where, "not a cluster: \"format\" must be \"padder.cluster\"");
  require(is("version", 1), where, "this program reads version 1 of the cluster format");
  Cluster c;
  read_text(p, "name", c.name), read_text(p, "program", c.program);
  if (p.has("unit")) c.unit = p.at("unit").unit();
  if (p.has("source")) {
    const Place source = p.at("source");
    source.object();
    read_text(source, "file", c.source.file), read_text(source, "sha256", c.source.sha256);
    if (source.has("triangles")) c.source.triangles = source.at("triangles").whole(UINT64_MAX);
    read_text(source, "repair", c.source.repair);
  }
  if (p.has("settings")) {
    p.at("settings").object();
    c.settings = p.at("settings").json().dump();
  }
  if (p.has("family")) c.family = p.at("family").bits();
  if (p.has("mask")) c.mask = p.at("mask").bits();
  if (p.has("bounds")) {
    const Place bounds = p.at("bounds");
    c.bounds.low = vector_from(bounds.at("low")), c.bounds.high = vector_from(bounds.at("high"));
  }
  if (p.has("mass_properties")) {
    const Place mass = p.at("mass_properties");
    c.mass.volume = mass.at("volume").real(), c.mass.center = vector_from(mass.at("center"));
    c.mass.inertia = matrix_from(mass.at("inertia")), c.mass.axes = matrix_from(mass.at("axes")).transpose();
    c.mass.moments = vector_from(mass.at("moments"));
    read_kind(mass, "of", c.mass_of);
  }
  read_real(p, "volume_union", c.volume_union);
  if (p.has("accuracy")) c.accuracy = accuracy_from(p.at("accuracy"));
  spheres_from(p.at("spheres"), c);
  for (const Place& rung : p.all("lods")) {
    Lod& lod = c.lods.emplace_back();
    lod.tolerance = rung.at("tolerance").real();
    read_real(rung, "volume_union", lod.volume_union);
    if (rung.has("accuracy")) lod.accuracy = accuracy_from(rung.at("accuracy"));
    spheres_from(rung.at("spheres"), lod);
  }
  check(c, where);
  return c;
}

void write_cluster(const Cluster& cluster, const std::filesystem::path& path) {
  write_file(path, to_json(cluster));
}

Cluster read_cluster(const std::filesystem::path& path) {
  return cluster_from_json(read_file(path, kMostText), path.string());
}

}  // namespace padder
