// SPDX-License-Identifier: MIT
// Nearest-point and inside queries on a triangle mesh, by a bounding-volume hierarchy in double precision.
// All later steps (refit, cull, accuracy) ask their questions here.
#pragma once
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "padding/asset/mesh.h"
#include "padding/geometry/triangle_tree.h"

namespace padder {

// The nearest point of a surface.
struct Nearest {
  Point point = Point::Zero();
  double distance = std::numeric_limits<double>::infinity();
  std::uint32_t triangle = 0;      // of the mesh; undefined when distance is infinite
  Vector normal = Vector::Zero();  // pseudonormal of unit length; only from Surface::signed_nearest
  bool inside = false;             // of what the surface bounds: not in a sheet that is thick; as above
};

// How signed_nearest finds on which side of the surface a point lies.
enum class SideBy {
  pseudonormal,  // by that of the nearest point: exact for an oriented surface that does not intersect itself
  winding        // by the winding number: exact for any closed surface, but costs a ray for each query
};

// Keeps a copy of the mesh and does not change after construction, so any number of threads may ask. Building
// takes O(n log n) on all threads, about 1 s for a million triangles. A query takes O(log n) when the point
// is near the surface.
class Surface {
 public:
  // Distances are to `mesh`. The winding number is that of `solid`, if it is given: a closed surface whose
  // inside has its boundary on `mesh`. It may be empty; then nothing is inside.
  explicit Surface(const Mesh& mesh, SideBy side = SideBy::pseudonormal,
                   std::shared_ptr<const Surface> solid = nullptr);

  // A closed surface that stands off another one, as a wrap does: no point of triangle k is farther from that
  // surface than standoff[k]. Only clearance() and certified_distance() look at it.
  Surface(const Mesh& mesh, SideBy side, std::vector<double> standoff);

  // Any triangles inside a closed surface with standoffs, their hull. mesh() and nearest() are those of the
  // triangles, which may be open, crossed or turned at random. The hull says what is inside.
  Surface(Surface triangles, std::shared_ptr<const Surface> hull);

  void set_side(SideBy side) { side_ = side; }

  // From triangle `first` on, `mesh` is a sheet: the body has half of the thickness on either side of it, and
  // what else the surface bounds. signed_nearest() and certified_distance() are of that body.
  void set_sheet(std::size_t first, double thickness);
  double half_thickness(std::uint32_t triangle) const {
    return triangle >= first_sheet_ ? half_thickness_ : 0;
  }
  double half_thickness() const { return half_thickness_; }  // of the sheet; 0: there is none, or it is thin

  // The nearest point, if it is closer than `limit`. Otherwise the distance stays infinite.
  Nearest nearest(const Point& p, double limit = std::numeric_limits<double>::infinity()) const;

  // The nearest point; its distance is negative when p is inside. With SideBy::pseudonormal the sign is that
  // of the angle-weighted pseudonormal (Baerentzen and Aanaes, Signed distance computation using the angle
  // weighted pseudonormal, 2005). It is exact for a closed, oriented surface without self-intersections; for
  // an open sheet, inside is below its normals. With SideBy::winding and a closed surface, inside is where
  // the winding number is above 0.
  Nearest signed_nearest(const Point& p) const;

  // The same, where nearest(p) is known. With `known_inside` the caller knows that the winding number is
  // above 0, which saves the ray.
  Nearest with_side(const Point& p, const Nearest& nearest, bool known_inside = false) const;

  // The smallest distance to a triangle (of the hull, if there is one) less the triangle's standoff: how
  // large an inner ball around p may be. `point` is moved towards p by the standoff. Negative where p lies
  // within the standoff. Without standoffs this is nearest().
  Nearest clearance(const Point& p, double limit = std::numeric_limits<double>::infinity()) const;

  double distance_to(std::uint32_t triangle, const Point& p) const;  // of one triangle of `mesh`

  // What a proof may say of the place of p: a ball of radius r around p stands out by at most r plus this
  // (certify.h). Negative inside: minus the clearance. Inside is where the winding number is above 0, and a
  // point for which there is none counts as outside. With a hull it is never above the distance to `mesh`.
  double certified_distance(const Point& p) const;

  // How often the surface winds around p: 0 outside, 1 inside, 2 where two solids overlap, -1 inside a solid
  // that is turned inside out. It counts the signed crossings of a ray. The result is exact: each sign is
  // certified against rounding, and another ray is tried where one is not. There is no result for an open
  // surface, nor for a point on the surface as far as rounding can tell. Takes O(log n) and a step for each
  // crossing.
  std::optional<int> winding_number(const Point& p) const;

  // The number of edges along which the directions of the triangles do not cancel. With none, the surface is
  // closed and has an inside. Triangles meet where they share indices, not positions.
  std::size_t open_edges() const { return solid_ ? solid_->open_edges_ : open_edges_; }
  // Can any point be inside?
  bool has_inside() const { return !solid_ || !solid_->slots_.empty(); }
  bool closed() const { return open_edges() == 0 && (solid_ || !slots_.empty()); }

  // The sum of the signed crossings of a ray from p with the triangles of `mesh`, without those to `skip`:
  // +1 where the ray leaves through the front. No result where rounding leaves a crossing open. Each
  // component of the direction is at most 1 and none is 0. `visit` gets each triangle that is crossed, with
  // its sign.
  std::optional<int> crossings(const Point& p, const Vector& direction,
                               const std::function<bool(std::uint32_t)>& skip = {},
                               const std::function<void(std::uint32_t, int)>& visit = {}) const;
  static const std::vector<Vector>& ray_directions();  // without a pattern, for crossings()
  // A ray grazes a triangle if the sine of the angle between them is less.
  static constexpr double kGrazing = 0.05;

  // Of some of these directions and their opposites, that in which a ray from p leaves the bounds soonest: it
  // crosses the fewest triangles. It points to the front of a triangle with the normal `n`, and does not
  // graze it, or there is none; with n = 0 it may point anywhere.
  std::optional<Vector> shortest_ray(const Point& p, const Vector& n) const;

  // As those of the tree (triangle_tree.h): the triangles near a box, and those near each other.
  void visit(const Box& box, const std::function<void(std::uint32_t)>& visit) const {
    tree_.visit(box, visit);
  }
  void visit_pairs(const std::function<bool(std::uint32_t, std::uint32_t)>& visit) const {
    tree_.visit_pairs(mesh_, visit);
  }

  // Is any point of the surface closer to p than `limit`? Cheaper than nearest(), because it stops at the
  // first.
  bool any_within(const Point& p, double limit) const;

  // The parts that needles were cut into for the tree of distances; 0: none was.
  std::size_t needle_parts() const { return parts_ ? parts_->slot.size() : 0; }

  const Mesh& mesh() const { return mesh_; }
  const Mesh& boundary() const { return hull() ? hull()->mesh() : mesh_; }  // what bounds the inside
  // Null: there is none.
  const Surface* hull() const { return solid_ && !solid_->slot_standoff_.empty() ? solid_.get() : nullptr; }
  const Box& bounds() const { return bounds_; }

 private:
  struct Slot {  // a triangle of the tree, prepared for distances
    Point a;
    Vector ab, ac;
  };

  Nearest signed_nearest_in_hull(const Point& p, const Nearest& nearest) const;
  Vector normal_at(const Point& p, const Nearest& nearest) const;
  Nearest outside_of_sheet(const Point& p, const Nearest& nearest) const;
  std::optional<int> winding_in_solid(const Point& p) const;
  void find_normals();
  void cut_needles();

  // The tree in which nearest triangles and rays are looked for, and the slot of tree_ for each of its slots.
  struct Parts {
    TriangleTree tree;
    std::vector<std::uint32_t> slot;
  };
  const TriangleTree& near_tree() const { return parts_ ? parts_->tree : tree_; }
  std::uint32_t triangle_at(std::uint32_t slot) const {  // of near_tree()
    return tree_.triangles()[parts_ ? parts_->slot[slot] : slot];
  }

  Mesh mesh_;
  std::size_t first_sheet_ = std::numeric_limits<std::size_t>::max();
  double half_thickness_ = 0;
  std::shared_ptr<const Surface> sheet_;  // alone; null unless it is thick and `mesh` has other triangles
  SideBy side_;
  std::shared_ptr<const Surface> solid_;
  Box bounds_;
  std::size_t open_edges_ = 0;
  TriangleTree tree_;
  std::vector<Slot> slots_;             // as the tree's
  std::shared_ptr<const Parts> parts_;  // null where no triangle is much smaller than its box
  std::vector<Vector> face_normals_, vertex_normals_;
  std::vector<double> slot_standoff_;                 // none, or one for each slot
  std::vector<std::array<double, 2>> node_standoff_;  // the largest below each child of a node
  std::vector<std::array<Vector, 3>> edge_normals_;   // edge k runs from corner k to corner k + 1
};

}  // namespace padder
