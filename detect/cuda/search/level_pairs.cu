// SPDX-License-Identifier: MIT
#include "detect/cuda/search/level_pairs.h"

#include <algorithm>
#include <cmath>

#include "detect/cuda/tuning.h"

namespace padder::detect::cuda {
namespace {

// A finer level's bins that a sphere may reach at most in fixed point, modulo 256 bins.
constexpr double kWidest = 100;

// May spheres that reach so many of the finer level's bins search it by rows? The rows within reach are
// numbered, and a row's number is divided by their number along y (find_rows): the product of both must fit
// 32 bits. In a hashed level each bin must have a bucket of its own.
bool searchable(const Level& fine, double reach, SlotKind kind) {
  if (kind == SlotKind::fixed_point && reach > kWidest) return false;
  const double wide = 2 * reach + 3;
  if (fine.hashed) return wide < fine.side;
  const double y = std::min<double>(wide, fine.count[1]), z = std::min<double>(wide, fine.count[2]);
  return y < 0x1p16 && y * y * z < 0x1p32;
}

// Do the bounds of two levels lie so far from each other that none of their spheres touch? By one bin more,
// since a sphere's bin in float may be the next one.
bool lie_apart(const Level& a, const Level& b) {
  const double apart = 1.01 * (a.radius_max + b.radius_max) + a.size + b.size;
  if (a.hashed || b.hashed) return false;
  for (int c = 0; c < 3; c++) {
    const auto low = [c](const Level& l) { return static_cast<double>(l.first[c]) * l.size; };
    const auto high = [c](const Level& l) {
      return static_cast<double>(l.first[c] + static_cast<std::int64_t>(l.count[c])) * l.size;
    };
    if (low(a) > high(b) + apart || low(b) > high(a) + apart) return true;
  }
  return false;
}

// How the spheres of the coarser level are grouped, or their rows divided, so that a unit finds about as many
// contacts as a warp's queue holds. `reach`: of the largest, in bins of the finer level.
void divide_rows(LevelPair& d, const Level& coarse, const Level& fine, double reach, bool fused) {
  const double most_contacts = fused ? tuning::kFusedUnitContacts : tuning::kUnitContacts,
               part_contacts = fused ? tuning::kFusedPartContacts : tuning::kPartContacts;
  double rows = 1;  // at most
  for (int c = 1; c < 3; c++)
    rows *= fine.hashed ? 2 * reach + 2 : std::min<double>(2 * reach + 2, fine.count[c]);
  double full = 4.19 * static_cast<double>(fine.spheres);  // contacts of a sphere that reaches one bin far
  // Where a hashed level has spheres, it has about one in a bin, however many bins are empty.
  if (fine.hashed)
    full = 4.19;
  else
    full /= fine.filled * fine.count[0] * fine.count[1] * fine.count[2];
  d.density = static_cast<float>(full / 4.19);
  // A usual sphere has three quarters of the largest radius: most are smaller.
  const double usual = (0.75 * coarse.radius_max + fine.radius_max) * fine.per_size,
               contacts = full * usual * usual * usual + 1e-9;
  d.group = d.parts = 1;
  if (contacts < most_contacts)
    d.group = static_cast<std::uint32_t>(
        std::clamp(std::min(most_contacts / contacts, tuning::kUnitRows / rows), 1.0, 32.0));
  if (d.group == 1) {
    const double parts = std::max(full / part_contacts, rows / tuning::kUnitRows / (reach * reach * reach));
    d.parts_at_one = static_cast<float>(parts);
    // No more than for all spheres of the finer level, wherever the others' rows may be.
    const double enough =
        2 * static_cast<double>(fine.spheres) / part_contacts + 2 * rows / tuning::kUnitRows;
    d.parts = static_cast<std::uint32_t>(
        std::clamp(std::ceil(std::min(parts * reach * reach * reach, enough)), 1.0, std::max(1.0, rows / 2)));
  }
}

}  // namespace

LevelPairs plan_level_pairs(const Grid& grid, SlotKind kind, bool fused) {
  LevelPairs pairs;
  std::uint64_t first = 0, spheres = 0, units = 0, warps = 0;
  for (int c = 0; c < grid.levels; c++) spheres += grid.level[c].spheres;
  if (spheres >= kOfUnit) return {};
  for (int c = 0; c < grid.levels; c++) {
    const Level& coarse = grid.level[c];
    for (int f = 0; f < c; f++) {
      const Level& fine = grid.level[f];
      LevelPair d{};
      d.coarse = c, d.fine = f, d.group = d.parts = d.warp_units = d.step = 1;
      d.first = d.end = static_cast<std::uint32_t>(first);
      d.first_unit = static_cast<std::uint32_t>(units), d.first_warp = static_cast<std::uint32_t>(warps);
      if (lie_apart(coarse, fine)) {
        pairs.pair[pairs.count++] = d;
        continue;
      }
      const double reach =
          (coarse.radius_max + fine.radius_max) * fine.per_size * kSearchRadiusFactor + kSearchRadiusMargin;
      if (!searchable(fine, reach, kind)) return {};
      divide_rows(d, coarse, fine, reach, fused);
      d.end = d.first + static_cast<std::uint32_t>(coarse.spheres);
      d.warp_units = fused || d.parts < 8 || spheres < tuning::kManySpheres ? 1 : tuning::kWarpUnits;
      d.step = d.parts == 1 ? 1 : (d.parts + d.warp_units - 1) / d.warp_units;
      const std::uint64_t more = (coarse.spheres + d.group - 1) / d.group * d.step;
      warps += more, units += more * d.warp_units;
      // No more than some hundred rows for each sphere of the scene.
      if (units > spheres / 2 + 65536 || units > kMostUnits) return {};
      pairs.pair[pairs.count++] = d;
    }
    first += coarse.spheres;
  }
  pairs.units = static_cast<std::uint32_t>(units), pairs.warps = static_cast<std::uint32_t>(warps);
  return pairs;
}
}  // namespace padder::detect::cuda
