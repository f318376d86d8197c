// SPDX-License-Identifier: MIT
// Splits a polygon in space into triangles.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "padding/asset/mesh.h"

namespace padder {

// Appends the n - 2 triangles that fill a polygon of n >= 3 corners, as indices 0 to n - 1, with the
// polygon's orientation. It clips ears, the best-shaped first (Meisters, Polygons have ears, 1975), in the
// plane across the polygon's normal. A simple polygon that is about flat is filled without folds, whether it
// is convex or not. One that crosses itself or has no area still gives n - 2 triangles, some of them folded
// or without area. A quad is cut along the diagonal that keeps the smaller angle larger. Takes n log n steps
// for a convex polygon. The reflex corners stand in a grid, so that a comb or a star takes hardly more.
void triangulate_polygon(std::span<const Point> polygon,
                         std::vector<std::array<std::uint32_t, 3>>& triangles);

}  // namespace padder
