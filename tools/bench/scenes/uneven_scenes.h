// SPDX-License-Identifier: GPL-3.0-or-later
// Scenes in which spheres lie unevenly or differ in size, for `bench scenes`: what simulations look like once
// grains escape, heaps settle and sizes vary.
#pragma once
#include <vector>

#include "detect/scene/generate.h"

namespace padder::bench {

struct UnevenScene {
  const char* name;
  const char* what;
  double most;  // aim: time over (spheres + contacts), relative to dense
  std::vector<detect::FloatSphere> (*make)(std::uint64_t n, detect::SplitMix64& random);
  bool crowds_nine_stages = false;  // bins of one size hold thousands of spheres
};

// The first is dense, which the others are compared with.
const std::vector<UnevenScene>& uneven_scenes();

double normal(detect::SplitMix64& random);  // a normal number, by two of its numbers
void shuffle(std::vector<detect::FloatSphere>& spheres, detect::SplitMix64& random);

// The scene with n spheres in random order; seed 12345 + n.
std::vector<detect::FloatSphere> uneven_scene(const UnevenScene& scene, std::uint64_t n);

}  // namespace padder::bench
