// SPDX-License-Identifier: GPL-3.0-or-later
// Traces the rims of holes and fills them with patches.
#pragma once
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "padding/meshing/pieces.h"

namespace padder {

using Triangles = std::vector<std::array<std::uint32_t, 3>>;

// The closed paths without a point twice that the missing edges form. At a vertex with several ways on, the
// path takes the one next to it, as seen from the front of the triangles listed.
std::vector<std::vector<std::uint32_t>> trace_rims(const Mesh& mesh,
                                                   const std::vector<std::uint32_t>& triangles,
                                                   const std::vector<DirectedEdge>& missing);

// A pipe may have two walls that nothing joins at its ends. There two rims bound a ring: both lie about in
// one plane, the inner one just inside the outer one, and they run round in opposite directions; in the same
// one if the walls face alike. Then they do not all but touch, as where one is a copy of the other.
struct Ring {
  std::size_t outer, inner;             // of the rims
  std::array<std::uint32_t, 2> bridge;  // the points of outer and inner that lie nearest to each other
  bool alike = false;                   // both run round in one direction
};
std::vector<Ring> find_rings(const Mesh& mesh, const std::vector<std::vector<std::uint32_t>>& rims);

// Where the hole through a body has no wall, as in a tire alone, each of two rims lies behind the other,
// about along one axis, and halfway between them the winding number is below 1/2 without patches over them,
// or both are small there. There a band between the two closes the body. Returns the two points of each band
// that lie nearest to each other. The rims are those of pieces that face outward; `piece` says of which, or
// ~0: of none.
using PieceTriangles = std::unordered_map<std::uint32_t, std::vector<std::uint32_t>>;  // by their piece
std::vector<std::array<std::uint32_t, 2>> find_bands(const Mesh& mesh,
                                                     const std::vector<std::vector<std::uint32_t>>& rims,
                                                     const std::vector<std::uint32_t>& piece,
                                                     const PieceTriangles& triangles_of);

// Makes one rim of two, which runs over the bridge and back. Does nothing where the bridge does not lie
// between two rims.
void join_rims(std::vector<std::vector<std::uint32_t>>& rims, const std::array<std::uint32_t, 2>& bridge);

// Triangles that fill a rim of 3 or more points: from rim to rim if it is a band's or a long ring's; else
// ears in the plane across it if it is about flat or long; otherwise, and if it is a ring's, the patch of
// least area.
Triangles fill_rim(const Mesh& mesh, const std::vector<std::uint32_t>& rim);

double rim_length(const Mesh& mesh, const std::vector<std::uint32_t>& rim);

// The solid angle of triangle t seen from p, as a share of the whole sphere; above 0 if p sees its back.
double solid_angle(const Mesh& mesh, const std::array<std::uint32_t, 3>& triangle, const Point& p);

}  // namespace padder
