// SPDX-License-Identifier: GPL-3.0-or-later
// Makes closed solids from rings of points, and exact unions and differences of solids. This is enough to
// model the parts. All lengths are in metres.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "padding/asset/mesh.h"

namespace padder::assets {

using Ring = std::vector<Point>;  // a closed polygon in space

// A ring about (x, y, z), level in z, counter-clockwise from above: a rectangle of these half sizes whose
// corners are rounded with `radius` in `steps` chords. 0 < radius < both half sizes.
Ring rounded_rectangle(const Point& center, double half_x, double half_y, double radius, int steps = 5);

// A circle across y, around (x, z).
Ring circle(double x, double y, double z, double radius, int segments);

// The same ring, with every point's y replaced.
Ring at_y(Ring ring, double y);

// A convex ring that lies across y, each edge moved inwards by `distance`, each corner on both moved edges.
Ring inset(const Ring& ring, double distance);

// The smallest convex ring across y around the points.
Ring hull(std::vector<Point> points);

// The surface that joins ring to ring; all have the same number of points. The first and the last ring are
// closed by flat faces; with `closed` the last ring joins the first instead, which gives a solid with one
// handle. Faces point outward.
Mesh loft(const std::vector<Ring>& rings, bool closed = false);

// A convex ring across y from y0 to y1, its end edges cut by `chamfer`.
Mesh extrude(const Ring& ring, double y0, double y1, double chamfer);

// A ring of (radius, y, 0) around the y axis, in `segments`; every radius > 0.
Mesh revolve(const Ring& profile, int segments);

// Along y through (x, z) from y0 to y1: a drill.
Mesh cylinder(double x, double z, double radius, double y0, double y1, int segments);

// A solid in exact arithmetic (CGAL's corefinement), so that faces that coincide or touch need no special
// care. Operands must be closed, outward and free of self-intersections. Throws Error when a result is not.
class Solid {
 public:
  explicit Solid(const Mesh& mesh);
  ~Solid();
  Solid(Solid&&) noexcept;
  Solid& operator=(Solid&&) noexcept;

  Solid& add(const Mesh& mesh);
  Solid& cut(const Mesh& mesh);
  Mesh mesh() const;  // rounded to doubles

 private:
  struct Exact;
  std::unique_ptr<Exact> exact_;
};

// The mesh with every coordinate rounded to so many decimals, because the last bits of a sine differ between
// machines and must not change a file. Vertices that coincide are merged; faces that lose their area are
// dropped.
Mesh rounded(const Mesh& mesh, int decimals);

// The mesh rounded, with each flat region triangulated anew (Delaunay) between its borders. This removes the
// cuts that boolean operations leave in a flat region, and points in the middle of a straight edge. Throws
// Error when the result is not a closed, outward solid without self-intersections.
Mesh finished(const Mesh& mesh, int decimals);

// As an OBJ file; `comment` has one or more lines.
std::string to_obj(const Mesh& mesh, const std::string& comment, int decimals);

}  // namespace padder::assets
