// SPDX-License-Identifier: MIT
// A polygon in space to triangles.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "padding/asset/mesh.h"

namespace padder {

// Appends the n - 2 triangles that fill the polygon of n >= 3 corners, as indices 0 … n - 1, turned as the
// polygon is. Clips ears, the best-shaped first (Meisters, Polygons have ears, 1975), in the plane across the
// polygon's normal: a simple polygon, convex or not and about flat, is filled without folds. One that crosses
// itself or has no area gives n - 2 triangles all the same, some folded or without area. A quad is cut along
// the diagonal that keeps the worse angle larger. Time n log n when convex, n times the reflex corners at
// worst.
void triangulate_polygon(std::span<const Point> polygon,
                         std::vector<std::array<std::uint32_t, 3>>& triangles);

}  // namespace padder
