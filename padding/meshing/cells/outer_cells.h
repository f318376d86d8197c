// SPDX-License-Identifier: GPL-3.0-or-later
// Cuts triangles where they cross, and keeps of the pieces those that bound the body.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "padding/meshing/cells/contacts.h"

namespace padder {

// What a triangle stands for.
enum class TriangleRole : std::uint8_t {
  bounds,  // a part of the closed surface that has the body inside
  patch,   // so too, but it closes a hole, and is not in the input
  sheet    // bounds nothing by itself
};

// The pieces that are kept. The body is where the winding number of all `bounds` and `patch` triangles is
// above 0.
struct OuterCells {
  // First the boundary of the body, facing outward, then what lies outside with nothing inside (sheets, and
  // the few pieces of which rounding leaves open where they lie). Pieces that meet share their points.
  Mesh mesh;
  std::size_t boundary = 0;           // the number of triangles of the first kind
  std::vector<std::uint32_t> source;  // for each, the triangle of the soup that it is a part of
  Mesh buried;                        // the pieces with the body on both sides, which are left out
  bool too_many = false;  // cuts cross at more places within triangles than the limit: the lists are empty
};

// `soup` is indexed: equal points have one index; `contacts` are those of its triangles, whichever way they
// face. The `bounds` and `patch` triangles close: along each edge their directions cancel. A piece that no
// other triangle crosses has one winding number on either side, so one ray decides on it; an undecided piece
// is kept, which is the safe side for a cover. Triangles too thin to have a normal are left out. Runs on all
// threads; the result does not depend on their number.
//
// Of a thousand triangles that all cross each other, each is cut along a thousand lines, which cross at half
// a million places: `limit` is for the sum of them.
OuterCells outer_cells(const Surface& soup, const std::vector<TriangleRole>& roles, const Contacts& contacts,
                       std::size_t limit);

// --- The step that cuts one triangle along segments (cut_triangle.cpp) ---

// Another triangle meets this one between two points, given by index; `place` as in MeetingPoint.
struct TriangleCut {
  std::array<std::uint32_t, 2> point;
  std::array<int, 2> place;

  // Does it run along the edge behind corner k?
  bool runs_along(int k) const {
    const auto on = [k](int p) { return p == k || p == (k + 1) % 3 || p == 3 + k; };
    return on(place[0]) && on(place[1]);
  }
};

// The pieces of a triangle, facing as it does.
struct TrianglePieces {
  static constexpr std::uint32_t kFresh = 1u << 31, kNone = ~0u;  // marks the index of a fresh point
  std::vector<std::array<std::uint32_t, 3>> faces;
  std::vector<std::uint32_t> region;  // of each face: regions are separated by cuts
  std::vector<Point> places;          // of each region a point well inside
  std::vector<double> room;           // of each region: how far inside, about
  // The regions along the edge behind corner k, from that corner on, are those from rim[rim_of[k]] on: one
  // for each part between two points. kNone where rounding has left no piece.
  std::vector<std::uint32_t> rim;
  std::array<std::uint32_t, 3> rim_of{};
  std::vector<Point> fresh;  // points where cuts cross each other
  bool too_many = false;     // of these; nothing else is here then
};

// Triangulates triangle t of the mesh such that the cuts, and the points on its edges (in order along each,
// rim[k] behind corner k), are respected. Points have their indices in `points`. What is closer together
// than `near` is so by rounding. Gives up at more than `limit` fresh points.
TrianglePieces cut_triangle(const Mesh& mesh, std::uint32_t t, const std::vector<Point>& points,
                            const std::array<std::vector<std::uint32_t>, 3>& rim,
                            std::span<const TriangleCut> cuts, double near, std::size_t limit);

}  // namespace padder
