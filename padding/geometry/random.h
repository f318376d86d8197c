// SPDX-License-Identifier: MIT
// Random numbers that are the same on every platform. The distributions of <random> do not promise that.
#pragma once
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "padding/asset/mesh.h"
#include "padding/geometry/indices.h"

namespace padder {

// splitmix64 (Steele, Lea and Flood, Fast splittable pseudorandom number generators, 2014).
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}

  std::uint64_t next() {
    std::uint64_t z = (state_ += 0x9e3779b97f4a7c15ull);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
    return z ^ (z >> 31);
  }
  std::uint64_t below(std::uint64_t n) { return next() % n; }               // n > 0
  double uniform() { return static_cast<double>(next() >> 11) * 0x1p-53; }  // [0, 1)

 private:
  std::uint64_t state_;
};

// A point of a triangle, each as likely as any other.
inline Point random_point(Random& random, const std::array<Point, 3>& corners) {
  const double r = std::sqrt(random.uniform()), s = random.uniform();
  return (1 - r) * corners[0] + r * ((1 - s) * corners[1] + s * corners[2]);
}

inline std::vector<std::uint32_t> random_order(std::size_t n, std::uint64_t seed) {
  std::vector<std::uint32_t> order = numbered(n);
  Random random(seed);
  for (std::size_t k = n; k > 1; k--) std::swap(order[k - 1], order[random.below(k)]);
  return order;
}

}  // namespace padder
