// SPDX-License-Identifier: MIT
#include "padding/import/import.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "padding/asset/child.h"
#include "padding/asset/excerpt.h"
#include "padding/asset/file.h"
#include "padding/import/readers.h"

namespace padder {
namespace {

using importing::Content;
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
  throw Error(where + " has no part called \"" + excerpt(wanted) +
              "\": " + (names.empty() ? "it holds one part, so leave the name out" : "there are " + names));
}

// A cluster has one family and one mask, so all its spheres must agree.
std::uint32_t common(const std::vector<std::uint32_t>& values, const char* what, const std::string& where) {
  if (values.empty()) return 0;
  if (std::set<std::uint32_t>(values.begin(), values.end()).size() > 1)
    throw Error(where + ": its spheres are of several " + what +
                ", and a cluster is one body with one: split the file");
  return values[0];
}

bool is_any_of(const std::string& ending, std::initializer_list<const char*> endings) {
  return std::ranges::any_of(endings, [&](const char* e) { return ending == e; });
}

Content from_child(const std::function<Content()>& read, std::size_t file_size, const std::string& where) {
  Content content;
  const auto send = [&](ChildPipe& pipe) {
    bool sent = pipe.put_array(content.unit) && pipe.put(content.links) && pipe.put(content.switched_off) &&
                pipe.put<std::uint64_t>(content.parts.size());
    for (const Part& p : content.parts)
      sent = sent && pipe.put_array(p.name) && pipe.put_array(p.centers) && pipe.put_array(p.radii) &&
             pipe.put_array(p.family) && pipe.put_array(p.mask);
    sent = sent && pipe.put<std::uint64_t>(content.apart.size());
    for (const auto& pair : content.apart)
      sent = sent && pipe.put_array(pair.a) && pipe.put_array(pair.b) && pipe.put_array(pair.reason);
    return sent;
  };
  const auto receive = [&](ChildPipe& pipe) {
    std::uint64_t left = 0;
    bool sound = pipe.get_array(content.unit) && pipe.get(content.links) && pipe.get(content.switched_off) &&
                 pipe.get(left);
    for (; sound && left > 0; left--) {
      Part& p = content.parts.emplace_back();
      sound = pipe.get_array(p.name) && pipe.get_array(p.centers) && pipe.get_array(p.radii) &&
              pipe.get_array(p.family) && pipe.get_array(p.mask) && p.centers.size() == p.radii.size();
    }
    for (sound = sound && pipe.get(left); sound && left > 0; left--) {
      auto& pair = content.apart.emplace_back();
      sound = pipe.get_array(pair.a) && pipe.get_array(pair.b) && pipe.get_array(pair.reason);
    }
    return sound;
  };
  in_child([&] { content = read(); }, send, receive, file_size, where);
  return content;
}

// Of every format but our own.
Content content_of(const fs::path& path) {
  const std::string where = path.string(), ending = ending_of(path);
  std::error_code code;
  if (fs::is_directory(path, code)) return importing::read_mercury(path);
  if (is_any_of(ending, {".glb", ".usda", ".h", ".hpp"}))
    throw Error(where + ": spheres are written to " + ending +
                " but not read from it: use .spheres.json or .npz");
  if (is_any_of(ending, {".obj", ".stl", ".ply", ".off", ".gltf", ".fbx", ".dae", ".3ds", ".3mf", ".msh"}))
    throw Error(where + ": spheres are not read from " + ending +
                ": if it is a mesh, make spheres of it with pad, in Python with pad_file");
  const bool text = !is_any_of(ending, {".csv", ".npz", ".vtp"});
  const std::string bytes = read_file(path, text ? kMostText : kMostBytes);
  return from_child(
      [&]() -> Content {
        if (ending == ".csv") return importing::read_csv(bytes, where);
        if (ending == ".npz") return importing::read_npz(bytes, where);
        if (ending == ".vtp") return importing::read_vtp(bytes, where);
        if (is_any_of(ending, {".yaml", ".yml", ".xrdf"})) return importing::read_yaml(bytes, where);
        if (is_any_of(ending, {".urdf", ".srdf", ".xml"})) return importing::read_xml(bytes, where);
        return importing::read_list(bytes, where);
      },
      bytes.size(), where);
}

Cluster cluster_of(Part p, const std::string& unit, const fs::path& path) {
  const std::string where = path.string();
  Cluster c;
  c.name = p.name.empty() ? path.stem().string() : p.name;
  c.unit = unit, c.source.file = path.filename().string();
  c.centers = std::move(p.centers), c.radii = std::move(p.radii);
  c.triangle.assign(c.size(), -1);
  c.family = common(p.family, "families", where), c.mask = common(p.mask, "masks", where);
  for (std::size_t k = 0; k < c.size(); k++) {
    if (!c.centers[k].allFinite() || !std::isfinite(c.radii[k]) || !(c.radii[k] > 0))
      throw Error(where + ": sphere " + std::to_string(k) + " of " + excerpt(c.name) +
                  " is not finite or has no positive radius");
    c.bounds.add_ball(c.centers[k], c.radii[k]);
  }
  return c;
}

bool is_own(const fs::path& path) {
  std::error_code code;
  return ending_of(path) == ".json" && !fs::is_directory(path, code);
}

}  // namespace

std::string importing::unit_of(const std::vector<double>& array, const std::string& where) {
  for (const char* unit : {"m", "cm", "mm", "in"})  // a program may have saved it as a float
    if (array.size() == 1 && std::abs(array[0] / metres(unit) - 1) < 1e-6) return unit;
  throw Error(where + ": " + kUnitInMetres + " must be one number: 1, 0.01, 0.001 or 0.0254");
}

Cluster read_spheres(const fs::path& path, const std::string& part) {
  if (is_own(path)) return cluster_from_json(read_file(path, kMostText), path.string());
  Content content = content_of(path);
  return cluster_of(chosen(std::move(content.parts), part, path.string()), content.unit, path);
}

bool is_sphere_file(const fs::path& path) {
  if (std::error_code code; fs::is_directory(path, code)) return !importing::mercury_spheres(path).empty();
  return is_any_of(ending_of(path), {".json", ".csv", ".npz", ".vtp", ".yaml", ".yml", ".xrdf", ".srdf",
                                     ".xml", ".txt", ".dat", ".multisphere"});
}

SphereModel read_sphere_model(const fs::path& path) {
  if (is_own(path)) return {model_of(read_spheres(path)), false};
  Content content = content_of(path);
  std::erase_if(content.parts, [](const Part& p) { return p.radii.empty(); });
  if (content.parts.empty()) throw Error(path.string() + ": there is no sphere in it");
  SphereModel out;
  out.model.name = path.stem().string(), out.model.unit = content.unit;
  out.links = content.links && content.parts.size() > 1, out.switched_off = content.switched_off;
  std::map<std::string, std::size_t> index;
  for (Part& p : content.parts) {
    Body body;
    body.cluster = cluster_of(std::move(p), content.unit, path);
    body.name = body.cluster.name;
    index.emplace(body.name, out.model.bodies.size());
    out.model.bodies.push_back(std::move(body));
  }
  for (const auto& pair : content.apart) {  // a link without spheres is none of the bodies
    const auto a = index.find(pair.a), b = index.find(pair.b);
    if (a != index.end() && b != index.end() && a != b)
      out.model.apart.push_back({a->second, b->second, pair.reason});
  }
  return out;
}

}  // namespace padder
