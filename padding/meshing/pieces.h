// SPDX-License-Identifier: GPL-3.0-or-later
// Sorts a soup into pieces and turns the triangles of each alike.
#pragma once
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "padding/geometry/indices.h"
#include "padding/geometry/surface.h"

namespace padder {

// Triangles that hang together by edges.
struct Piece {
  std::vector<std::uint32_t> triangles;  // of Pieces::mesh, which has them turned alike
  bool closed = false;                   // along each edge the directions cancel
  bool bounds_nothing = false;           // walls inside another piece, or sheets that stand on it
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
// except where the piece only closes with both sides of a wall between two bodies. Where a piece does not
// close and three or more triangles meet in an edge, as where walls divide a body into cells, what can be
// seen from outside is a piece, and the rest bounds nothing.
Pieces find_pieces(const Mesh& soup);

// The soup with equal points merged, if it is one piece that closes, with its triangles turned alike, and
// each edge and each point has one round of triangles. Otherwise nothing: as when triangles repeat or name a
// point twice.
std::optional<Mesh> one_closed_piece(const Mesh& soup);

// A side of a triangle.
struct Side {
  std::uint64_t edge;  // edge_of()
  std::uint32_t triangle;
  int direction;  // 1 from the smaller vertex to the larger, otherwise -1
};

// Sorts items that belong to edges, first by edge: first edge(item), and then as less(a, b) says. Those with
// the same smaller vertex are put together first; they are few, so the rest is done on all threads.
template <class Item, class Edge, class Less>
void sort_by_edge(std::vector<Item>& items, std::size_t vertices, Edge&& edge, Less&& less) {
  std::vector<std::size_t> begin(vertices + 1);
  for (const Item& item : items) begin[(edge(item) >> 32) + 1]++;
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<std::size_t> next(begin.begin(), begin.end() - 1);
  std::vector<Item> sorted(items.size());
  for (const Item& item : items) sorted[next[edge(item) >> 32]++] = item;
  items.swap(sorted);
#pragma omp parallel for schedule(static) if (items.size() > 16384)
  for (std::size_t v = 0; v < vertices; v++)
    std::sort(items.begin() + static_cast<std::ptrdiff_t>(begin[v]),
              items.begin() + static_cast<std::ptrdiff_t>(begin[v + 1]), [&](const Item& a, const Item& b) {
                return edge(a) != edge(b) ? edge(a) < edge(b) : less(a, b);
              });
}

// The sides of the triangles listed, in ascending order: those of one edge stand together, and of these the
// triangles ascend. On all threads; takes about 0.1 us for each side.
std::vector<Side> sides_of(const Mesh& mesh, const std::vector<std::uint32_t>& triangles);

// Calls visit(begin, end) for each edge with the range of its sides.
template <class Visit>
void for_edges(const std::vector<Side>& sides, Visit&& visit) {
  for (std::size_t k = 0, end; k < sides.size(); k = end) {
    for (end = k + 1; end < sides.size() && sides[end].edge == sides[k].edge;) end++;
    visit(k, end);
  }
}

// Of the triangles of `mesh` that are listed: their area, the signed volume that they enclose, and their box.
double area_of(const Mesh& mesh, const std::vector<std::uint32_t>& triangles);
double signed_volume(const Mesh& mesh, const std::vector<std::uint32_t>& triangles);
Box bounds_of(const Mesh& mesh, const std::vector<std::uint32_t>& triangles);

// Turns them round if they enclose less than nothing. Returns whether they did.
bool turn_outward(Mesh& mesh, const std::vector<std::uint32_t>& triangles);

// The triangles listed as a mesh with all points of the other one.
Mesh part_of(const Mesh& mesh, const std::vector<std::uint32_t>& triangles);

// Deals samples to one triangle after another, so that they stand at even steps of the area.
class EvenSteps {
 public:
  EvenSteps(double area, std::size_t wanted) : area_(area), wanted_(wanted) {}
  // How many samples the next triangle gets.
  std::size_t next(double area) {
    const std::size_t before = dealt_;
    for (sum_ += area; double(dealt_) + 0.5 < sum_ / area_ * double(wanted_);) dealt_++;
    return dealt_ - before;
  }

 private:
  double area_, sum_ = 0;
  std::size_t wanted_, dealt_ = 0;
};

// An edge from `from` to `to`.
struct DirectedEdge {
  std::uint32_t from = 0, to = 0;
};

// The edges that a patch must have so that the triangles listed close: the border, run through backwards. In
// a fixed order.
std::vector<DirectedEdge> missing_edges(const Mesh& mesh, const std::vector<std::uint32_t>& triangles);

}  // namespace padder
