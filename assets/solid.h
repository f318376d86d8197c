// SPDX-License-Identifier: GPL-3.0-or-later
// Closed solids from rings of points, and exact unions and differences of them: enough of a modeller to make
// parts. All lengths in metres.
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

// Skin over the rings, which have equally many points; their flat ends are closed. With `closed` the last
// joins the first instead (a solid with one handle). Turned outward.
Mesh loft(const std::vector<Ring>& rings, bool closed = false);

// A convex ring across y from y0 to y1, its end edges cut by `chamfer`.
Mesh extrude(const Ring& ring, double y0, double y1, double chamfer);

// A ring of (radius, y, 0) around the y axis, in `segments`; every radius > 0.
Mesh revolve(const Ring& profile, int segments);

// Along y through (x, z) from y0 to y1: a drill.
Mesh cylinder(double x, double z, double radius, double y0, double y1, int segments);

// A solid in exact arithmetic (CGAL's corefinement): faces that lie on each other or touch are no special
// case. The operands must be closed, outward and free of self-intersections; throws Error when an operation
// does not give such.
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

// Every coordinate rounded to that many decimals, so that the last bits of a sine change no byte of a file.
// Vertices that fall together are merged and faces that lose their area dropped.
Mesh rounded(const Mesh& mesh, int decimals);

// Rounded, and each flat region cut into Delaunay triangles between its borders alone: the traces that the
// operands of a boolean leave on it go, as do the points where a straight edge was split. Throws Error when
// the result is not a closed, outward solid without self-intersections.
Mesh finished(const Mesh& mesh, int decimals);

// As an OBJ file; `comment` has one or more lines.
std::string to_obj(const Mesh& mesh, const std::string& comment, int decimals);

}  // namespace padder::assets
