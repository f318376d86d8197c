// SPDX-License-Identifier: GPL-3.0-or-later
// Finds corners of a mesh by their places.
#pragma once
#include <cstdint>
#include <utility>
#include <vector>

#include "padding/geometry/indices.h"
#include "padding/geometry/point_tree.h"
#include "padding/geometry/surface.h"

namespace padder {

// Some corners of a mesh, and a tree over their places.
struct CornerTree {
  std::vector<std::uint32_t> corners;  // ascending, each once
  std::vector<Point> places;
  PointTree tree;  // numbers them as `corners` does

  CornerTree(const Mesh& mesh, std::vector<std::uint32_t> some) : corners(std::move(some)) {
    sort_unique(corners);
    for (const auto v : corners) places.push_back(mesh.points[v]);
    tree = PointTree(places);
  }
};

}  // namespace padder
