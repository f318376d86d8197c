// SPDX-License-Identifier: GPL-3.0-or-later
// Scenes on which a detector's arithmetic goes wrong most easily, each with its contacts found by other
// means.
#pragma once
#include <string>
#include <vector>

#include "detect/detector.h"

namespace padder::bench {

// A scene, and what is hard about it. Its numbers are doubles; a float run gets them rounded.
struct PrecisionCase {
  std::string name, hard;
  std::vector<detect::Sphere> spheres;
  // Spheres on a cubic lattice of so many an edge, x fastest, that touch neighbours of the lattice at most;
  // 0: no lattice, so every pair is tested to find the contacts.
  std::uint32_t lattice = 0;
  double bin_size = 0;  // that the detector is told to use; 0: its own
};

// The catalogue of docs/stability.md. `lattice` is the number of spheres along an edge of its large scenes.
std::vector<PrecisionCase> precision_cases(std::uint32_t lattice);

// The spheres with every number rounded to float.
std::vector<detect::Sphere> rounded(std::vector<detect::Sphere> spheres);

// The contacts by the formula of docs/detector/exactness.md, written once more: sorted, i < j. It takes time
// that grows with the square of the number of spheres, except on a lattice.
std::vector<detect::Pair> all_contacts(const std::vector<detect::Sphere>& spheres, std::uint32_t lattice);

}  // namespace padder::bench
