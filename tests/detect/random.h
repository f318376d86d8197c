// SPDX-License-Identifier: MIT
// Random numbers for tests.
#pragma once
#include <cstdint>
#include <cstdio>
#include <random>

namespace padder::detect {

// For a test with input that is new in each run: prints the seed with which it can be made again.
inline std::mt19937_64 random_of_new_seed() {
  const std::uint32_t seed = std::random_device{}();
  std::printf("seed %u\n", seed);
  return std::mt19937_64(seed);
}

template <class Generator>
double unit(Generator& random) {  // from 0 to 1
  return std::uniform_real_distribution<double>(0, 1)(random);
}
template <class Generator>
double signed_unit(Generator& random) {  // from -1 to 1
  return std::uniform_real_distribution<double>(-1, 1)(random);
}

}  // namespace padder::detect
