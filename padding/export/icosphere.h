// SPDX-License-Identifier: MIT
// Private to padding/export: a sphere as triangles.
#pragma once
#include <cstdint>
#include <vector>

#include "padding/asset/mesh.h"

namespace padder::exporting {

// A unit sphere. Its triangles face outward.
struct Icosphere {
  std::vector<Vector> points;  // on the unit sphere: also the normals
  std::vector<std::uint16_t> corners;
};

// An icosahedron, each triangle split in four `levels` times, at most 6. Two levels give 320 triangles, which
// lie within 1.9 % of the radius from the sphere.
Icosphere icosphere(int levels);

}  // namespace padder::exporting
