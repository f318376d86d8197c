#include "padding/cluster.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "padding/error.h"
#include "padding/file.h"

namespace padder {
namespace {

using Json = nlohmann::ordered_json;

Json vector_json(const Vector& v) { return Json::array({v.x(), v.y(), v.z()}); }

Json matrix_json(const Eigen::Matrix3d& m) {  // rows
  Json rows = Json::array();
  for (int k = 0; k < 3; k++) rows.push_back(vector_json(m.row(k).transpose()));
  return rows;
}

void require(bool condition, const std::string& where, const std::string& sentence) {
  if (!condition) throw Error(where + ": " + sentence);
}

Vector vector_from(const Json& j) {
  if (!j.is_array() || j.size() != 3)
    throw Json::type_error::create(302, "an array of three numbers is wanted", &j);
  return {j[0].get<double>(), j[1].get<double>(), j[2].get<double>()};
}

Eigen::Matrix3d matrix_from(const Json& j) {
  if (!j.is_array() || j.size() != 3) throw Json::type_error::create(302, "three rows are wanted", &j);
  Eigen::Matrix3d m;
  for (int k = 0; k < 3; k++) m.row(k) = vector_from(j[k]).transpose();
  return m;
}

// The accuracy block's numbers under their names, for writing and reading alike.
constexpr std::pair<const char*, double Accuracy::*> accuracy_numbers[] = {
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
  for (const auto& [name, member] : accuracy_numbers) j[name] = a.*member;
  j["proved_against"] = kind_json(a.proved_against);
  j["certified"] = a.certified;
  return j;
}

SurfaceKind kind_from(const Json& j) {
  if (j.is_null()) return SurfaceKind::none;
  const auto name = j.get<std::string>();
  for (const auto kind : {SurfaceKind::input, SurfaceKind::filled, SurfaceKind::wrap})
    if (name == name_of(kind)) return kind;
  throw Json::other_error::create(501, "\"input\", \"filled\" or \"wrap\" is wanted", &j);
}

Accuracy accuracy_from(const Json& j) {
  Accuracy a;
  for (const auto& [name, member] : accuracy_numbers) a.*member = j.value(name, 0.0);
  if (const auto it = j.find("proved_against"); it != j.end()) a.proved_against = kind_from(*it);
  a.certified = j.value("certified", false);
  return a;
}

// Of a cluster or of one of its rungs.
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
  for (const auto& [name, member] : accuracy_numbers) {
    finite("accuracy", std::isfinite(c.accuracy.*member));
    for (const Lod& lod : c.lods) finite("lods.accuracy", std::isfinite(lod.accuracy.*member));
  }
  for (const Lod& lod : c.lods)
    finite("lods", std::isfinite(lod.tolerance) && std::isfinite(lod.volume_union));
}

// A file's name may hold bytes that are no UTF-8: these become the replacement character.
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

// `key` follows what is being read, for the message.
template <class T>
void spheres_from(const Json& j, T& c, std::string& key, const std::string& where) {
  const auto array = [&](const char* name) -> const Json* {
    key = name;
    const auto it = j.find(name);
    return it != j.end() && it->is_array() ? &*it : nullptr;
  };
  const Json* centers = array("centers");
  require(centers, where, "\"spheres.centers\" is missing or no array");
  for (const Json& p : *centers) c.centers.push_back(vector_from(p));
  const Json* radii = array("radii");
  require(radii, where, "\"spheres.radii\" is missing or no array");
  c.radii = radii->get<std::vector<double>>();
  if (const Json* triangle = array("triangle"))
    c.triangle = triangle->get<std::vector<std::int64_t>>();
  else
    c.triangle.assign(c.radii.size(), -1);
  key = "count";
  require(!j.contains("count") || j["count"].template get<std::size_t>() == c.radii.size(), where,
          "\"spheres.count\" is not the number of spheres: is the file whole?");
}

// One line for each key, the arrays of spheres on lines of their own: small enough, and a diff can be read.
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

}  // namespace

const char* name_of(SurfaceKind kind) {
  switch (kind) {
    case SurfaceKind::input:
      return "input";
    case SurfaceKind::filled:
      return "filled";
    case SurfaceKind::wrap:
      return "wrap";
    default:
      return "";
  }
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

Cluster cluster_from_json(std::string_view text, const std::string& where) {
  Cluster c;
  std::string key = "document";
  try {
    const Json j = Json::parse(text);
    require(j.is_object() && j.value("format", "") == "padder.cluster", where,
            "not a cluster: \"format\" must be \"padder.cluster\"");
    require(j.value("version", 0) == 1, where, "this program reads version 1 of the cluster format");
    const auto at = [&](const Json& object, const char* name) -> const Json* {
      key = name;
      const auto it = object.find(name);
      return it == object.end() ? nullptr : &*it;
    };
    if (const Json* v = at(j, "name")) c.name = v->get<std::string>();
    if (const Json* v = at(j, "unit")) c.unit = v->get<std::string>();
    if (const Json* v = at(j, "program")) c.program = v->get<std::string>();
    if (const Json* s = at(j, "source")) {
      c.source.file = s->value("file", ""), c.source.sha256 = s->value("sha256", "");
      c.source.triangles = s->value("triangles", std::uint64_t(0)), c.source.repair = s->value("repair", "");
    }
    if (const Json* v = at(j, "settings")) {
      require(v->is_object(), where, "\"settings\" must be an object");
      c.settings = v->dump();
    }
    const auto bits = [&](const char* name) -> std::uint32_t {
      const Json* v = at(j, name);
      if (!v) return 0;
      require(v->is_number_integer() && *v >= 0 && *v <= 0xffffffffull, where,
              std::string(name) + " must be a whole number from 0 to 4294967295");
      return v->get<std::uint32_t>();
    };
    c.family = bits("family"), c.mask = bits("mask");
    if (const Json* b = at(j, "bounds"))
      c.bounds.low = vector_from(b->at("low")), c.bounds.high = vector_from(b->at("high"));
    if (const Json* m = at(j, "mass_properties")) {
      c.mass.volume = m->at("volume").get<double>(), c.mass.center = vector_from(m->at("center"));
      c.mass.inertia = matrix_from(m->at("inertia")), c.mass.axes = matrix_from(m->at("axes")).transpose();
      c.mass.moments = vector_from(m->at("moments"));
      if (const Json* of = at(*m, "of")) c.mass_of = kind_from(*of);
    }
    if (const Json* v = at(j, "volume_union")) c.volume_union = v->get<double>();
    if (const Json* v = at(j, "accuracy")) c.accuracy = accuracy_from(*v);
    const Json* spheres = at(j, "spheres");
    require(spheres, where, "\"spheres\" is missing");
    spheres_from(*spheres, c, key, where);
    if (const Json* lods = at(j, "lods"))
      for (const Json& v : *lods) {
        Lod& lod = c.lods.emplace_back();
        key = "lods";
        lod.tolerance = v.at("tolerance").get<double>(), lod.volume_union = v.value("volume_union", 0.0);
        if (v.contains("accuracy")) lod.accuracy = accuracy_from(v["accuracy"]);
        spheres_from(v.at("spheres"), lod, key, where);
      }
  } catch (const Json::parse_error& e) {
    throw Error(where + ": not JSON at byte " + std::to_string(e.byte));
  } catch (const Json::exception& e) {
    throw Error(where + ": the value of \"" + key + "\" is not of the cluster format: " + e.what());
  }
  check(c, where);
  return c;
}

void write_cluster(const Cluster& cluster, const std::filesystem::path& path) {
  write_file(path, to_json(cluster));
}

Cluster read_cluster(const std::filesystem::path& path) {
  return cluster_from_json(read_file(path), path.string());
}

}  // namespace padder
