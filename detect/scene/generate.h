// SPDX-License-Identifier: MIT
// The reference scenes of docs/scenes.md, drawn from a 64-bit splitmix generator: the same spheres on every
// machine.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "detect/body.h"

namespace padder::detect {

// The generator splitmix64: a stream of 64-bit numbers that depends on the seed alone.
class SplitMix64 {
 public:
  explicit SplitMix64(std::uint64_t seed) : state_(seed) {}
  std::uint64_t bits() {
    const std::uint64_t z = mixed(state_);
    state_ += 0x9E3779B97F4A7C15ull;
    return z;
  }
  double unit() { return static_cast<double>(bits() >> 11) * 0x1p-53; }  // [0, 1)
  double signed_unit() { return 2 * unit() - 1; }                        // [-1, 1)

 private:
  std::uint64_t state_;
};
using Random [[deprecated("use SplitMix64")]] = SplitMix64;

// A sphere of a generated scene.
struct FloatSphere {
  float x, y, z, r;
};

// Names that generate() knows: dense dilute poly35 poly045 poly100.
const std::vector<std::string>& generator_names();

// n loose spheres of the scene `name`, seed 12345 + n; in random order, or as they were drawn ("coherent").
// The scenes are dimensionless: the smallest radius is 1. Throws Error for an unknown name.
std::vector<FloatSphere> generate(const std::string& name, std::uint64_t n, bool random_order = true);

// The scene "cluster": bodies of 64 overlapping unit spheres on a shell of radius 3, each a family of its
// own, on a jittered lattice on which neighbouring shells touch.
struct BodyScene {
  std::vector<Sphere> shape;
  std::vector<Body> bodies;
};
BodyScene generate_bodies(std::uint64_t count);

// A pile of n copies of a shape within the sphere of radius `bound` about its origin: a jittered lattice
// whose cells are `spacing` bounds wide, each copy turned at random, family 33 and up. Seed 12345 + n.
std::vector<Body> pile(std::uint64_t n, double bound, double spacing = 1.5);

}  // namespace padder::detect
