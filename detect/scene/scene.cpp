// SPDX-License-Identifier: MIT
#include "detect/scene/scene.h"

#include <cmath>
#include <cstring>
#include <map>
#include <set>

#include "padding/asset/error.h"
#include "padding/asset/excerpt.h"
#include "padding/asset/file.h"
#include "padding/asset/json.h"

namespace padder::detect {
namespace {

using Json = nlohmann::json;
using Reader = JsonPlace<Json>;

Scene::Asset asset_of(const Cluster& c) {
  std::vector<Rung> rungs = rungs_of(c);
  return {c.name, rungs[0].spheres, c.mass, c.family, c.mask, std::move(rungs)};
}

// Gives bodies families that nothing else in the scene uses.
class Families {
 public:
  void use(std::uint32_t family) { used_.insert(family); }
  std::uint32_t next_unused() {
    while (used_.contains(next_)) next_++;
    return next_++;
  }

 private:
  std::set<std::uint32_t> used_;
  std::uint32_t next_ = 33;
};

using Assets = std::map<std::string, std::uint32_t>;  // numbers by name

Assets read_assets(const Reader& clusters, Scene& scene, const std::filesystem::path& folder) {
  Assets assets;
  if (!clusters.json().is_object()) clusters.fail("an object of names and files is wanted");
  for (const auto& [name, unused] : clusters.json().items()) {
    scene.files.push_back(folder / clusters.at(name).file());
    const Cluster c = read_cluster(scene.files.back());
    if (!c.unit.empty() && !scene.unit.empty() && c.unit != scene.unit)
      clusters.at(name).fail("the cluster is in " + excerpt(c.unit) + ", the scene in " +
                             excerpt(scene.unit) + ": pad it again in the scene's unit");
    if (scene.unit.empty()) scene.unit = c.unit;
    assets[name] = static_cast<std::uint32_t>(scene.assets.size());
    scene.assets.push_back(asset_of(c));
    scene.assets.back().name = name;
  }
  return assets;
}

void read_rotation(const Reader& r, Body& body) {
  double q[4];
  r.reals(q);
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (!(std::abs(length - 1) < 1e-3)) r.fail("a quaternion [w, x, y, z] of length 1 is wanted");
  rotation_of(q[0], q[1], q[2], q[3], body.rotation);
}

// A number, or "every".
std::uint32_t world_of(const Reader& r) {
  if (!r.json().is_string()) return r.bits();
  if (r.text() != "every") r.fail("a number or \"every\" is wanted");
  return kEveryWorld;
}

Body read_body(const Reader& r, const Scene& scene, const Assets& assets, bool& family_given) {
  r.only({"cluster", "position", "quaternion", "family", "mask", "scale", "static", "world"});
  Body body;
  const auto found = assets.find(r.at("cluster").text());
  if (found == assets.end()) r.at("cluster").fail("no cluster of that name is in \"clusters\"");
  body.shape = found->second;
  const Scene::Asset& asset = scene.assets[body.shape];
  r.at("position").reals(body.position);
  if (r.has("quaternion")) read_rotation(r.at("quaternion"), body);
  if (r.has("scale") && r.at("scale").real() != 1)
    r.at("scale").fail("only 1 is possible: scale the mesh when it is padded (pad --scale)");
  body.family = r.has("family") ? r.at("family").bits() : asset.family;
  body.mask = r.has("mask") ? r.at("mask").bits() : asset.mask;
  body.is_static = r.has("static") && r.at("static").truth();
  if (r.has("world")) body.world = world_of(r.at("world"));
  family_given = r.has("family") || body.family != 0;
  return body;
}

LooseSpheres read_inline(const Reader& r) {
  LooseSpheres l;
  l.scalar = Scalar::f64;
  const Reader centers = r.at("centers"), radii = r.at("radii");
  const bool one = radii.json().is_number();
  if (!one && radii.size() != centers.size())
    radii.fail("one radius for each centre is wanted, or one number for all");
  for (std::size_t k = 0; k < centers.size(); k++) {
    double c[3];
    centers.at(k).reals(c);
    l.twice.insert(l.twice.end(), {c[0], c[1], c[2], one ? radii.real() : radii.at(k).real()});
  }
  return l;
}

LooseSpheres read_loose(const Reader& r, const std::filesystem::path& folder) {
  r.only({"file", "generate", "count", "order", "centers", "radii", "family", "mask", "static", "world"});
  if (r.has("file") + r.has("generate") + r.has("centers") != 1)
    r.fail("one of \"file\", \"generate\" and \"centers\" is wanted");
  for (const auto& [key, kind] :
       {std::pair("count", "generate"), {"order", "generate"}, {"radii", "centers"}})
    if (r.has(key) && !r.has(kind))
      r.at(key).fail(std::string("only a block with \"") + kind + "\" has this: leave it out");
  LooseSpheres l;
  if (r.has("file")) {
    const std::filesystem::path path = folder / r.at("file").file();
    if (path.extension() == ".npz")
      l = loose_from_npz(read_file(path), path.string());
    else if (path.extension() == ".npy")
      l = loose_from(SphereFile(path).spheres());
    else if (path.extension() == ".csv")
      l = loose_from_csv(read_file(path), path.string());
    else
      r.at("file").fail("spheres are read from .npz, .npy and .csv");
  } else if (r.has("generate")) {
    const std::string order = r.has("order") ? r.at("order").text() : "random";
    if (order != "random" && order != "coherent") r.at("order").fail("\"random\" or \"coherent\" is wanted");
    l = loose_from(generate(r.at("generate").text(), r.at("count").whole(0xfffffffeu), order == "random"));
  } else {
    l = read_inline(r);
  }
  const auto tags = [&](const char* key, std::vector<std::uint32_t>& to, auto read) {
    if (!r.has(key)) return;
    const Reader t = r.at(key);
    if (!t.json().is_array()) {
      to.assign(l.size(), read(t));
      return;
    }
    if (t.size() != l.size()) t.fail("one number for each sphere is wanted, or one for all");
    to.clear();
    for (std::size_t k = 0; k < t.size(); k++) to.push_back(read(t.at(k)));
  };
  const auto bits = [](const Reader& t) { return t.bits(); };
  tags("family", l.family, bits), tags("mask", l.mask, bits), tags("world", l.world, world_of);
  if (r.has("static") && r.at("static").truth()) l.is_static.assign(l.size(), 1);
  return l;
}

// The file, if the scene's loose spheres are one file that can be mapped, and nothing else. Else null.
std::shared_ptr<const SphereFile> mapped_file(const Reader& spheres, const std::filesystem::path& folder) {
  if (spheres.size() != 1 || spheres.at(0).json().size() != 1 || !spheres.at(0).has("file")) return nullptr;
  const std::filesystem::path path = folder / spheres.at(0).at("file").file();
  const bool can_be = path.extension() == ".npy" || path.extension() == ".npz";
  return can_be ? std::make_shared<const SphereFile>(path) : nullptr;
}

void use_all(const Spheres& spheres, Families& families) {
  const char* const at = reinterpret_cast<const char*>(spheres.family);  // perhaps not aligned in its file
  for (std::uint64_t k = 0; at && k < spheres.count; k++) {
    std::uint32_t family;
    std::memcpy(&family, at + k * sizeof family, sizeof family);
    families.use(family);
  }
}

Scene scene_of(const Json& json, const std::string& where, const std::filesystem::path& folder,
               LooseAs loose) {
  const Reader r(json, where);
  r.only({"format", "version", "name", "unit", "clusters", "bodies", "spheres", "settle"});
  if (!r.has("format") || json["format"] != "padder.scene")
    r.fail("not a scene: \"format\" must be \"padder.scene\"");
  if (!r.has("version") || json["version"] != 1) r.fail("this program reads version 1 of the scene format");
  Scene scene;
  if (r.has("name")) r.at("name").text();
  if (r.has("unit")) scene.unit = r.at("unit").unit();
  Assets assets;
  if (r.has("clusters")) assets = read_assets(r.at("clusters"), scene, folder);
  Families families;
  std::vector<std::size_t> without;
  for (const Reader& body : r.all("bodies")) {
    bool given = false;
    scene.bodies.push_back(read_body(body, scene, assets, given));
    if (given)
      families.use(scene.bodies.back().family);
    else
      without.push_back(scene.bodies.size() - 1);
  }
  if (r.has("spheres")) {
    const Reader spheres = r.at("spheres");
    if (loose == LooseAs::mapped) scene.mapped = mapped_file(spheres, folder);
    for (const Reader& block : spheres.all()) {
      if (block.has("file")) scene.files.push_back(folder / block.at("file").file());
      if (!scene.mapped) scene.loose.append(read_loose(block, folder));
    }
    if (!without.empty()) use_all(scene.spheres(), families);
  }
  for (const std::size_t k : without) scene.bodies[k].family = families.next_unused();
  return scene;
}

}  // namespace

Input Scene::input() const {
  shapes_.clear();
  for (const Asset& a : assets) shapes_.push_back({a.spheres.data(), a.spheres.size()});
  Input input;
  input.spheres = spheres(), input.shapes = shapes_, input.bodies = bodies;
  return input;
}

std::uint64_t Scene::size() const {
  std::uint64_t n = spheres().count;
  for (const Body& b : bodies) n += assets[b.shape].spheres.size();
  return n;
}

Scene scene_from_json(std::string_view text, const std::string& where, const std::filesystem::path& folder) {
  const Json json = parse_json<Json>(text, where, "a scene of padder is wanted, as docs/scenes.md shows it");
  return scene_of(json, where, folder, LooseAs::memory);
}

Scene read_scene(const std::filesystem::path& path) {
  Scene scene = scene_from_json(read_file(path, kMostText), path.string(), path.parent_path());
  scene.files.push_back(path);
  return scene;
}

std::vector<Rung> rungs_of(const Cluster& c) {
  const auto cover = [](const std::vector<Point>& centers, const std::vector<double>& radii,
                        const Accuracy& a) {
    Rung r;
    for (std::size_t k = 0; k < radii.size(); k++)
      r.spheres.push_back({centers[k].x(), centers[k].y(), centers[k].z(), radii[k]});
    const bool is_solid = a.proved_against == SurfaceKind::input || a.proved_against == SurfaceKind::filled;
    if (a.certified && is_solid) r.protrusion = a.protrusion_max, r.gap = a.gap_max;
    return r;
  };
  std::vector<Rung> rungs = {cover(c.centers, c.radii, c.accuracy)};
  for (auto lod = c.lods.rbegin(); lod != c.lods.rend(); ++lod)
    rungs.push_back(cover(lod->centers, lod->radii, lod->accuracy));
  return rungs;
}

RungChoice choose_rungs(const Scene& scene, const RungRule& rule, double margin, const DeviceChoice& device) {
  std::vector<std::span<const Rung>> shapes(scene.assets.size());
  for (std::size_t k = 0; k < shapes.size(); k++) shapes[k] = scene.assets[k].rungs;
  return choose_rungs(shapes, scene.bodies, scene.spheres(), rule, margin, device);
}

void take_rungs(Scene& scene, const RungChoice& choice) {
  const auto first = static_cast<std::uint32_t>(scene.assets.size());
  for (const TakenShape& taken : take_rungs(scene.bodies, choice, first)) {
    Scene::Asset asset = scene.assets[taken.of];
    asset.spheres = taken.rung == kLeftOut ? std::vector<Sphere>() : asset.rungs[taken.rung].spheres;
    scene.assets.push_back(std::move(asset));
  }
}

Scene pile_of(const Cluster& cluster, std::uint64_t n) {
  Scene scene;
  scene.unit = cluster.unit;
  scene.assets.push_back(asset_of(cluster));
  const std::vector<Sphere>& spheres = scene.assets.front().spheres;
  if (spheres.empty()) throw Error("the cluster " + cluster.name + " has no spheres to copy");
  const Sphere center = ball_around(spheres);
  scene.bodies = pile(n, center.r);
  for (Body& b : scene.bodies) {
    const Sphere moved = placed(b, center);  // the lattice places centres, a pose places origins
    const double at[3] = {moved.x, moved.y, moved.z};
    for (int k = 0; k < 3; k++) b.position[k] -= at[k] - b.position[k];
    if (cluster.family) b.family = cluster.family;
    b.mask = cluster.mask;
  }
  return scene;
}

namespace {

void refuse_copies(std::uint64_t copies, const std::string& where, const char* why) {
  if (copies) throw Error(where + ": --copies is for a cluster; " + why);
}

}  // namespace

Scene read_scene_or_cluster(const std::filesystem::path& path, std::uint64_t copies, LooseAs loose) {
  if (path.extension() == ".npy" || path.extension() == ".npz") {
    refuse_copies(copies, path.string(), "a file of spheres has no bodies");
    Scene scene;
    scene.mapped = std::make_shared<const SphereFile>(path), scene.files = {path};
    return scene;
  }
  Scene scene = scene_or_cluster_from_json(read_file(path, kMostText), path.string(), path.parent_path(),
                                           copies, loose);
  scene.files.push_back(path);
  return scene;
}

Scene scene_or_cluster_from_json(std::string_view text, const std::string& where,
                                 const std::filesystem::path& folder, std::uint64_t copies, LooseAs loose) {
  const Json json = parse_json<Json>(
      text, where, "a scene or a cluster of padder is wanted; pad makes a cluster of a mesh or a robot");
  if (json.is_object() && json.value("format", Json()) == "padder.cluster")
    return pile_of(cluster_from_json(text, where), copies ? copies : 1);
  refuse_copies(copies, where, "a scene lists its bodies itself");
  return scene_of(json, where, folder, loose);
}

}  // namespace padder::detect
