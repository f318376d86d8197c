// SPDX-License-Identifier: MIT
// What the nine stages of section 2.1 of the paper share in both backends: the grid, the arrays under the
// paper's names, and the decision in which bin a contact is reported. The nine stages are the reference for
// the grid path. They decide in double, whatever CallOptions::precision says.
#pragma once
#include <cstdint>
#include <vector>

#include "detect/core/grid.h"
#include "detect/detector.h"

namespace padder::detect {

// BinStart::start of an inactive bin, which fewer than two spheres touch.
inline constexpr std::uint64_t kInactive = ~std::uint64_t(0);
// Bits of a bin number along each axis. Where there are more bins, the numbers wrap.
inline constexpr int kSideBits = 21;

// The uniform grid of the nine stages. A bin's number is x + y SIDE.x + z SIDE.x SIDE.y. Along an axis with
// more than 2^21 bins the numbers wrap. Two bins with the same number then share a list, and the midpoint
// rule still reports each pair once.
struct StageGrid {
  double size = 1;
  double margin = 0;  // CallOptions::margin
  std::int64_t first[3] = {0, 0, 0};
  std::uint64_t side[3] = {1, 1, 1};
};

// An entry of array B: a bin, and an object (sphere) that touches it.
struct BinEntry {
  std::uint64_t bin;
  std::uint32_t object;
};
// An entry of array C: where the objects of a bin are in sorted B. There is one for each bin that is touched;
// the paper has one for each bin of the grid.
struct BinStart {
  std::uint64_t start;  // kInactive: fewer than two spheres touch the bin
  std::uint64_t end;    // one past the bin's last entry
  std::uint64_t bin;
};

// All arrays, on the host: what `detect --stages` prints.
struct Arrays {
  StageGrid grid;
  std::vector<std::uint64_t> T;    // stage 1: bins touched by each sphere
  std::vector<std::uint64_t> S;    // stage 2: inclusive scan of T
  std::vector<BinEntry> B;         // stage 3
  std::vector<BinEntry> B_sorted;  // stage 4
  std::vector<BinStart> C;         // stage 5
  std::vector<BinStart> C_sorted;  // stage 6: inactive bins at the end
  std::uint64_t active = 0;
  std::vector<std::uint64_t> D;  // stage 7: contacts of each active bin
  std::vector<std::uint64_t> E;  // stage 8: inclusive scan of D
  std::vector<Pair> F;           // stage 9
};

// The first and the last bin that a sphere touches, along each axis. A margin is added to the sphere, so that
// two spheres that touch by the decision of contact.h always share a bin, whatever was rounded.
//
// Proof. Let c and r be the larger coordinate and the larger radius of the two, and s the sum of the radii.
// Along an axis the centres are at most s (1 + 2^-50) apart. Each bound is off by at most 2^-51 (c + r), or
// by 2^-1074 below 2^-1022, where only products are rounded. The two margins are 2^-48 (c + r) together and
// 2^-1070 each, which is more than all of that. And stage_bin never decreases when x grows.
struct TouchedBins {
  std::int64_t low[3], high[3];
};
PADDER_HD std::int64_t stage_bin(double x, double size) {
  const double q = floor(div(x, size));  // clamped below: a cast beyond 2^63 is undefined
  return static_cast<std::int64_t>(smaller(larger(q, -0x1p61), 0x1p61));
}
PADDER_HD double bin_margin(double coordinate, double r) {
  return add(add(mul(magnitude(coordinate), 0x1p-48), mul(r, 0x1p-48)), 0x1p-1070);
}
//
// With a margin m, each radius counts as r + m / 2: those of a pair are m larger together, and the midpoint
// of a pair that is m apart lies on both of these larger spheres.
PADDER_HD double reach_of(const Sphere& s, double margin) { return add(s.r, mul(margin, 0.5)); }
PADDER_HD TouchedBins touched_bins(const StageGrid& g, const Sphere& s) {
  const double c[3] = {s.x, s.y, s.z}, r = reach_of(s, g.margin);
  TouchedBins t;
  for (int k = 0; k < 3; k++) {
    const double margin = bin_margin(c[k], r);
    t.low[k] = stage_bin(sub(c[k], add(r, margin)), g.size);
    t.high[k] = stage_bin(add(c[k], add(r, margin)), g.size);
  }
  return t;
}
PADDER_HD std::uint64_t touched_count(const TouchedBins& t) {
  std::uint64_t n = 1;
  for (int k = 0; k < 3; k++) {
    const auto wide = static_cast<std::uint64_t>(t.high[k] - t.low[k] + 1);
    constexpr std::uint64_t most = std::uint64_t(1) << kSideBits;
    n *= wide < most ? wide : most;  // more would never fit in memory; the product must only not overflow
  }
  return n;
}
PADDER_HD std::uint64_t bin_number(const StageGrid& g, std::int64_t x, std::int64_t y, std::int64_t z) {
  const std::int64_t b[3] = {x, y, z};
  std::uint64_t n = 0;
  for (int k = 2; k >= 0; k--) {
    const auto at = static_cast<std::uint64_t>(b[k] - g.first[k]) & ((std::uint64_t(1) << kSideBits) - 1);
    n = n * g.side[k] + at;
  }
  return n;
}

// Is this pair of a bin a contact that this bin reports? It must touch (with a margin: be near enough), the
// filter must admit it, their worlds must meet, the region must own it, and its midpoint must lie in this
// bin. Stages 7 and 9 ask this for every pair of every bin. Rounding may put the midpoint one bin outside
// those that both spheres touch; it is moved back, or the contact would be lost.
PADDER_HD bool reports(const StageGrid& g, std::uint64_t bin, const Sphere& i, const Sphere& j,
                       const Filter& fi, const Filter& fj, std::uint32_t world_i, std::uint32_t world_j,
                       const Region& own) {
  if (!touching(i, j, g.margin) || !admitted(fi, fj) || !worlds_meet(world_i, world_j)) return false;
  const Midpoint m = midpoint(i, j);
  if (!owns(own, m)) return false;
  const TouchedBins a = touched_bins(g, i), b = touched_bins(g, j);
  const double p[3] = {m.x, m.y, m.z};
  std::int64_t at[3];
  for (int k = 0; k < 3; k++) {
    const std::int64_t low = a.low[k] > b.low[k] ? a.low[k] : b.low[k],
                       high = a.high[k] < b.high[k] ? a.high[k] : b.high[k];
    const std::int64_t q = stage_bin(p[k], g.size);
    at[k] = q < low ? low : q > high ? high : q;
  }
  return bin_number(g, at[0], at[1], at[2]) == bin;
}

// The grid with the bin size of section 2.2.1: twice the largest radius, or three times the mean radius if
// radii differ widely. It is larger where array B would have more than about 64 entries for each sphere. A
// `bin_size` above 0 is taken as it is; throws Error if it is far too small.
StageGrid choose_stage_grid(const Summary& s, double bin_size, double margin);

}  // namespace padder::detect
