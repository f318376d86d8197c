// SPDX-License-Identifier: MIT
// A part of a triangle, and its halves: sampling and the certificate both cut triangles until the parts are
// small enough.
#pragma once
#include <array>
#include <cmath>
#include <utility>

#include "padding/asset/mesh.h"

namespace padder {

// Types derive from it to carry more along.
struct TrianglePart {
  std::array<Point, 3> corner;
  std::uint32_t triangle = 0;  // of the mesh, that this is a part of

  Point centroid() const { return (corner[0] + corner[1] + corner[2]) / 3; }

  // The squared length of the longest edge, and the corner that this edge starts from.
  std::pair<double, int> longest_edge() const {
    std::pair<double, int> longest{-1, 0};
    for (int k = 0; k < 3; k++) {
      const double length2 = (corner[(k + 1) % 3] - corner[k]).squaredNorm();
      if (length2 > longest.first) longest = {length2, k};
    }
    return longest;
  }
  double size() const { return std::sqrt(longest_edge().first); }  // length of the longest edge
};

// The two halves on both sides of the middle of the longest edge. They inherit everything else from the part.
template <class Part>
std::array<Part, 2> bisect(const Part& part) {
  const int from = part.longest_edge().second, to = (from + 1) % 3;
  const Point middle = 0.5 * (part.corner[from] + part.corner[to]);
  std::array<Part, 2> halves = {part, part};
  halves[0].corner[to] = middle;
  halves[1].corner[from] = middle;
  return halves;
}

}  // namespace padder
