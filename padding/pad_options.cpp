// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/pad_options.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "padding/asset/error.h"

namespace padder {
namespace {

const char* name_of(RepairMode mode) {
  switch (mode) {
    case RepairMode::never:
      return "never";
    case RepairMode::wrap:
      return "wrap";
    default:
      return "auto";
  }
}

const char* name_of(Balance balance) {
  switch (balance) {
    case Balance::volume:
      return "volume";
    case Balance::mean:
      return "mean";
    default:
      return "none";
  }
}

}  // namespace

std::string settings_json(const PadOptions& options, double diagonal, double edge_length) {
  nlohmann::ordered_json j;
  const auto length = [&](const char* name, const Length& l) {
    if (l.given()) j[name] = l.of(diagonal);
  };
  if (!options.by_tolerance() || options.depth) {
    j["depth"] = options.depth_used();
    j["edge_length"] = edge_length;
    j["sharp_angle"] = options.sharp_angle;
  }
  length("tolerance", options.tolerance);
  if (options.max_spheres > 0) j["max_spheres"] = options.max_spheres;
  length("min_radius", options.min_radius);
  length("max_radius", options.max_radius);
  if (options.by_tolerance()) {
    j["balance"] = name_of(options.balance);
    j["effort"] = options.effort;
  }
  if (options.smooth > 0) j["smooth"] = options.smooth;
  for (const Length& l : options.lod) j["lod"].push_back(l.of(diagonal));
  length("reach", options.reach);
  j["repair"] = name_of(options.repair);
  if (options.force) j["force"] = true;
  return j.dump();
}

std::optional<Length> length_of(std::string_view text) {
  Length length;
  if (text.ends_with('%')) {
    length.share = true;
    text.remove_suffix(1);
    while (text.ends_with(' ')) text.remove_suffix(1);
  }
  // from_chars takes no blank, no sign of plus and no 0x, but words for what is not finite.
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), length.value);
  if (code != std::errc() || end != text.data() + text.size()) return std::nullopt;
  if (length.share) length.value /= 100;
  if (!std::isfinite(length.value) || !(length.value > 0)) return std::nullopt;
  return length;
}

void check(const PadOptions& options) {
  const double depth = options.depth_used();
  if (!(depth > 0 && depth <= 1)) throw Error("the depth ratio must be above 0 and at most 1");
  for (const Length* l :
       {&options.edge_length, &options.tolerance, &options.min_radius, &options.max_radius, &options.reach})
    if (!(l->value >= 0) || !std::isfinite(l->value)) throw Error("a length must be positive and finite");
  for (const Length& l : options.lod)
    if (!(l.value > 0) || !std::isfinite(l.value))
      throw Error("each tolerance of a ladder must be positive and finite");
  if (!(options.smooth >= 0 && options.smooth < 180))
    throw Error("the mean normal error asked for (smooth) must be from 0 to 180 degrees");
  if (!(options.sharp_angle >= 1 && options.sharp_angle <= 180))
    throw Error("the sharp angle must be from 1 to 180 degrees");
  if (options.max_spheres > 0xffffffffu) throw Error("there can be no more than 4294967295 spheres");
  if (!(options.effort >= 0 && options.effort <= 3)) throw Error("the effort must be 0, 1, 2 or 3");
  if (!options.lod.empty() && (options.tolerance.given() || options.max_spheres > 0 || options.depth))
    throw Error("a ladder of tolerances stands alone: leave out the depth, the tolerance and the count");
  if (options.depth && options.max_spheres > 0)
    throw Error("a depth ratio and a count exclude each other: leave out one of them");
  if (options.depth && options.by_tolerance() && (options.balance != Balance::none || options.smooth > 0))
    throw Error("balance and smooth choose their own spheres: leave out the depth ratio");
  const bool by_depth = options.depth || !options.by_tolerance();
  if (by_depth && (options.min_radius.given() || options.max_radius.given() ||
                   options.balance != Balance::none || options.smooth > 0))
    throw Error(
        "radius limits, balance and smooth do nothing to the spheres of a depth ratio: ask for a tolerance "
        "or a count, without a depth ratio");
}

void check_meant(const PadOptions& options, const Box& box, const std::string& name) {
  if (options.force) return;
  const double diagonal = box.diagonal(), thinnest = (box.high - box.low).minCoeff();
  const auto refuse = [&](const char* what, const Length& l, const std::string& why) {
    char amount[80];
    std::snprintf(amount, sizeof amount, "%.6g (%.4g %% of the diagonal)", l.of(diagonal),
                  100 * l.of(diagonal) / diagonal);
    throw Error(
        name + ": " + what + " of " + amount + " " + why +
        ": a share of the diagonal is written as 5%, a length in the mesh's own unit; --force takes it "
        "all the same");
  };
  if (options.min_radius.given() && options.max_radius.given() &&
      options.min_radius.of(diagonal) > options.max_radius.of(diagonal))
    refuse("a smallest radius", options.min_radius, "is above the largest one");
  char extent[40];
  std::snprintf(extent, sizeof extent, "%.4g", thinnest);
  const double widest = std::max(0.5 * thinnest, 0.1 * diagonal);
  std::vector<Length> tolerances = options.lod;
  tolerances.push_back(options.tolerance);
  for (const Length& l : tolerances)
    if (l.of(diagonal) > widest)
      refuse("a tolerance", l, std::string("is beyond half the part's thinnest extent of ") + extent);
  const double half = 0.5 * diagonal;
  if (options.edge_length.of(diagonal) > half)
    refuse("an edge length", options.edge_length, "is beyond half the diagonal");
  if (options.min_radius.of(diagonal) > half)
    refuse("a smallest radius", options.min_radius, "is beyond half the diagonal");
  if (options.reach.of(diagonal) > half) refuse("a reach", options.reach, "is beyond half the diagonal");
  if (options.reach.given() && options.reach.of(diagonal) < diagonal / 2000)
    refuse("a reach", options.reach, "is below a 2000th of the diagonal, and would take hours");
}

}  // namespace padder
