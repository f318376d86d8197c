// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/pad_options.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "padding/asset/error.h"
#include "padding/asset/excerpt.h"

namespace padder {
namespace {

// The name of a value in kRepairModes or kBalances.
template <class Names, class Value>
const char* name_in(const Names& names, Value value) {
  return std::ranges::find(names, value, [](const auto& named) { return named.second; })->first;
}

}  // namespace

std::string settings_json(const PadOptions& options, double diagonal, double edge_length) {
  nlohmann::ordered_json j;
  const auto length = [&](const char* name, const Length& l) {
    if (l.given()) j[name] = l.absolute(diagonal);
  };
  if (options.by_depth()) {
    j["depth"] = options.depth_ratio_used();
    j["edge_length"] = edge_length;
    j["sharp_angle"] = options.sharp_angle;
  }
  length("tolerance", options.tolerance);
  if (options.protrusion) j["protrusion"] = options.protrusion->absolute(diagonal);
  if (options.gap) j["gap"] = options.gap->absolute(diagonal);
  if (options.max_spheres > 0) j["max_spheres"] = options.max_spheres;
  length("min_radius", options.min_radius);
  length("max_radius", options.max_radius);
  if (options.by_tolerance()) {
    j["balance"] = name_in(kBalances, options.balance);
    j["effort"] = options.effort;
  }
  if (options.smooth > 0) j["smooth"] = options.smooth;
  for (const Length& l : options.lod) j["lod"].push_back(l.absolute(diagonal));
  length("reach", options.min_grain_radius);  // its name on the command line
  j["repair"] = name_in(kRepairModes, options.repair);
  length("thickness", options.thickness);
  if (options.force) j["force"] = true;
  return j.dump();
}

namespace {

void check_each_error(const PadOptions& options) {
  for (const auto& l : {options.protrusion, options.gap})
    if (l && (!(l->value() >= 0) || !std::isfinite(l->value())))
      throw Error("a protrusion and a gap must be 0 or positive, and finite");
  if (!options.tolerance.given() && !(options.protrusion && options.gap))
    throw Error(std::string("a ") + (options.gap ? "gap" : "protrusion") + " needs a " +
                (options.gap ? "protrusion" : "gap") + ", too: give it, or a tolerance in its place");
  if (!options.protrusion_used().given() && !options.gap_used().given())
    throw Error(
        "spheres that neither stand out of the body nor leave a gap do not exist: allow one of both errors");
  if (options.depth_ratio || options.max_spheres > 0 || !options.lod.empty() || options.smooth > 0 ||
      options.balance != Balance::none)
    throw Error(
        "a protrusion and a gap by themselves exclude a depth ratio, a count, a ladder, a balance and "
        "smoothness: leave these out");
}

}  // namespace

void check(const PadOptions& options) {
  if (options.each_error()) check_each_error(options);
  const double depth_ratio = options.depth_ratio_used();
  if (!(depth_ratio > 0 && depth_ratio <= 1)) throw Error("the depth ratio must be above 0 and at most 1");
  for (const Length* l : {&options.edge_length, &options.tolerance, &options.min_radius, &options.max_radius,
                          &options.min_grain_radius, &options.thickness})
    if (!(l->value() >= 0) || !std::isfinite(l->value())) throw Error("a length must be positive and finite");
  for (const Length& l : options.lod)
    if (!(l.value() > 0) || !std::isfinite(l.value()))
      throw Error("each tolerance of a ladder must be positive and finite");
  if (!(options.smooth >= 0 && options.smooth < 180))
    throw Error("the mean normal error asked for (smooth) must be from 0 to 180 degrees");
  if (!(options.sharp_angle >= 1 && options.sharp_angle <= 180))
    throw Error("the sharp angle must be from 1 to 180 degrees");
  if (options.min_grain_radius.given() && options.repair != RepairMode::automatic &&
      options.repair != RepairMode::wrap)
    throw Error("a reach wraps the mesh: leave out the repair, or choose wrap");
  if (options.thickness.given() && (options.repair == RepairMode::wrap || options.min_grain_radius.given()))
    throw Error(
        "a thickness has no effect on a wrap, which has an inside and no sheets: leave it out, or leave out "
        "the reach and the repair by a wrap");
  if (options.max_spheres > 0xffffffffu) throw Error("the number of spheres can be at most 4294967295");
  if (!(options.effort >= 0 && options.effort <= 3)) throw Error("the effort must be 0, 1, 2 or 3");
  if (!options.lod.empty() && (options.tolerance.given() || options.max_spheres > 0 || options.depth_ratio))
    throw Error("a ladder of tolerances excludes a depth ratio, a tolerance and a count: leave these out");
  if (options.lower_bound && !options.by_tolerance())
    throw Error(
        "a lower bound needs a tolerance or a count: without one, there is a sphere for each triangle");
  if (options.edge_length.given() && !options.by_depth())
    throw Error(
        "an edge length has no effect on spheres that a tolerance or a count chooses: leave it out, or give "
        "a depth ratio as well");
  if (options.sharp_angle != PadOptions().sharp_angle && !options.by_depth())
    throw Error(
        "a sharp angle has no effect on spheres that a tolerance or a count chooses: leave it out, or give a "
        "depth ratio as well");
  if (options.depth_ratio && options.max_spheres > 0)
    throw Error("a depth ratio and a count exclude each other: leave out one of them");
  if (options.depth_ratio && options.by_tolerance() &&
      (options.balance != Balance::none || options.smooth > 0))
    throw Error("balance and smooth need spheres that the tolerance chooses: leave out the depth ratio");
  if (options.by_depth() && (options.min_radius.given() || options.max_radius.given() ||
                             options.balance != Balance::none || options.smooth > 0))
    throw Error(
        "radius limits, balance and smooth have no effect on the spheres of a depth ratio: ask for a "
        "tolerance or a count, without a depth ratio");
}

void check_meant(const PadOptions& options, const Box& box, const std::string& name) {
  const double diagonal = box.diagonal(), thinnest = (box.high - box.low).minCoeff();
  for (const Length& l : {options.protrusion_used(), options.gap_used()})
    if (l.absolute(diagonal) > 1e6 * diagonal)
      throw Error(name + ": a tolerance of " + short_number(l.absolute(diagonal), 6) +
                  " is beyond a million diagonals: use a smaller one");
  if (options.force) return;
  const auto named = [&](const char* what, const Length& l) {
    const double length = l.absolute(diagonal);
    return std::string(what) + " of " + short_number(length, 6) + " (" +
           short_number(100 * length / diagonal, 4) + " % of the diagonal)";
  };
  if (options.min_radius.given() && options.max_radius.given() &&
      options.min_radius.absolute(diagonal) > options.max_radius.absolute(diagonal))
    throw Error(name + ": " + named("a smallest radius", options.min_radius) + " is above " +
                named("the largest one", options.max_radius) +
                ": use a smaller --min-radius or a larger --max-radius");
  const auto refuse = [&](const char* what, const Length& l, const std::string& why) {
    throw Error(
        name + ": " + named(what, l) + " " + why +
        ": write a share of the diagonal with a % sign, as 5%, and a length in the mesh's own unit without "
        "one; --force (force=True in Python) accepts it as it is");
  };
  const double widest = std::max(0.5 * thinnest, 0.1 * diagonal);
  std::vector<Length> tolerances = options.lod;
  tolerances.push_back(options.protrusion_used());
  tolerances.push_back(options.gap_used());
  for (const Length& l : tolerances)
    if (l.absolute(diagonal) > widest)
      refuse("a tolerance", l, "is beyond half the part's thinnest extent of " + short_number(thinnest, 4));
  const double half = 0.5 * diagonal;
  if (options.edge_length.absolute(diagonal) > half)
    refuse("an edge length", options.edge_length, "is beyond half the diagonal");
  if (options.min_radius.absolute(diagonal) > half)
    refuse("a smallest radius", options.min_radius, "is beyond half the diagonal");
  if (options.min_grain_radius.absolute(diagonal) > half)
    refuse("a reach", options.min_grain_radius, "is beyond half the diagonal");
  if (options.min_grain_radius.given() && options.min_grain_radius.absolute(diagonal) < diagonal / 2000)
    refuse("a reach", options.min_grain_radius, "is below a 2000th of the diagonal, and would take hours");
}

}  // namespace padder
