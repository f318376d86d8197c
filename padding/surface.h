// Nearest-point and inside queries on a triangle mesh: a bounding-volume hierarchy in double precision.
// Every later step (refit, cull, accuracy) asks its questions here.
#pragma once
#include <cstdint>
#include <limits>
#include <vector>

#include "padding/mesh.h"

namespace padder {

// Nearest point of a surface.
struct Nearest {
  Point point = Point::Zero();
  double distance = std::numeric_limits<double>::infinity();
  std::uint32_t triangle = 0;      // index in the mesh; undefined when distance is infinite
  Vector normal = Vector::Zero();  // pseudonormal there, filled by Surface::signed_nearest only; unit length
};

// Keeps a copy of what it needs of the mesh; immutable after construction, so any number of threads may ask.
// Building costs O(n log n), about 1 s a million triangles; a query O(log n) when the point is near the
// surface.
class Surface {
 public:
  explicit Surface(const Mesh& mesh);

  // Nearest point closer than `limit`; distance stays infinite when there is none.
  Nearest nearest(const Point& p, double limit = std::numeric_limits<double>::infinity()) const;

  // Nearest point and the side of p: distance is negative inside. The sign is that of the angle-weighted
  // pseudonormal (Baerentzen and Aanaes, Signed distance computation using the angle weighted pseudonormal,
  // 2005): exact for a closed, oriented surface without self-intersections; for an open sheet, below its
  // normals is inside.
  Nearest signed_nearest(const Point& p) const;

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

  std::uint32_t build(std::vector<std::uint32_t>& order, const std::vector<Box>& boxes, std::uint32_t begin,
                      std::uint32_t end);

  Mesh mesh_;
  Box bounds_;
  std::vector<Node> nodes_;
  std::vector<Slot> slots_;
  std::vector<Vector> face_normals_, vertex_normals_;
  std::vector<std::array<Vector, 3>> edge_normals_;  // edge k runs from corner k to corner k + 1
};

}  // namespace padder
