// SPDX-License-Identifier: MIT
#include "detect/cuda/search/level_pairs.h"

#include <algorithm>
#include <cmath>

#include "detect/cuda/tuning.h"

namespace padder::detect::cuda {
namespace {

// Bins of another level that a sphere may reach at most: in fixed point, modulo 256 bins; in float, so that
// the bins at the ends of its reach have numbers in 32 bits.
constexpr double kWidest = 100, kWidestInFloat = 0x1p29;

// How far the spheres of a level reach in another, in bins of that.
double reach_of(const Level& from, const Level& at) {
  return (from.radius_max + at.radius_max) * at.per_size * kSearchRadiusFactor + kSearchRadiusMargin;
}

// May spheres that reach so many bins of a level search it by rows? The rows within reach are numbered, and a
// row's number is divided by their number along y (find_rows): the product of both must fit 32 bits. In a
// hashed level each bin must have a bucket of its own. Finer spheres reach one bin at most: they may.
bool searchable(const Level& at, double reach, SlotKind kind) {
  if (reach > (kind == SlotKind::fixed_point ? kWidest : kWidestInFloat)) return false;
  const double wide = 2 * reach + 3;
  if (at.hashed) return wide < at.side;
  const double y = std::min<double>(wide, at.count[1]), z = std::min<double>(wide, at.count[2]);
  return y < 0x1p16 && y * y * z < 0x1p32;
}

// Spheres in a bin, of those that have some.
double density_of(const Level& l) {
  // Where a hashed level has spheres, it has about one in a bin, however many bins are empty.
  if (l.hashed) return 1;
  return static_cast<double>(l.spheres) / (l.filled * l.count[0] * l.count[1] * l.count[2]);
}

// Of so many bins along an axis those that exist.
double existing(const Level& l, int axis, double bins) {
  return bounded(l, axis) ? std::min<double>(bins, l.count[axis]) : bins;
}

// How the spheres of level `from` are grouped, or their rows divided, so that a unit finds about as many
// contacts as a warp's queue holds. `reach`: of the largest, in bins of level `at`. `larger`: units are to be
// so many times as large.
void divide_rows(LevelPair& d, const Level& from, const Level& at, double reach, bool fused, double larger) {
  const double most_contacts = larger * (fused ? tuning::kFusedUnitContacts : tuning::kUnitContacts),
               part_contacts = larger * (fused ? tuning::kFusedPartContacts : tuning::kPartContacts),
               most_rows = larger * tuning::kUnitRows;
  double rows = 1;  // at most
  for (int c = 1; c < 3; c++) rows *= existing(at, c, 2 * reach + 2);
  // Contacts of a sphere: so many by cubed_within() its reach.
  const double density = density_of(at), full = 4.19 * density, largest = cubed_within(at, reach);
  d.density = static_cast<float>(density);
  // A usual sphere has three quarters of the largest radius: most are smaller.
  const double usual = (0.75 * from.radius_max + at.radius_max) * at.per_size,
               contacts = full * cubed_within(at, usual) + 1e-9;
  d.group = d.parts = 1;
  if (contacts < most_contacts)
    d.group = static_cast<std::uint32_t>(
        std::clamp(std::min(most_contacts / contacts, most_rows / rows), 1.0, 32.0));
  if (d.group == 1) {
    const double parts = std::max(full / part_contacts, rows / most_rows / largest);
    d.parts_at_one = static_cast<float>(parts);
    // No more than for all spheres of level `at`, wherever the others' rows may be.
    const double enough = 2 * static_cast<double>(at.spheres) / part_contacts + 2 * rows / most_rows;
    d.parts = static_cast<std::uint32_t>(
        std::clamp(std::ceil(std::min(parts * largest, enough)), 1.0, std::max(1.0, rows / 2)));
  }
}

// The part of the spheres of `from` that are near some of `at`, if they lie evenly within their bounds.
double fraction_near(const Level& from, const Level& at) {
  if (from.hashed || at.hashed) return 1;
  const double distance = from.radius_max + at.radius_max;
  double fraction = 1;
  for (int c = 0; c < 3; c++) {
    const double low = low_of(from, c), high = high_of(from, c),
                 near = std::min(high, high_of(at, c) + distance) - std::max(low, low_of(at, c) - distance);
    fraction *= std::clamp(near / (high - low), 0.0, 1.0);
  }
  return fraction;
}

// What it costs that the spheres of a level search another so, roughly, in tests of a candidate. In a hashed
// level each bin, empty or not, has a bucket with spheres of other bins.
double cost_of(const LevelPair& d, const Level& from, const Level& at) {
  const double reach = (0.75 * from.radius_max + at.radius_max) * at.per_size,
               units = static_cast<double>(from.spheres) * d.parts / d.group,
               in_bin = at.hashed ? static_cast<double>(at.spheres) / at.ring : density_of(at);
  double wide[3];
  for (int c = 0; c < 3; c++) wide[c] = existing(at, c, 2 * reach + 1);
  return 128 * units + static_cast<double>(from.spheres) * fraction_near(from, at) * 0.8 * wide[1] * wide[2] *
                           (2 + 0.8 * wide[0] * in_bin);
}

// The division of the work between two levels, where the spheres of `from` search.
LevelPair pair_of(const Grid& grid, int from, int at, bool fused, double larger) {
  LevelPair d{};
  d.from = from, d.at = at, d.warp_units = d.step = 1;
  divide_rows(d, grid.level[from], grid.level[at], reach_of(grid.level[from], grid.level[at]), fused, larger);
  return d;
}

// Who searches? Costs are rough: where they are not far from each other, the spheres of the coarser level do,
// whose candidates are contacts more often.
LevelPair choose_pair(const Grid& grid, int fine, int coarse, SlotKind kind, bool fused, double larger) {
  constexpr double kMuchCheaper = 2;
  const Level &f = grid.level[fine], &c = grid.level[coarse];
  const LevelPair up = pair_of(grid, fine, coarse, fused, larger);
  if (!searchable(f, reach_of(c, f), kind)) return up;
  const LevelPair down = pair_of(grid, coarse, fine, fused, larger);
  return kMuchCheaper * cost_of(up, f, c) < cost_of(down, c, f) ? up : down;
}

// The division with units that are `larger` times as large as planned.
LevelPairs divide_pairs(const Grid& grid, std::uint64_t spheres, SlotKind kind, bool fused, double larger) {
  LevelPairs pairs;
  std::uint64_t units = 0, warps = 0;
  for (int coarse = 0; coarse < grid.levels; coarse++)
    for (int fine = 0; fine < coarse; fine++) {
      LevelPair d = choose_pair(grid, fine, coarse, kind, fused, larger);
      const Level& from = grid.level[d.from];
      d.entry = from.offset, d.end_entry = from.offset + from.buckets;
      d.first_unit = static_cast<std::uint32_t>(units), d.first_warp = static_cast<std::uint32_t>(warps);
      if (!lie_apart(grid.level[coarse], grid.level[fine])) {
        d.warp_units = fused || d.parts < 8 || spheres < tuning::kManySpheres ? 1 : tuning::kWarpUnits;
        d.step = d.parts == 1 ? 1 : (d.parts + d.warp_units - 1) / d.warp_units;
        const std::uint64_t more = (from.spheres + d.group - 1) / d.group * d.step;
        warps += more, units += more * d.warp_units;
      }
      pairs.pair[pairs.count++] = d;
    }
  pairs.units = static_cast<std::uint32_t>(std::min<std::uint64_t>(units, ~0u));
  pairs.warps = static_cast<std::uint32_t>(std::min<std::uint64_t>(warps, ~0u));
  return pairs;
}

}  // namespace

LevelPairs plan_level_pairs(const Grid& grid, std::uint64_t spheres, SlotKind kind, bool fused) {
  // No more units than leave each some work, nor than a stable list has numbers for. Units of 32 spheres with
  // all their rows are the fewest.
  const std::uint64_t most = std::min<std::uint64_t>(spheres / 2 + 65536, kMostUnits);
  for (double larger = 1;; larger *= 4) {
    const LevelPairs pairs = divide_pairs(grid, spheres, kind, fused, larger);
    if (pairs.units <= most || larger > 0x1p60) return pairs;
  }
}

}  // namespace padder::detect::cuda
