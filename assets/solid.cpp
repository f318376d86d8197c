// SPDX-License-Identifier: GPL-3.0-or-later
#include "assets/solid.h"

#include <CGAL/Exact_predicates_exact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/corefinement.h>
#include <CGAL/Surface_mesh.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <numbers>

#include "padding/asset/error.h"
#include "padding/input/polygon.h"

namespace padder::assets {

using std::numbers::pi;

Ring rounded_rectangle(const Point& center, double half_x, double half_y, double radius, int steps) {
  if (!(radius > 0 && radius < half_x && radius < half_y))
    throw Error("a corner's radius must fit its rectangle");
  Ring ring;
  for (int corner = 0; corner < 4; corner++) {
    const double sx = corner == 0 || corner == 3 ? 1 : -1, sy = corner < 2 ? 1 : -1;
    for (int k = 0; k <= steps; k++) {
      const double angle = pi / 2 * (corner + static_cast<double>(k) / steps);
      ring.push_back(center + Vector(sx * (half_x - radius) + radius * std::cos(angle),
                                     sy * (half_y - radius) + radius * std::sin(angle), 0));
    }
  }
  return ring;
}

Ring circle(double x, double y, double z, double radius, int segments) {
  Ring ring;
  for (int k = 0; k < segments; k++) {
    const double angle = 2 * pi * (k + 0.5) / segments;
    ring.emplace_back(x + radius * std::cos(angle), y, z + radius * std::sin(angle));
  }
  return ring;
}

Ring at_y(Ring ring, double y) {
  for (Point& p : ring) p.y() = y;
  return ring;
}

Ring inset(const Ring& ring, double distance) {
  const std::size_t n = ring.size();
  double area = 0;  // its sign tells the sense of the ring
  for (std::size_t k = 0; k < n; k++)
    area += ring[k].x() * ring[(k + 1) % n].z() - ring[(k + 1) % n].x() * ring[k].z();
  const auto inward = [&](std::size_t k) {
    const Vector along = (ring[(k + 1) % n] - ring[k]).normalized();
    return Vector(area > 0 ? Vector(-along.z(), 0, along.x()) : Vector(along.z(), 0, -along.x()));
  };
  Ring moved;
  for (std::size_t k = 0; k < n; k++) {
    const Vector a = inward((k + n - 1) % n), b = inward(k);
    moved.push_back(ring[k] + distance / (1 + a.dot(b)) * (a + b));
  }
  return moved;
}

Ring hull(std::vector<Point> points) {  // Andrew's monotone chain, 1979
  std::ranges::sort(points, [](const Point& p, const Point& q) {
    return p.x() < q.x() || (p.x() == q.x() && p.z() < q.z());
  });
  Ring ring;
  for (int side = 0; side < 2; side++) {
    const std::size_t begin = ring.size();
    for (const Point& p : points) {
      while (ring.size() >= begin + 2) {
        const Vector u = ring.back() - ring[ring.size() - 2], v = p - ring.back();
        if (u.x() * v.z() - u.z() * v.x() > 1e-12 * u.norm() * v.norm()) break;
        ring.pop_back();
      }
      ring.push_back(p);
    }
    ring.pop_back();
    std::ranges::reverse(points);
  }
  return ring;
}

Mesh loft(const std::vector<Ring>& rings, bool closed) {
  const std::uint32_t n = static_cast<std::uint32_t>(rings.at(0).size()),
                      count = static_cast<std::uint32_t>(rings.size());
  Mesh mesh;
  for (const Ring& ring : rings) {
    if (ring.size() != n) throw Error("the rings of a loft must have equally many points");
    mesh.points.insert(mesh.points.end(), ring.begin(), ring.end());
  }
  for (std::uint32_t r = 0; r + (closed ? 0 : 1) < count; r++)
    for (std::uint32_t k = 0; k < n; k++) {
      const std::uint32_t a = r * n + k, b = r * n + (k + 1) % n, c = (r + 1) % count * n + k,
                          d = (r + 1) % count * n + (k + 1) % n;
      mesh.triangles.push_back({a, b, d}), mesh.triangles.push_back({a, d, c});
    }
  if (!closed) {
    std::vector<std::array<std::uint32_t, 3>> cap;
    triangulate_polygon(rings.front(), cap);
    for (const auto& t : cap) mesh.triangles.push_back({t[2], t[1], t[0]});
    cap.clear();
    triangulate_polygon(rings.back(), cap);
    const std::uint32_t last = (count - 1) * n;
    for (const auto& t : cap) mesh.triangles.push_back({last + t[0], last + t[1], last + t[2]});
  }
  if (mass_properties(mesh).volume < 0)
    for (auto& t : mesh.triangles) std::swap(t[1], t[2]);
  return mesh;
}

Mesh extrude(const Ring& ring, double y0, double y1, double chamfer) {
  const Ring small = inset(ring, chamfer);
  return loft({at_y(small, y0), at_y(ring, y0 + chamfer), at_y(ring, y1 - chamfer), at_y(small, y1)});
}

Mesh revolve(const Ring& profile, int segments) {
  std::vector<Ring> rings;
  for (int k = 0; k < segments; k++) {
    const double angle = 2 * pi * k / segments;
    Ring ring;
    for (const Point& p : profile) ring.emplace_back(p.x() * std::cos(angle), p.y(), p.x() * std::sin(angle));
    rings.push_back(std::move(ring));
  }
  return loft(rings, true);
}

Mesh cylinder(double x, double z, double radius, double y0, double y1, int segments) {
  return loft({circle(x, y0, z, radius, segments), circle(x, y1, z, radius, segments)});
}

// Exact booleans

using Kernel = CGAL::Exact_predicates_exact_constructions_kernel;
using Surface = CGAL::Surface_mesh<Kernel::Point_3>;
namespace pmp = CGAL::Polygon_mesh_processing;

struct Solid::Exact {
  Surface surface;
  explicit Exact(const Mesh& mesh) {
    std::vector<Surface::Vertex_index> place;
    for (const Point& p : mesh.points) place.push_back(surface.add_vertex({p.x(), p.y(), p.z()}));
    for (const auto& t : mesh.triangles)
      if (surface.add_face(place[t[0]], place[t[1]], place[t[2]]) == Surface::null_face())
        throw Error("a solid's skin must be a manifold");
  }
};

Solid::Solid(const Mesh& mesh) : exact_(std::make_unique<Exact>(mesh)) {}
Solid::~Solid() = default;
Solid::Solid(Solid&&) noexcept = default;
Solid& Solid::operator=(Solid&&) noexcept = default;

Solid& Solid::add(const Mesh& mesh) {
  Exact other(mesh);
  if (!pmp::corefine_and_compute_union(exact_->surface, other.surface, exact_->surface))
    throw Error("a union does not bound a solid: change a dimension");
  return *this;
}

Solid& Solid::cut(const Mesh& mesh) {
  Exact other(mesh);
  if (!pmp::corefine_and_compute_difference(exact_->surface, other.surface, exact_->surface))
    throw Error("a difference does not bound a solid: change a dimension");
  return *this;
}

Mesh Solid::mesh() const {
  const Surface& s = exact_->surface;
  Mesh mesh;
  std::vector<std::uint32_t> place(s.number_of_vertices() + s.number_of_removed_vertices());
  for (const auto v : s.vertices()) {
    place[v] = static_cast<std::uint32_t>(mesh.points.size());
    const Kernel::Point_3& p = s.point(v);
    p.exact();  // so that the interval below has no width left but the rounding
    mesh.points.emplace_back(CGAL::to_double(p.x()), CGAL::to_double(p.y()), CGAL::to_double(p.z()));
  }
  for (const auto f : s.faces()) {
    std::array<std::uint32_t, 3> t;
    int k = 0;
    for (const auto v : s.vertices_around_face(s.halfedge(f))) t[static_cast<std::size_t>(k++)] = place[v];
    mesh.triangles.push_back(t);
  }
  return mesh;
}

Mesh rounded(const Mesh& mesh, int decimals) {
  const double grid = std::pow(10, decimals);
  Mesh out;
  std::map<std::array<double, 3>, std::uint32_t> known;
  std::vector<std::uint32_t> place;
  for (const Point& p : mesh.points) {
    const Point q = (p * grid).array().round() + 0.0;  // + 0: no minus zero
    const auto [entry, fresh] =
        known.try_emplace({q.x(), q.y(), q.z()}, static_cast<std::uint32_t>(out.points.size()));
    if (fresh) out.points.push_back(q / grid);
    place.push_back(entry->second);
  }
  for (const auto& t : mesh.triangles) {
    const std::array<std::uint32_t, 3> u = {place[t[0]], place[t[1]], place[t[2]]};
    if (u[0] != u[1] && u[1] != u[2] && u[2] != u[0]) out.triangles.push_back(u);
  }
  return out;
}

std::string to_obj(const Mesh& mesh, const std::string& comment, int decimals) {
  std::string text = "# " + comment + "\n";
  for (std::size_t at = 2; (at = text.find('\n', at)) + 1 < text.size(); at += 3) text.insert(at + 1, "# ");
  char line[128];
  for (const Point& p : mesh.points) {
    std::snprintf(line, sizeof line, "v %.*f %.*f %.*f\n", decimals, p.x(), decimals, p.y(), decimals, p.z());
    text += line;
  }
  for (const auto& t : mesh.triangles) {
    std::snprintf(line, sizeof line, "f %u %u %u\n", t[0] + 1, t[1] + 1, t[2] + 1);
    text += line;
  }
  return text;
}

}  // namespace padder::assets
