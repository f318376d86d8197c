// SPDX-License-Identifier: MIT
#include "padding/import/import.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "padding/asset/child.h"
#include "padding/asset/excerpt.h"
#include "padding/asset/file.h"
#include "padding/import/readers.h"

namespace padder {
namespace {

using importing::Part;
using importing::Parts;
namespace fs = std::filesystem;

Part chosen(Parts parts, const std::string& wanted, const std::string& where) {
  std::erase_if(parts, [](const Part& p) { return p.radii.empty(); });
  if (parts.empty()) throw Error(where + ": there is no sphere in it");
  std::string names;
  for (std::size_t k = 0; k < std::min<std::size_t>(parts.size(), 20); k++)
    names += (k ? ", " : "") + excerpt(parts[k].name);
  if (parts.size() > 20) names += " …";
  if (wanted.empty()) {
    if (parts.size() > 1)
      throw Error(where + " holds " + std::to_string(parts.size()) + " parts: name one of " + names);
    return std::move(parts[0]);
  }
  const auto named = [&](const Part& p) { return p.name == wanted; };
  if (std::ranges::count_if(parts, named) > 1)
    throw Error(where + " has several parts called \"" + excerpt(wanted) + "\": give each a name of its own");
  for (Part& p : parts)
    if (named(p)) return std::move(p);
  throw Error(where + " has no part called \"" + excerpt(wanted) + "\": there are " + names);
}

// A cluster has one family and one mask, so all its spheres must agree.
std::uint32_t common(const std::vector<std::uint32_t>& values, const char* what, const std::string& where) {
  if (values.empty()) return 0;
  if (std::set<std::uint32_t>(values.begin(), values.end()).size() > 1)
    throw Error(where + ": its spheres are of several " + what +
                ", and a cluster is one body with one: split the file");
  return values[0];
}

std::string ending_of(const fs::path& path) {
  std::string ending = path.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  return ending;
}

bool is_any_of(const std::string& ending, std::initializer_list<const char*> endings) {
  return std::ranges::any_of(endings, [&](const char* e) { return ending == e; });
}

Parts from_child(const std::function<Parts()>& read, std::size_t file_size, const std::string& where) {
  Parts parts;
  const auto send = [&](ChildPipe& pipe) {
    bool sent = pipe.put<std::uint64_t>(parts.size());
    for (const Part& p : parts)
      sent = sent && pipe.put_array(p.name) && pipe.put_array(p.centers) && pipe.put_array(p.radii) &&
             pipe.put_array(p.family) && pipe.put_array(p.mask);
    return sent;
  };
  const auto receive = [&](ChildPipe& pipe) {
    std::uint64_t left = 0;
    bool sound = pipe.get(left);
    for (; sound && left > 0; left--) {
      Part& p = parts.emplace_back();
      sound = pipe.get_array(p.name) && pipe.get_array(p.centers) && pipe.get_array(p.radii) &&
              pipe.get_array(p.family) && pipe.get_array(p.mask) && p.centers.size() == p.radii.size();
    }
    return sound;
  };
  in_child([&] { parts = read(); }, send, receive, file_size, where);
  return parts;
}

// Of every format but our own.
Parts parts_of(const fs::path& path) {
  const std::string where = path.string(), ending = ending_of(path);
  std::error_code code;
  if (fs::is_directory(path, code)) return importing::read_mercury(path);
  if (is_any_of(ending, {".glb", ".usda", ".h", ".hpp"}))
    throw Error(where + ": spheres are written to " + ending +
                " but not read from it: use .spheres.json or .npz");
  const bool text = !is_any_of(ending, {".csv", ".npz", ".vtp"});
  const std::string bytes = read_file(path, text ? kMostText : kMostBytes);
  return from_child(
      [&] {
        if (ending == ".csv") return importing::read_csv(bytes, where);
        if (ending == ".npz") return importing::read_npz(bytes, where);
        if (ending == ".vtp") return importing::read_vtp(bytes, where);
        if (is_any_of(ending, {".yaml", ".yml", ".xrdf"})) return importing::read_yaml(bytes, where);
        if (is_any_of(ending, {".urdf", ".srdf", ".xml"})) return importing::read_xml(bytes, where);
        return importing::read_list(bytes, where);
      },
      bytes.size(), where);
}

Cluster cluster_of(Part p, const fs::path& path) {
  const std::string where = path.string();
  Cluster c;
  c.name = p.name.empty() ? path.stem().string() : p.name;
  c.source.file = path.filename().string();
  c.centers = std::move(p.centers), c.radii = std::move(p.radii);
  c.triangle.assign(c.size(), -1);
  c.family = common(p.family, "families", where), c.mask = common(p.mask, "masks", where);
  for (std::size_t k = 0; k < c.size(); k++) {
    if (!c.centers[k].allFinite() || !std::isfinite(c.radii[k]) || !(c.radii[k] > 0))
      throw Error(where + ": sphere " + std::to_string(k) + " of " + excerpt(c.name) +
                  " is not finite or has no positive radius");
    c.bounds.add(c.centers[k] - Vector::Constant(c.radii[k])),
        c.bounds.add(c.centers[k] + Vector::Constant(c.radii[k]));
  }
  return c;
}

bool is_own(const fs::path& path) {
  std::error_code code;
  return ending_of(path) == ".json" && !fs::is_directory(path, code);
}

}  // namespace

Cluster read_spheres(const fs::path& path, const std::string& part) {
  if (is_own(path)) return cluster_from_json(read_file(path, kMostText), path.string());
  return cluster_of(chosen(parts_of(path), part, path.string()), path);
}

bool is_sphere_file(const fs::path& path) {
  return is_any_of(ending_of(path), {".json", ".csv", ".npz", ".vtp", ".yaml", ".yml", ".xrdf", ".srdf",
                                     ".xml", ".txt", ".dat", ".multisphere"});
}

SphereModel read_sphere_model(const fs::path& path) {
  if (is_own(path)) return {model_of(read_spheres(path)), false};
  Parts parts = parts_of(path);
  std::erase_if(parts, [](const Part& p) { return p.radii.empty(); });
  if (parts.empty()) throw Error(path.string() + ": there is no sphere in it");
  SphereModel out;
  out.model.name = path.stem().string();
  const std::string ending = ending_of(path);
  const bool in_metres = is_any_of(ending, {".yaml", ".yml", ".xrdf", ".srdf", ".xml"});
  if (in_metres) out.model.unit = "m";
  out.links = in_metres && parts.size() > 1;
  for (Part& p : parts) {
    Body body;
    body.cluster = cluster_of(std::move(p), path);
    body.cluster.unit = out.model.unit;
    body.name = body.cluster.name;
    out.model.bodies.push_back(std::move(body));
  }
  return out;
}

}  // namespace padder
