// SPDX-License-Identifier: GPL-3.0-or-later
// Meshes on which padding goes wrong most easily.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "padding/asset/mesh.h"

namespace padder::bench {

// What is right for a mesh: spheres that are proved to keep the tolerance against it, or one sentence,
// because no spheres can be right.
enum class Right { certified, not_certified, refused };

struct HardMesh {
  std::string name, hard;
  Right right = Right::certified;
  std::function<Mesh()> make;
  double tolerance = 0.01;  // share of the diagonal
};

// The catalogue of docs/stability.md.
const std::vector<HardMesh>& hard_meshes();

}  // namespace padder::bench
