// SPDX-License-Identifier: MIT
// The grid of the CPU's grid path: that of choose_grid(), for spheres that may lie anywhere. Internal.
#pragma once
#include <algorithm>
#include <bit>
#include <cmath>
#include <vector>

#include "detect/omp/level_keys.h"
#include "detect/omp/paths.h"

namespace padder::detect::omp {

// The summary with the box of each octave shrunk about its middle. `shrink` is a factor for each octave.
inline Summary shrunk(const Summary& given, const double* shrink) {
  Summary s = given;
  for (int o = 0; o < kOctaves; o++)
    for (int k = 0; k < 3 && shrink[o] < 1 && s.octave[o].count > 0; k++) {
      const double middle = s.octave[o].low[k] / 2 + s.octave[o].high[k] / 2;
      s.octave[o].low[k] += (middle - s.octave[o].low[k]) * (1 - shrink[o]);
      s.octave[o].high[k] += (middle - s.octave[o].high[k]) * (1 - shrink[o]);
    }
  return s;
}

// The grid for spheres that crowd together in boxes that are smaller than their bounds, by the factors
// `shrink` along each axis. choose_grid() takes the spheres of an octave for evenly spread over its bounds. A
// level whose spheres lie outside the smaller bounds becomes periodic.
inline Grid choose_levels(const Summary& given, double bin_size, const double* shrink) {
  const Summary s = with_octaves(given);
  Grid g = choose_grid(shrunk(s, shrink), bin_size, 8, CrossSearch::cheaper);
  for (int o = 0; o < kOctaves; o++) {
    if (s.octave[o].count == 0 || shrink[o] == 1) continue;
    Level& l = g.level[g.levels == 1 ? 0 : g.level_of_octave[o]];
    bool inside = true;
    for (int k = 0; k < 3; k++)
      inside &= split(l, s.octave[o].low[k]).bin >= l.first[k] &&
                split(l, s.octave[o].high[k]).bin < l.first[k] + static_cast<std::int64_t>(l.count[k]);
    if (inside || l.hashed) continue;
    l.hashed = 1;
    l.ring = l.buckets = static_cast<std::uint32_t>(
        std::bit_ceil(std::clamp<std::uint64_t>(2 * l.spheres, kLeastRing, 1u << 28)));
  }
  return with_rings(g);
}

// Are spheres of different sizes so crowded on some level that other levels would serve them better? Then it
// makes the factors of their octaves smaller. `seen` is, for each level, the mean number of spheres in the
// bucket of a sphere.
inline bool shrink_crowded(const Summary& given, const Grid& g, const double* seen, double* shrink) {
  constexpr double kCrowded = 40;
  if (!given.octaves_known) return false;
  bool any = false;
  for (int level = 0; level < g.levels; level++) {
    const Level& l = g.level[level];
    double expected = static_cast<double>(l.spheres);
    for (int k = 0; k < 3; k++) expected /= l.count[k];
    if (l.spheres == 0 || seen[level] < kCrowded || seen[level] < 4 * expected) continue;
    for (int o = 0; o < kOctaves; o++)
      if (given.octave[o].count > 0 && (g.levels == 1 || g.level_of_octave[o] == level))
        shrink[o] *= std::cbrt(expected / seen[level]), any = true;
  }
  return any;
}

// Of some spheres of a level, the pairs that share a bucket although they lie in different bins.
template <class T>
std::uint64_t mistaken_pairs(const View<T>& some, const Level& l) {
  const LevelKeys keys = keys_of(l);
  std::vector<std::uint64_t> met;  // the key, and what tells bins apart
  met.reserve(some.count);
  for (std::uint64_t k = 0; k < some.count; k++) {
    const Bin b = bin_of(l, some[k]);
    met.push_back(std::uint64_t(keys.key(b)) << 32 | static_cast<std::uint32_t>(b.x ^ b.y << 10 ^ b.z << 20));
  }
  std::sort(met.begin(), met.end());
  std::uint64_t pairs = 0;
  for (std::size_t k = 1, same = 0; k < met.size(); k++) {
    same = met[k] >> 32 == met[k - 1] >> 32 ? same + 1 : 0;
    pairs += met[k] != met[k - 1] ? same : 0;
  }
  return pairs;
}

// Where all spheres are of one periodic level: lie planes of bins on each other? Then the level is spread
// for planes. Of n spheres, 2 sqrt(n) are asked. If the ring were filled evenly, one pair of these would
// share a bucket by mistake.
template <class T>
void spread_planes(const View<T>& spheres, Grid& g) {
  constexpr std::uint64_t kMany = 5;
  Level& l = g.level[0];
  if (g.levels > 1 || !l.hashed || l.ring < 1u << kLeastPlaneBits) return;
  const auto asked = static_cast<std::uint64_t>(2 * std::sqrt(static_cast<double>(spheres.count))),
             step = spheres.count / asked;
  std::vector<T> some;
  some.reserve(4 * asked);
  for (std::uint64_t k = 0; k < asked; k++) {
    // Anywhere within the step, because the order of the spheres may have one of its own.
    const std::uint64_t at = k * step + mixed(k) % step;
    some.insert(some.end(), spheres.center(at), spheres.center(at) + 3), some.push_back(spheres.radius(at));
  }
  const View<T> view{some.data(), some.data() + 3, 4, 4, asked, nullptr, nullptr};
  const std::uint64_t mistaken = mistaken_pairs(view, l);
  if (mistaken < kMany) return;
  std::uint64_t fewest = mistaken / 2;  // cubes are near each other in memory, which is worth as much
  Spread best = Spread::cubes;
  for (const Spread spread : {Spread::xy, Spread::yz}) {
    set_spread(l, spread);
    const std::uint64_t pairs = mistaken_pairs(view, l);
    if (pairs < fewest) fewest = pairs, best = spread;
  }
  set_spread(l, best);
}

}  // namespace padder::detect::omp
