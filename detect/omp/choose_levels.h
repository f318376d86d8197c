// SPDX-License-Identifier: MIT
// The grid of the CPU's grid path: that of choose_grid(), for spheres that may lie anywhere. Internal.
#pragma once
#include <algorithm>
#include <cmath>
#include <vector>

#include "detect/omp/level_keys.h"
#include "detect/omp/paths.h"

namespace padder::detect::omp {

inline Grid choose_levels(const Summary& summary, double bin_size) {
  return with_rings(choose_grid(summary, bin_size, 8, Processor::cpu));
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
