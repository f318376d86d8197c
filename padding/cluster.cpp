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

void check(const Cluster& c, const std::string& where) {
  require(c.centers.size() == c.size() && c.triangle.size() == c.size(), where,
          "spheres.centers, spheres.radii and spheres.triangle must be of one length");
  for (std::size_t k = 0; k < c.size(); k++) {
    require(c.centers[k].allFinite(), where,
            "sphere " + std::to_string(k) + " has a centre that is not finite");
    require(std::isfinite(c.radii[k]) && c.radii[k] > 0, where,
            "sphere " + std::to_string(k) + " has a radius that is not positive and finite");
  }
  const MassProperties& m = c.mass;
  const Accuracy& a = c.accuracy;
  const auto finite = [&](const char* key, bool yes) {
    require(yes, where,
            std::string("\"") + key + "\" holds a number that is not finite: is the mesh too large?");
  };
  finite("bounds", c.bounds.empty() || (c.bounds.low.allFinite() && c.bounds.high.allFinite()));
  finite("mass_properties", std::isfinite(m.volume) && m.center.allFinite() && m.inertia.allFinite() &&
                                m.axes.allFinite() && m.moments.allFinite());
  finite("volume_union", std::isfinite(c.volume_union));
  for (const double number :
       {a.protrusion_max, a.protrusion_mean, a.protrusion_p95, a.gap_max, a.gap_mean, a.gap_p95, a.coverage,
        a.normal_error_mean_deg, a.normal_error_p95_deg, a.volume_ratio})
    finite("accuracy", std::isfinite(number));
}

// A file's name may hold bytes that are no UTF-8: these become the replacement character.
std::string text_of(const Json& j) { return j.dump(-1, ' ', false, Json::error_handler_t::replace); }

}  // namespace

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
                          {"moments", vector_json(m.moments)}};
  j["volume_union"] = c.volume_union;
  const Accuracy& a = c.accuracy;
  j["accuracy"] = {{"protrusion_max", a.protrusion_max},
                   {"protrusion_mean", a.protrusion_mean},
                   {"protrusion_p95", a.protrusion_p95},
                   {"gap_max", a.gap_max},
                   {"gap_mean", a.gap_mean},
                   {"gap_p95", a.gap_p95},
                   {"coverage", a.coverage},
                   {"normal_error_mean_deg", a.normal_error_mean_deg},
                   {"normal_error_p95_deg", a.normal_error_p95_deg},
                   {"volume_ratio", a.volume_ratio},
                   {"certified", a.certified}};
  Json centers = Json::array();
  for (const Point& p : c.centers) centers.push_back(vector_json(p));
  j["spheres"] = {
      {"count", c.size()}, {"centers", std::move(centers)}, {"radii", c.radii}, {"triangle", c.triangle}};

  // One line for each key, the arrays of spheres on lines of their own: small enough, and a diff can be read.
  std::string text = "{\n";
  for (auto it = j.begin(); it != j.end(); ++it) {
    if (it != j.begin()) text += ",\n";
    text += "  \"" + it.key() + "\": ";
    if (it.key() != "spheres") {
      text += text_of(*it);
      continue;
    }
    text += "{";
    for (auto s = it->begin(); s != it->end(); ++s)
      text += std::string(s == it->begin() ? "\n" : ",\n") + "    \"" + s.key() + "\": " + text_of(*s);
    text += "\n  }";
  }
  return text + "\n}\n";
}

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
    }
    if (const Json* v = at(j, "volume_union")) c.volume_union = v->get<double>();
    if (const Json* v = at(j, "accuracy")) {
      Accuracy& a = c.accuracy;
      a.protrusion_max = v->value("protrusion_max", 0.0),
      a.protrusion_mean = v->value("protrusion_mean", 0.0);
      a.protrusion_p95 = v->value("protrusion_p95", 0.0), a.gap_max = v->value("gap_max", 0.0);
      a.gap_mean = v->value("gap_mean", 0.0), a.gap_p95 = v->value("gap_p95", 0.0);
      a.coverage = v->value("coverage", 0.0),
      a.normal_error_mean_deg = v->value("normal_error_mean_deg", 0.0);
      a.normal_error_p95_deg = v->value("normal_error_p95_deg", 0.0);
      a.volume_ratio = v->value("volume_ratio", 0.0), a.certified = v->value("certified", false);
    }
    const Json* spheres = at(j, "spheres");
    require(spheres != nullptr, where, "\"spheres\" is missing");
    const Json* centers = at(*spheres, "centers");
    require(centers && centers->is_array(), where, "\"spheres.centers\" is missing or no array");
    for (const Json& p : *centers) c.centers.push_back(vector_from(p));
    const Json* radii = at(*spheres, "radii");
    require(radii != nullptr, where, "\"spheres.radii\" is missing");
    c.radii = radii->get<std::vector<double>>();
    const Json* triangle = at(*spheres, "triangle");
    if (triangle)
      c.triangle = triangle->get<std::vector<std::int64_t>>();
    else
      c.triangle.assign(c.radii.size(), -1);
    if (const Json* count = at(*spheres, "count"))
      require(count->get<std::size_t>() == c.size(), where,
              "\"spheres.count\" is not the number of spheres: is the file whole?");
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
