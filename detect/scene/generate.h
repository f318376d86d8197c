// SPDX-License-Identifier: MIT
// The reference scenes of docs/scenes.md. They come from a generator of pseudorandom numbers, and are the
// same on every machine.
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
    state_ += kStep;
    return z;
  }
  double unit() { return static_cast<double>(bits() >> 11) * 0x1p-53; }  // [0, 1)
  double signed_unit() { return 2 * unit() - 1; }                        // [-1, 1)
  // The generator after its next `count` numbers.
  SplitMix64 after(std::uint64_t count) const { return SplitMix64(state_ + count * kStep); }

 private:
  static constexpr std::uint64_t kStep = 0x9E3779B97F4A7C15ull;
  std::uint64_t state_;
};
using Random [[deprecated("use SplitMix64")]] = SplitMix64;

// A sphere of a generated scene.
struct FloatSphere {
  float x, y, z, r;
};

// The n loose spheres of the scene `name` (dense, dilute, poly35, poly045 or poly100), with seed 12345 + n.
// They are in random order, or in the order in which they were drawn ("coherent"). Lengths have no unit: the
// smallest radius is 1. Throws Error for an unknown name.
std::vector<FloatSphere> generate(const std::string& name, std::uint64_t n, bool random_order = true);

// The scene "cluster". Each body has 64 overlapping unit spheres on a shell of radius 3, and a family of its
// own. The bodies are on a jittered lattice, on which neighbouring shells touch.
struct BodyScene {
  std::vector<Sphere> shape;
  std::vector<Body> bodies;
};
BodyScene generate_bodies(std::uint64_t count);

// Places n copies of a shape that lies inside the sphere of radius `bound` around its origin. They are on a
// jittered lattice with cells of edge `spacing` * `bound`, each turned at random, with families from 33 on.
// The seed is 12345 + n.
std::vector<Body> pile(std::uint64_t n, double bound, double spacing = 1.5);

}  // namespace padder::detect
