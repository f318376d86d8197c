// SPDX-License-Identifier: GPL-3.0-or-later
// Cuts one triangle along segments.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "padding/asset/mesh.h"

namespace padder {

// Another triangle meets this one between two points, given by index; `place` as in MeetingPoint.
struct TriangleCut {
  std::array<std::uint32_t, 2> point;
  std::array<int, 2> place;
};

// The pieces of a triangle, facing as it does.
struct TrianglePieces {
  static constexpr std::uint32_t kFresh = 1u << 31;  // marks the index of a fresh point
  std::vector<std::array<std::uint32_t, 3>> faces;
  std::vector<std::uint32_t> region;  // of each face: regions are separated by cuts
  std::vector<Point> places;          // of each region a point well inside
  std::vector<Point> fresh;           // points where cuts cross each other
};

// Triangulates triangle t of the mesh such that the cuts, and the points on its edges (in order along each,
// rim[k] behind corner k), are respected. Points have their indices in `points`.
TrianglePieces cut_triangle(const Mesh& mesh, std::uint32_t t, const std::vector<Point>& points,
                            const std::array<std::vector<std::uint32_t>, 3>& rim,
                            std::span<const TriangleCut> cuts);

}  // namespace padder
