// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/preview/scene_view.h"

#include <charconv>
#include <cmath>

#include "detect/body.h"
#include "padding/asset/error.h"
#include "padding/asset/excerpt.h"
#include "padding/asset/file.h"
#include "padding/asset/npz.h"
#include "padding/input/text.h"

namespace padder {
namespace {

constexpr std::uint64_t kMostSpheres = std::uint64_t(1) << 25;
constexpr std::string_view kHeader = "i,j,nx,ny,nz,depth,ix,iy,iz,jx,jy,jz";

ViewContact contact_of(std::uint64_t i, std::uint64_t j, const double* normal, double depth,
                       const double* on_i, const double* on_j) {
  ViewContact c;
  c.i = i, c.j = j, c.depth = depth;
  for (int k = 0; k < 3; k++) c.normal[k] = normal[k], c.at[k] = (on_i[k] + on_j[k]) / 2;
  return c;
}

std::vector<ViewContact> contacts_from_csv(std::string_view text, const std::string& where) {
  std::vector<ViewContact> out;
  bool header = false;
  reading::Lines lines(text);
  for (std::string_view line; lines.next(line);) {
    if (line.empty() || line[0] == '#') continue;
    const std::string place = where + ", line " + std::to_string(lines.number());
    if (!header) {
      if (line != kHeader)
        throw Error(place + ": this must be the header of a contact file: " + std::string(kHeader));
      header = true;
      continue;
    }
    double v[12];
    const char* at = line.data();
    const char* const stop = line.data() + line.size();
    for (int k = 0; k < 12; k++) {
      const auto [next, error] = std::from_chars(at, stop, v[k]);
      if (error != std::errc() || (k < 11 ? next == stop || *next != ',' : next != stop))
        throw Error(place + ": this must be twelve numbers with commas between them");
      at = next + (k < 11);
    }
    if (!(v[0] >= 0 && v[1] >= 0 && v[0] <= 4294967295.0 && v[1] <= 4294967295.0) ||
        v[0] != std::floor(v[0]) || v[1] != std::floor(v[1]))
      throw Error(place + ": i and j must be numbers of spheres, from 0 to 4294967295");
    out.push_back(contact_of(std::uint64_t(v[0]), std::uint64_t(v[1]), v + 2, v[5], v + 6, v + 9));
  }
  if (!header)
    throw Error(where + ": this is not a contact file: it does not begin with " + std::string(kHeader));
  return out;
}

std::vector<ViewContact> contacts_from_npz(std::string_view bytes, const std::string& where) {
  const Npz arrays = npz_from_bytes(bytes, where);
  const auto array = [&](const char* name) -> const NpyArray& {
    const auto it = arrays.find(name);
    if (it == arrays.end()) throw Error(where + ": array `" + name + "` is missing: is it a contact file?");
    return it->second;
  };
  const auto pairs = array("pairs").as<std::uint32_t>();
  const auto normals = array("normals").as<double>(), depths = array("depths").as<double>();
  const auto on_i = array("points_i").as<double>(), on_j = array("points_j").as<double>();
  const std::size_t n = depths.size();
  if (pairs.size() != 2 * n || normals.size() != 3 * n || on_i.size() != 3 * n || on_j.size() != 3 * n)
    throw Error(where + ": its arrays have different lengths");
  std::vector<ViewContact> out;
  for (std::size_t k = 0; k < n; k++)
    out.push_back(
        contact_of(pairs[2 * k], pairs[2 * k + 1], &normals[3 * k], depths[k], &on_i[3 * k], &on_j[3 * k]));
  return out;
}

}  // namespace

View view_of(const detect::Scene& scene, const std::string& title) {
  if (scene.size() > kMostSpheres)
    throw Error(title + " holds " + std::to_string(scene.size()) + " spheres: at most " +
                std::to_string(kMostSpheres) + " can be shown");
  View v;
  v.title = title, v.unit = scene.unit;
  const auto add = [&](const detect::Sphere& s, std::uint32_t family, std::uint32_t body) {
    v.centers.emplace_back(s.x, s.y, s.z);
    v.radii.push_back(s.r);
    v.family.push_back(family);
    v.body.push_back(body);
  };
  for (const detect::Body& body : scene.bodies) {
    const auto& asset = scene.assets[body.shape];
    const auto number = std::uint32_t(v.bodies.size());
    v.bodies.push_back({asset.name, v.size(), asset.spheres.size(), body.family, body.mask});
    for (const detect::Sphere& s : asset.spheres) add(detect::placed(body, s), body.family, number);
  }
  // A file of spheres is mapped and not in memory.
  if (scene.mapped) scene.mapped->check();
  const detect::LooseSpheres read =
      scene.mapped ? detect::loose_from(scene.spheres()) : detect::LooseSpheres();
  const detect::LooseSpheres& loose = scene.mapped ? read : scene.loose;
  for (std::uint64_t k = 0; k < loose.size(); k++) {
    detect::Sphere s;
    if (loose.scalar == detect::Scalar::f32)
      s = {loose.single[4 * k], loose.single[4 * k + 1], loose.single[4 * k + 2], loose.single[4 * k + 3]};
    else
      s = {loose.twice[4 * k], loose.twice[4 * k + 1], loose.twice[4 * k + 2], loose.twice[4 * k + 3]};
    if (detect::fault_of(s) != detect::Fault::none)
      throw Error(title + ": loose sphere " + std::to_string(k) + " is not finite, negative or beyond 1e100");
    add(s, loose.family.empty() ? 0 : loose.family[k], std::uint32_t(v.bodies.size()));
  }
  if (v.bodies.empty()) v.body.clear();
  v.note = counted(v.bodies.size(), "body", "bodies") + ", " + counted(loose.size(), "loose sphere");
  return v;
}

void add_contacts(View& view, const std::filesystem::path& path) {
  const std::string where = path.string(), ending = path.extension().string();
  if (ending != ".csv" && ending != ".npz") throw Error(where + ": contacts are read from .csv and .npz");
  const std::string bytes = read_file(path);
  view.contacts = ending == ".csv" ? contacts_from_csv(bytes, where) : contacts_from_npz(bytes, where);
  for (std::size_t k = 0; k < view.contacts.size(); k++) {
    const ViewContact& c = view.contacts[k];
    if (c.i >= view.size() || c.j >= view.size())
      throw Error(where + ": contact " + std::to_string(k) + " names sphere " +
                  std::to_string(std::max(c.i, c.j)) + ", but " + view.title + " has " +
                  std::to_string(view.size()) + ": it belongs to another scene or --copies");
    if (!c.at.allFinite() || !c.normal.allFinite() || !std::isfinite(c.depth))
      throw Error(where + ": contact " + std::to_string(k) + " holds a number that is not finite");
  }
}

}  // namespace padder
