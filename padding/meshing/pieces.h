// SPDX-License-Identifier: GPL-3.0-or-later
// Sorts a soup into pieces and turns the triangles of each alike.
#pragma once
#include <cstdint>
#include <optional>
#include <vector>

#include "padding/asset/mesh.h"

namespace padder {

// Triangles that hang together by edges.
struct Piece {
  std::vector<std::uint32_t> triangles;  // of Pieces::mesh, which has them turned alike
  bool closed = false;                   // along each edge the directions cancel
};

// The soup with equal points merged. Triangles that name a point twice are left out.
struct Pieces {
  Mesh mesh;
  std::vector<Piece> pieces;
  std::size_t repeated = 0;  // triangles that were left out because there was an equal one
  std::size_t turned = 0;    // triangles that were turned round
};

// A piece keeps the directions of its file if they close it. If not, neighbours are turned alike; of
// triangles that turn either way the more common direction in the file counts. Equal triangles count once,
// except where the piece only closes with both sides of a wall between two bodies.
Pieces find_pieces(const Mesh& soup);

// The soup with equal points merged, if it is one piece that closes, with its triangles turned alike, and
// each edge and each point has one round of triangles. Otherwise nothing: as when triangles repeat or name a
// point twice.
std::optional<Mesh> one_closed_piece(const Mesh& soup);

// The signed volume that triangles enclose: those of `mesh` that are listed.
double signed_volume(const Mesh& mesh, const std::vector<std::uint32_t>& triangles);

// An edge from `from` to `to`.
struct DirectedEdge {
  std::uint32_t from = 0, to = 0;
};

// The edges that a patch must have so that the triangles listed close: the border, run through backwards. In
// a fixed order.
std::vector<DirectedEdge> missing_edges(const Mesh& mesh, const std::vector<std::uint32_t>& triangles);

}  // namespace padder
