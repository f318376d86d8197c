// SPDX-License-Identifier: MIT
#include "padding/import/import.h"

#include <algorithm>
#include <set>

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

}  // namespace

Cluster read_spheres(const fs::path& path, const std::string& part) {
  const std::string where = path.string();
  std::error_code code;
  Parts parts;
  std::string ending = path.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  if (fs::is_directory(path, code)) {
    parts = importing::read_mercury(path);
  } else {
    const bool text = ending != ".csv" && ending != ".npz" && ending != ".vtp";
    const std::string bytes = read_file(path, text ? kMostText : kMostBytes);
    if (ending == ".json") return cluster_from_json(bytes, where);
    if (ending == ".csv")
      parts = importing::read_csv(bytes, where);
    else if (ending == ".npz")
      parts = importing::read_npz(bytes, where);
    else if (ending == ".vtp")
      parts = importing::read_vtp(bytes, where);
    else if (ending == ".yaml" || ending == ".yml" || ending == ".xrdf")
      parts = importing::read_yaml(bytes, where);
    else if (ending == ".urdf" || ending == ".srdf" || ending == ".xml")
      parts = importing::read_xml(bytes, where);
    else if (ending == ".glb" || ending == ".usda" || ending == ".h" || ending == ".hpp")
      throw Error(where + ": spheres are written to " + ending +
                  " but not read from it: use .spheres.json or .npz");
    else
      parts = importing::read_list(bytes, where);
  }
  Part p = chosen(std::move(parts), part, where);
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

}  // namespace padder
