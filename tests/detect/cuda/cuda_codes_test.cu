// SPDX-License-Identifier: MIT
// The first test of candidates, by their codes: every pair that touches passes, and few others do. The
// arithmetic is the device's, run on the host.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "detect/cuda/order/bins.h"
#include "tests/detect/random.h"

namespace padder::detect::cuda {
namespace {

struct Pair3 {
  FloatSlot a, b;
};

// Pairs anywhere in a box, along an axis, in a plane or in any direction. Their centres are `share` of the
// sum of the radii apart; where that is 1, as little less as float needs for them to touch.
std::vector<Pair3> pairs(std::mt19937& random, const float (&low)[3], const float (&high)[3], float r_min,
                         float r_max, double share, int count) {
  std::normal_distribution<double> normal;
  std::vector<Pair3> all;
  while (static_cast<int>(all.size()) < count) {
    double d[3] = {normal(random), normal(random), normal(random)};
    const auto flat = static_cast<int>(unit(random) * 6);
    if (flat < 3) d[flat] = 0;
    if (flat == 0) d[1] = 0;
    const double length = std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    if (length < 1e-3) continue;
    float x[2][3];
    const double ra = r_min + unit(random) * (r_max - r_min), rb = r_min + unit(random) * (r_max - r_min);
    const auto a = static_cast<float>(ra), b = static_cast<float>(rb);
    bool inside = true;
    for (int k = 0; k < 3; k++) {
      x[0][k] = static_cast<float>(low[k] + unit(random) * (high[k] - low[k]));
      x[1][k] = static_cast<float>(x[0][k] + d[k] / length * share * (static_cast<double>(a) + b));
      inside = inside && x[1][k] >= low[k] && x[1][k] <= high[k];
    }
    if (!inside) continue;
    Pair3 p{{x[0][0], x[0][1], x[0][2], a}, {x[1][0], x[1][1], x[1][2], b}};
    // Rounding may have taken them apart.
    for (int tries = 0; share == 1 && tries < 100; tries++) {
      if (touching({p.a.x, p.a.y, p.a.z, a}, {p.b.x, p.b.y, p.b.z, b})) break;
      p.b.x += (p.a.x - p.b.x) * 1e-7f, p.b.y += (p.a.y - p.b.y) * 1e-7f, p.b.z += (p.a.z - p.b.z) * 1e-7f;
    }
    if (share == 1 && !touching({p.a.x, p.a.y, p.a.z, a}, {p.b.x, p.b.y, p.b.z, b})) continue;
    all.push_back(p);
  }
  return all;
}

Summary summary_of_box(const float (&low)[3], const float (&high)[3], float r_min, float r_max) {
  Summary s;
  s.count = 1'000'000, s.radius_min = r_min, s.radius_max = r_max, s.radius_sum = 1e6 * r_max;
  for (int k = 0; k < 3; k++) {
    s.low[k] = low[k], s.high[k] = high[k];
    s.extent = std::max({s.extent, std::abs(s.low[k]), std::abs(s.high[k])});
  }
  s.need_max = need_of({0, 0, 0, r_max});
  return s;
}

template <SlotKind Kind>
bool passes(std::uint32_t a, std::uint32_t b, std::int32_t limit) {
  return code_excess<Kind>(seeker<Kind>(a), b, limit) < 0;
}

class CudaCodes : public testing::Test {
 protected:
  // Each pair as a slot of each kind, in the bins of a box; f(passed forwards, passed backwards). The pairs
  // are of grown spheres, and the slots of the spheres before they grew, as with a margin.
  template <class F>
  void each(const Grid& grid, const FloatBins& bins, bool equal, float r, const std::vector<Pair3>& all,
            F f) {
    const Level& l = grid.level[0];
    const std::int32_t limit = code_limit(grid, bins, r), no_bins = code_limit(grid, FloatBins{}, r);
    for (Pair3 p : all) {
      p.a.r -= static_cast<float>(l.grown_by), p.b.r -= static_cast<float>(l.grown_by);
      const auto both = [&](auto kind, std::uint32_t a, std::uint32_t b, std::int32_t most) {
        const bool forwards = passes<kind()>(a, b, most), backwards = passes<kind()>(b, a, most);
        f(forwards && backwards, forwards || backwards, p);
      };
      const std::integral_constant<SlotKind, SlotKind::equal> same;
      const std::integral_constant<SlotKind, SlotKind::unequal> unequal;
      const std::integral_constant<SlotKind, SlotKind::fixed_point> fixed;
      if (equal && bins.on) both(same, code_of<same()>(bins, p.a), code_of<same()>(bins, p.b), limit);
      if (equal) both(same, code_of<same()>(l, p.a), code_of<same()>(l, p.b), no_bins);
      if (bins.on) both(unequal, code_of<unequal()>(bins, p.a), code_of<unequal()>(bins, p.b), 0);
      both(unequal, code_of<unequal()>(l, p.a), code_of<unequal()>(l, p.b), 0);
      const auto slot = [&](const FloatSlot& s) { return fixed_point_slot(l, {s.x, s.y, s.z, s.r}); };
      both(fixed, code_of<fixed()>(l, slot(p.a)), code_of<fixed()>(l, slot(p.b)), 0);
    }
  }
  // Boxes of all sizes, at the origin and away from it; f(low, high, largest radius, grid, bins).
  template <class F>
  void boxes(F f) {
    std::mt19937 random(20261120);
    std::uniform_real_distribution<float> unit(0, 1);
    int on = 0;
    for (int scene = 0; scene < 200; scene++) {
      const float r = std::exp2(unit(random) * 20 - 10), bins_along = std::exp2(1 + unit(random) * 10.9f),
                  away = scene % 2 ? 2 * unit(random) - 1 : 0;
      float low[3], high[3];
      for (int k = 0; k < 3; k++) {
        const float side = 2 * r * (scene % 3 == k ? bins_along : 1.5f + unit(random) * bins_along);
        low[k] = away * side * 3, high[k] = low[k] + side;
      }
      const float grown_by = scene % 5 < 3 ? 0 : 0.9f * r * unit(random);
      Summary summary = summary_of_box(low, high, r - grown_by, r - grown_by);
      summary.grown_by = grown_by;
      const Grid grid = choose_grid(summary, 0, 1e12);
      const FloatBins bins = float_bins(grid, SlotKind::equal, 1'000'000);
      on += bins.on;
      f(random, low, high, r, grid, bins);
      if (HasFatalFailure()) return;
    }
    EXPECT_GT(on, 100);
  }
};

TEST_F(CudaCodes, TouchingSpheresPass) {
  boxes([&](std::mt19937& random, const float(&low)[3], const float(&high)[3], float r, const Grid& grid,
            const FloatBins& bins) {
    for (const double share : {1.0, 0.98, 0.5, 0.0})
      for (const bool equal : {true, false})
        each(grid, bins, equal, r,
             pairs(random, low, high, equal ? r : static_cast<float>(grid.level[0].grown_by), r, share, 60),
             [&](bool passed, bool, const Pair3& p) {
               ASSERT_TRUE(passed) << p.a.x << ' ' << p.a.y << ' ' << p.a.z << ' ' << p.a.r << ", " << p.b.x
                                   << ' ' << p.b.y << ' ' << p.b.z << ' ' << p.b.r;
             });
  });
}

// From a tenth of a bin further apart than the largest spheres touch to where bytes come round again.
TEST_F(CudaCodes, OthersDoNot) {
  boxes([&](std::mt19937& random, const float(&low)[3], const float(&high)[3], float r, const Grid& grid,
            const FloatBins& bins) {
    for (const double share : {1.12, 1.4, 1.7})
      each(grid, bins, true, r, pairs(random, low, high, r, r, share, 30),
           [&](bool, bool passed, const Pair3& p) {
             ASSERT_FALSE(passed) << share << ": " << p.a.x << ' ' << p.a.y << ' ' << p.a.z << ", " << p.b.x
                                  << ' ' << p.b.y << ' ' << p.b.z;
           });
  });
}

// The candidates that each 32 consecutive spheres of the order have in all, as queue_candidates() of
// same_level.h finds them: by the codes in the own bin behind the sphere and in the forward half of the bins
// around, by entries of the table.
std::vector<std::uint32_t> candidates_of_warps(const std::vector<FloatSlot>& spheres, const Grid& grid,
                                               const FloatBins& b) {
  const auto n = static_cast<std::uint32_t>(spheres.size());
  const int merge = merge_of(grid, b, n);
  const std::int32_t limit = code_limit(grid, b, spheres[0].r);
  std::vector<std::uint32_t> table((keys_of(grid, b) >> merge) + 3, 0), keys(n), codes(n);
  const auto key_of_slot = [&](const FloatSlot& s) {
    std::uint32_t key;
    EXPECT_TRUE(key_of(b, s.x, s.y, s.z, key));
    return key;
  };
  for (const FloatSlot& s : spheres) table[(key_of_slot(s) >> merge) + 1]++;
  std::partial_sum(table.begin(), table.end(), table.begin());
  std::vector<std::uint32_t> next = table;
  for (const FloatSlot& s : spheres) {
    const std::uint32_t key = key_of_slot(s), at = next[key >> merge]++;
    keys[at] = key, codes[at] = code_of<SlotKind::equal>(b, s);
  }
  std::vector<std::uint32_t> found((n + 31) / 32, 0);
  for (std::uint32_t i = 0; i < n; i++)
    for (std::uint32_t q = 0, k = keys[i]; q < 5; q++) {
      const std::uint32_t from = (q ? k - 1 : k) & b.mask, upto = std::min(from + (q ? 2 : 1), b.mask);
      for (std::uint32_t j = q ? table[from >> merge] : i + 1; j < table[(upto >> merge) + 1]; j++)
        found[i / 32] += code_excess<SlotKind::equal>(seeker<SlotKind::equal>(codes[i]), codes[j], limit) < 0;
      k = q == 1 ? keys[i] + b.plane - b.row : k + b.row;
    }
  return found;
}

// A heap whose bins are full, and one sphere so far away that the level is hashed: its ring has four buckets
// for each sphere. A warp with more candidates than its queue holds searches twice, at six times the cost.
TEST_F(CudaCodes, TheCandidatesOfAHeapInAHashedLevelFitTheQueueOfAWarp) {
  constexpr std::uint32_t kSpheres = 140'000;
  std::mt19937 random(20261123);
  std::uniform_real_distribution<float> place(0, std::cbrt(4.9f * kSpheres));
  std::vector<FloatSlot> spheres(kSpheres);
  for (FloatSlot& s : spheres) s = {place(random), place(random), place(random), 1};
  const float low[3] = {0, 0, 0}, high[3] = {3e6f, 3e6f, 3e6f};
  Summary summary = summary_of_box(low, high, 1, 1);
  summary.count = kSpheres;
  const Grid grid = choose_grid(summary, 0, 8, Processor::gpu);
  const FloatBins bins = float_bins(grid, SlotKind::equal, kSpheres);
  ASSERT_TRUE(bins.on);
  ASSERT_TRUE(grid.level[0].hashed);
  const std::vector<std::uint32_t> found = candidates_of_warps(spheres, grid, bins);
  const auto over = std::count_if(found.begin(), found.end(),
                                  [](std::uint32_t c) { return c > tuning::kSameLevelQueue / 2; });
  EXPECT_LT(static_cast<double>(over), 0.01 * static_cast<double>(found.size()));
}

}  // namespace
}  // namespace padder::detect::cuda
