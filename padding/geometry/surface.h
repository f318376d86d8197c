// SPDX-License-Identifier: MIT
// Nearest-point and inside queries on a triangle mesh: a bounding-volume hierarchy in double precision.
// Every later step (refit, cull, accuracy) asks its questions here.
#pragma once
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "padding/asset/mesh.h"

namespace padder {

// Nearest point of a surface.
struct Nearest {
  Point point = Point::Zero();
  double distance = std::numeric_limits<double>::infinity();
  std::uint32_t triangle = 0;      // index in the mesh; undefined when distance is infinite
  Vector normal = Vector::Zero();  // pseudonormal there, filled by Surface::signed_nearest only; unit length
};

// How signed_nearest finds the side of a point.
enum class SideBy {
  pseudonormal,  // of the nearest point: exact for an oriented surface that does not intersect itself
  winding        // winding number, where the surface is closed: exact whatever intersects, one ray more
};

// Keeps a copy of what it needs of the mesh; immutable after construction, so any number of threads may ask.
// Building costs O(n log n), about 1 s a million triangles; a query O(log n) when the point is near the
// surface.
class Surface {
 public:
  explicit Surface(const Mesh& mesh, SideBy side = SideBy::pseudonormal);

  // Nearest point closer than `limit`; distance stays infinite when there is none.
  Nearest nearest(const Point& p, double limit = std::numeric_limits<double>::infinity()) const;

  // Nearest point and the side of p: distance is negative inside. The sign is that of the angle-weighted
  // pseudonormal (Baerentzen and Aanaes, Signed distance computation using the angle weighted pseudonormal,
  // 2005): exact for a closed, oriented surface without self-intersections; for an open sheet, below its
  // normals is inside. With SideBy::winding and a closed surface, inside is where the winding number is above
  // 0.
  Nearest signed_nearest(const Point& p) const;

  // How often the surface winds around p: 0 outside, 1 inside, 2 where two solids overlap, -1 inside of a
  // solid that is turned inside out. Exact: signed crossings of a ray with every sign certified against
  // rounding; another ray is tried where one is not. None for an open surface and for points on the surface,
  // as near as rounding can tell. O(log n) and as many steps as the ray has crossings.
  std::optional<int> winding_number(const Point& p) const;

  // Edges along which the triangles' directions do not cancel: none means that the surface is closed and has
  // an inside. Faces meet where they share indices, not positions.
  std::size_t open_edges() const { return open_edges_; }
  bool closed() const { return open_edges_ == 0 && !slots_.empty(); }

  // Is any point of the surface closer to p than `limit`? Cheaper than nearest: stops at the first.
  bool any_within(const Point& p, double limit) const;

  const Mesh& mesh() const { return mesh_; }
  const Box& bounds() const { return bounds_; }

 private:
  struct Node {  // 2 boxes side by side, so that one visit decides on both children
    double low[2][3], high[2][3];
    std::uint32_t child[2];  // node, or first triangle slot when count > 0
    std::uint32_t count[2];
  };
  struct Slot {  // a triangle as the distance needs it
    Point a, ab, ac;
    std::uint32_t triangle;
  };

  // The signed crossings of the ray; none where rounding leaves one open.
  std::optional<int> crossings(const Point& p, const Vector& direction) const;
  std::uint32_t build(std::vector<std::uint32_t>& order, const std::vector<Box>& boxes, std::uint32_t begin,
                      std::uint32_t end);

  Mesh mesh_;
  SideBy side_;
  Box bounds_;
  std::size_t open_edges_ = 0;
  std::vector<Node> nodes_;
  std::vector<Slot> slots_;
  std::vector<Vector> face_normals_, vertex_normals_;
  std::vector<std::array<Vector, 3>> edge_normals_;  // edge k runs from corner k to corner k + 1
};

}  // namespace padder
