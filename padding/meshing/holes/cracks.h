// SPDX-License-Identifier: GPL-3.0-or-later
// Closes cracks: by triangles, by joining corners, and by splitting edges at corners that lie on them.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "padding/meshing/pieces.h"
#include "padding/meshing/repair.h"

namespace padder {

// Border edges that lie closer than this share of the diagonal are one edge, but never farther apart than
// this share of the tolerance: covers make up for the width of the cracks that were closed.
constexpr double kCrackWidth = 1e-4, kCrackShare = 0.25;
double crack_limit(const RepairOptions& options, double diagonal);

// A crack is a place where edges run beside each other, at most a given width apart, without sharing their
// vertices; a T-junction is one of width 0. Returns the triangles that close the cracks, and takes what they
// supply from `missing`.
struct CrackTriangle {
  std::array<std::uint32_t, 3> triangle;
  double width = 0;  // of the crack
};
std::vector<CrackTriangle> close_cracks(const Mesh& mesh, std::vector<DirectedEdge>& missing, double width);

// Corners that lie at most `width` apart, moved to one place. Corners of one triangle stay apart.
struct JoinedCorners {
  Mesh mesh;              // `soup` with its points moved
  std::size_t count = 0;  // of the corners that were moved
  double farthest = 0;    // that one of them was moved
};

// Joins the corners at the ends of the missing edges, which are those of `mesh`: a mesh whose points have the
// same numbers as those of `soup`.
JoinedCorners join_corners(const Mesh& soup, const Mesh& mesh, const std::vector<DirectedEdge>& missing,
                           double width);

// Edges that are split where corners lie on them, so that triangles meet along whole edges.
struct SplitEdges {
  Mesh mesh;              // with the points of the other one
  std::size_t count = 0;  // of the edges that were split
  double farthest = 0;    // of these corners from their edge
};

// Splits the edges of the triangles listed, each once, at the ends of `open` edges that lie within `width`.
SplitEdges split_edges(const Mesh& mesh, const std::vector<std::uint32_t>& triangles,
                       const std::vector<DirectedEdge>& open, double width);

}  // namespace padder
