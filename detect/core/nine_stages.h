// SPDX-License-Identifier: MIT
// The nine stages of section 2.1, one function each, arrays under the paper's names. The reference that the
// fast path is checked against. Both backends have these functions; here are what they share, and the OpenMP
// ones.
#pragma once
#include <cstdint>
#include <vector>

#include "detect/core/grid.h"
#include "detect/detector.h"

namespace padder::detect {

inline constexpr std::uint64_t kInactive =
    ~std::uint64_t(0);                // start of a bin that is touched by fewer than two spheres
inline constexpr int kSideBits = 21;  // a bin number has 21 bits an axis; more bins wrap around

// The uniform grid of the nine stages. A bin's number is x + y SIDE.x + z SIDE.x SIDE.y. Where an axis has
// more than 2^21 bins the numbers wrap: two bins that share a number share a list, and the midpoint rule
// still reports a pair once.
struct StageGrid {
  double size = 1;
  std::int64_t first[3] = {0, 0, 0};
  std::uint64_t side[3] = {1, 1, 1};
};

// One sphere in one bin.
struct BinEntry {  // of B
  std::uint64_t bin;
  std::uint32_t object;
};
// Where the spheres of a bin begin.
struct BinStart {  // of C: one for each bin that is touched at all (the paper: one for each bin of the grid)
  std::uint64_t start;  // in sorted B; kInactive: fewer than two spheres touch it
  std::uint64_t end;    // one past its last entry
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

// The bins a sphere touches, first and last on each axis. Bounds are widened by a hair, so that spheres which
// touch by the decision of contact.h always share a bin, whatever was rounded: with c, r the larger of both
// spheres' and s the sum of their radii, they are apart along an axis by at most s (1 + 2^-50), and each
// bound is off by at most 2^-51 (c + r), or, below 2^-1022, where only products round, by 2^-1074. The hairs
// are 2^-48 (c + r) together and 2^-1070 each: more than all that. And stage_bin never decreases with x.
struct Touched {
  std::int64_t low[3], high[3];
};
PADDER_HD std::int64_t stage_bin(double x, double size) {
  const double q = floor(div(x, size));  // clamped: a cast beyond 2^63 is undefined
  return static_cast<std::int64_t>(smaller(larger(q, -0x1p61), 0x1p61));
}
PADDER_HD double hair_of(double coordinate, double r) {
  return add(add(mul(magnitude(coordinate), 0x1p-48), mul(r, 0x1p-48)), 0x1p-1070);
}
PADDER_HD Touched touched_bins(const StageGrid& g, const Sphere& s) {
  const double c[3] = {s.x, s.y, s.z};
  Touched t;
  for (int k = 0; k < 3; k++) {
    const double hair = hair_of(c[k], s.r);
    t.low[k] = stage_bin(sub(c[k], add(s.r, hair)), g.size);
    t.high[k] = stage_bin(add(c[k], add(s.r, hair)), g.size);
  }
  return t;
}
PADDER_HD std::uint64_t touched_count(const Touched& t) {
  std::uint64_t n = 1;
  for (int k = 0; k < 3; k++) {
    const auto wide = static_cast<std::uint64_t>(t.high[k] - t.low[k] + 1), most = std::uint64_t(1)
                                                                                   << kSideBits;
    n *= wide < most ? wide : most;  // more never fits in memory: the sentence about it is all that is wanted
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

// Stages 7 and 9 ask this of every pair of a bin: is it a contact that this bin reports? Touching, admitted,
// owned, and with the midpoint in this bin. The midpoint's bin is held inside the bins both spheres touch,
// where it belongs: rounding could put it one outside, and the contact would be lost.
PADDER_HD bool reports(const StageGrid& g, std::uint64_t bin, const Sphere& i, const Sphere& j,
                       const Filter& fi, const Filter& fj, const Region& own) {
  if (!touching(i, j) || !admitted(fi, fj)) return false;
  const Midpoint m = midpoint(i, j);
  if (!owns(own, m)) return false;
  const Touched a = touched_bins(g, i), b = touched_bins(g, j);
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

// Bin size of section 2.2.1: twice the largest radius, or three times the mean when radii differ widely;
// larger where B would take more than about 64 entries a sphere. The nine stages always decide in double,
// whatever Options::precision.
StageGrid choose_stage_grid(const Summary& s, double bin_size);

}  // namespace padder::detect
