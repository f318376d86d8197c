// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/tools/audit/measure.h"

#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/AABB_triangle_primitive.h>
#include <CGAL/Simple_cartesian.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <random>

#include "padding/asset/error.h"
#include "tests/padding/shapes.h"

namespace padder::audit {
namespace {

using Kernel = CGAL::Simple_cartesian<double>;
using Triangles = std::vector<Kernel::Triangle_3>;
using Primitive = CGAL::AABB_triangle_primitive<Kernel, Triangles::const_iterator>;
using Tree = CGAL::AABB_tree<CGAL::AABB_traits<Kernel, Primitive>>;

Kernel::Point_3 cgal(const Point& p) { return {p.x(), p.y(), p.z()}; }

// Which points lie in the open, outside of the body.
class Outside {
 public:
  Outside(const Mesh& mesh, const Tree& tree) : mesh_(mesh), tree_(tree) {}

  bool open(const Point& x, std::mt19937_64& engine) const {
    return escapes(x, engine) && shapes::winding(mesh_, x) < 0.5;
  }

 private:
  bool escapes(const Point& x, std::mt19937_64& engine) const {
    std::normal_distribution<double> normal;
    for (int k = 0; k < 40; k++) {
      const Vector d(normal(engine), normal(engine), normal(engine));
      if (!tree_.do_intersect(Kernel::Ray_3{cgal(x), Kernel::Vector_3(d.x(), d.y(), d.z())})) return true;
    }
    return false;
  }

  const Mesh& mesh_;
  const Tree& tree_;
};

// The triangles of `surface` whose middle, or that of an edge, is no point of the mesh. Across a fold, that
// of an edge is the farthest.
Mesh patches_of(const Mesh& surface, const Tree& input) {
  Mesh patches;
  patches.points = surface.points;
  for (std::size_t t = 0; t < surface.triangles.size(); t++) {
    const Point &a = surface.corner(t, 0), &b = surface.corner(t, 1), &c = surface.corner(t, 2);
    for (const Point& p :
         {Point((a + b + c) / 3), Point((a + b) / 2), Point((b + c) / 2), Point((c + a) / 2)})
      if (input.squared_distance(cgal(p)) > 1e-14) {
        patches.triangles.push_back(surface.triangles[t]);
        break;
      }
  }
  return patches;
}

double gap(const Cluster& c, const Point& x) {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < c.size(); k++) least = std::min(least, (x - c.centers[k]).norm() - c.radii[k]);
  return least;
}

// All in a frame in which the mesh has its centre at the origin and a diagonal of 1.
struct Scaled {
  Mesh mesh, surface;  // `surface`: SURFACE; without it the mesh
  Cluster cluster;
  double diagonal;  // in the mesh's unit
};

Scaled scaled(Mesh mesh, Mesh surface, Cluster cluster) {
  const double diagonal = mesh.bounds().diagonal();
  const Point center = mesh.bounds().center();
  for (Mesh* m : {&mesh, &surface})
    for (Point& p : m->points) p = (p - center) / diagonal;
  for (Point& p : cluster.centers) p = (p - center) / diagonal;
  for (double& r : cluster.radii) r /= diagonal;
  return {std::move(mesh), std::move(surface), std::move(cluster), diagonal};
}

Triangles triangles_of(const Mesh& mesh) {
  Triangles triangles;
  for (std::size_t t = 0; t < mesh.triangles.size(); t++) {
    const Point &a = mesh.corner(t, 0), &b = mesh.corner(t, 1), &c = mesh.corner(t, 2);
    const double longest = std::max({(b - a).norm(), (c - b).norm(), (a - c).norm()});
    // CGAL takes no triangle without area, and its distances to one lower than this are wrong.
    if (mesh.area_normal(t).norm() > 1e-9 * longest && longest > 0)
      triangles.emplace_back(cgal(a), cgal(b), cgal(c));
  }
  return triangles;
}

// The farthest of the points that were looked at.
struct Farthest {
  double open = 0;      // of those in the open
  double anywhere = 0;  // of all, those in the open and those that nothing touches
};

Farthest largest_gap(const Scaled& s, const Outside& body, int points, std::mt19937_64& engine) {
  std::uniform_real_distribution<double> unit(0, 1);
  const double area = s.mesh.area();
  Farthest found;
  const auto look = [&](std::size_t t, const Point& x) {
    const double g = gap(s.cluster, x);
    found.anywhere = std::max(found.anywhere, g);
    if (!(g > found.open)) return;
    const Vector n = 1e-6 * s.mesh.area_normal(t).normalized();
    if (body.open(x + n, engine) || body.open(x - n, engine)) found.open = g;
  };
  for (std::size_t t = 0; t < s.mesh.triangles.size(); t++) {
    const Point a = s.mesh.corner(t, 0);
    const Vector u = s.mesh.corner(t, 1) - a, v = s.mesh.corner(t, 2) - a;
    const auto wanted = area > 0 ? int(std::ceil(points * s.mesh.area_normal(t).norm() / area)) : 0;
    for (int k = 0; k < wanted; k++) {
      double i = unit(engine), j = unit(engine);
      if (i + j > 1) i = 1 - i, j = 1 - j;
      look(t, a + i * u + j * v);
    }
    look(t, a), look(t, a + u), look(t, a + v);
    look(t, a + unit(engine) * u), look(t, a + unit(engine) * v);
  }
  return found;
}

Farthest largest_protrusion(const Scaled& s, const Tree& tree, const Outside& body, int points,
                            std::mt19937_64& engine) {
  const Cluster& cluster = s.cluster;
  std::normal_distribution<double> normal;
  double area = 0;
  for (const double r : cluster.radii) area += r * r;
  Farthest found;
  const auto look = [&](const Point& x) {
    const double distance = std::sqrt(tree.squared_distance(cgal(x)));
    if (distance > found.open && gap(cluster, x) > -1e-12 && body.open(x, engine)) found.open = distance;
  };
  for (std::size_t b = 0; b < cluster.size(); b++) {
    const Point c = cluster.centers[b];
    const double r = cluster.radii[b];
    const int wanted = 20 + int(points * r * r / area);
    for (int k = 0; k < wanted; k++)
      look(c + r * Vector(normal(engine), normal(engine), normal(engine)).normalized());
    const auto near = tree.closest_point(cgal(c));
    const Vector out = Point(near.x(), near.y(), near.z()) - c;
    if (out.norm() > 0) look(c + r * out.normalized()), look(c - r * out.normalized());
  }
  found.anywhere = found.open;
  return found;
}

// Of the points inside: 1, x and x x^T summed up.
struct Sums {
  double volume = 0;
  Vector first = Vector::Zero();
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();

  // A bar of the given cross-section from `from` to `to`.
  void add(const Point& from, const Point& to, double cross_section) {
    const double v = (to - from).norm() * cross_section;
    const Point middle = 0.5 * (from + to);
    const Vector half = 0.5 * (to - from);
    volume += v, first += v * middle;
    second += v * (middle * middle.transpose() + half * half.transpose() / 3);
  }
  Point center() const { return first / volume; }
  Eigen::Matrix3d inertia() const {  // about the centre
    const Eigen::Matrix3d about = second - volume * center() * center().transpose();
    return about.trace() * Eigen::Matrix3d::Identity() - about;
  }
};

struct Crossing {
  double at;
  int sign;
};
struct Line {
  Point place;
  std::vector<Crossing> crossings;
};

// cells x cells lines along the shortest side of the box, each at a random place of a cell of its own, and
// where they cross the triangles.
std::vector<Line> lines_through(const Mesh& mesh, int along, int cells, std::mt19937_64& engine) {
  const Box box = mesh.bounds();
  const int u = (along + 1) % 3, v = (along + 2) % 3;
  const double du = (box.high - box.low)[u] / cells, dv = (box.high - box.low)[v] / cells;
  std::uniform_real_distribution<double> unit(0, 1);
  std::vector<Line> lines(std::size_t(cells) * std::size_t(cells));
  for (int k = 0; k < cells * cells; k++) {
    lines[k].place[u] = box.low[u] + (k % cells + unit(engine)) * du;
    lines[k].place[v] = box.low[v] + (k / cells + unit(engine)) * dv;
  }
  for (std::size_t t = 0; t < mesh.triangles.size(); t++) {
    const Point &a = mesh.corner(t, 0), &b = mesh.corner(t, 1), &c = mesh.corner(t, 2);
    const auto side = [&](const Point& p, const Point& q, const Point& x) {
      return (q[u] - p[u]) * (x[v] - p[v]) - (q[v] - p[v]) * (x[u] - p[u]);
    };
    const double whole = side(a, b, c);
    if (whole == 0) continue;
    const auto cell = [&](double x, int axis, double size) {
      return std::clamp(static_cast<int>((x - box.low[axis]) / size), 0, cells - 1);
    };
    const auto [lu, hu] = std::minmax({a[u], b[u], c[u]});
    const auto [lv, hv] = std::minmax({a[v], b[v], c[v]});
    for (int j = cell(lv, v, dv); j <= cell(hv, v, dv); j++)
      for (int i = cell(lu, u, du); i <= cell(hu, u, du); i++) {
        Line& line = lines[j * cells + i];
        const double wa = side(b, c, line.place) / whole, wb = side(c, a, line.place) / whole,
                     wc = 1 - wa - wb;
        if (wa < 0 || wb < 0 || wc < 0) continue;
        line.crossings.push_back({wa * a[along] + wb * b[along] + wc * c[along], whole > 0 ? 1 : -1});
      }
  }
  for (Line& line : lines)
    std::sort(line.crossings.begin(), line.crossings.end(),
              [](const Crossing& x, const Crossing& y) { return x.at < y.at; });
  return lines;
}

bool closes(const Line& line) {
  int sum = 0;
  for (const Crossing& c : line.crossings) sum += c.sign;
  return sum == 0;
}

// The body's volume and inertia, by 1,048,576 lines; by 16,384 where the mesh is open. A stretch of a line
// between two triangles is inside if the winding number of the raw triangles is above 1/2 there, whichever
// way they face: by the crossings of the line, or where these do not cancel by solid angles, at places of
// which each stands for a part of the stretch. Such a line may leave the body through a hole, so that its
// ends in the box are stretches, too.
Sums mass_by_lines(const Mesh& mesh, std::mt19937_64& engine) {
  constexpr int parts = 4;
  const Box box = mesh.bounds();
  int along, cells = 128;
  (box.high - box.low).minCoeff(&along);
  Sums sums;
  if (!((box.high - box.low)[(along + 1) % 3] > 0 && (box.high - box.low)[(along + 2) % 3] > 0)) return sums;
  std::vector<Line> lines = lines_through(mesh, along, cells, engine);
  if (std::all_of(lines.begin(), lines.end(), closes))
    cells = 1024, lines = lines_through(mesh, along, cells, engine);
  const double cross_section =
      (box.high - box.low)[(along + 1) % 3] / cells * (box.high - box.low)[(along + 2) % 3] / cells;
  const auto add = [&](Point place, double low, double high) {
    Point from = place, to = place;
    from[along] = low, to[along] = high;
    sums.add(from, to, cross_section);
  };
  std::uniform_real_distribution<double> unit(0, 1);
  for (Line& line : lines) {
    const bool closed = closes(line);
    if (!closed) {
      line.crossings.insert(line.crossings.begin(), {box.low[along], 0});
      line.crossings.push_back({box.high[along], 0});
    }
    const std::vector<Crossing>& all = line.crossings;
    int below = 0;
    for (std::size_t k = 0; k + 1 < all.size(); k++) {
      const double low = all[k].at, length = all[k + 1].at - low;
      below -= all[k].sign;
      if (!(length > 1e-9)) continue;
      if (closed && below != 0) add(line.place, low, low + length);
      for (int part = 0; !closed && part < parts; part++) {
        line.place[along] = low + (part + unit(engine)) * length / parts;
        if (std::abs(shapes::winding(mesh, line.place)) > 0.5)
          add(line.place, low + part * length / parts, low + (part + 1) * length / parts);
      }
    }
  }
  return sums;
}

// Triangles with two corners at one point are no surface: pad leaves them out (docs/padding.md), far as they
// may lie.
Mesh without_lines(Mesh mesh) {
  std::erase_if(mesh.triangles, [&](const auto& t) {
    const Point &a = mesh.points[t[0]], &b = mesh.points[t[1]], &c = mesh.points[t[2]];
    return a == b || b == c || c == a;
  });
  return mesh;
}

}  // namespace

Measured measure(const Mesh& raw, const Mesh* surface, const Cluster& cluster, int points, unsigned seed,
                 double moved) {
  const Mesh mesh = without_lines(raw);
  const Scaled s = scaled(mesh, surface ? *surface : mesh, cluster);
  Triangles triangles = triangles_of(s.mesh);
  if (triangles.empty()) throw Error("no triangle is high enough for CGAL to measure distances to it");
  double patch_area = 0;
  const double apart = std::max(1e-4, (1 + 1e-6) * moved / s.diagonal);
  if (surface) {
    Tree input(triangles.begin(), triangles.end());
    input.accelerate_distance_queries();
    const Mesh patches = patches_of(s.surface, input);
    const Triangles more = triangles_of(patches);
    for (std::size_t t = 0; t < patches.triangles.size(); t++) {
      const Point middle = (patches.corner(t, 0) + patches.corner(t, 1) + patches.corner(t, 2)) / 3;
      if (input.squared_distance(cgal(middle)) > apart * apart) patch_area += patches.area_normal(t).norm();
    }
    input.clear();
    triangles.insert(triangles.end(), more.begin(), more.end());
  }
  Tree tree(triangles.begin(), triangles.end());
  tree.accelerate_distance_queries();
  const Outside body(s.surface, tree);
  std::mt19937_64 engine(seed);
  const Farthest gap = largest_gap(s, body, points, engine);
  const Farthest protrusion = largest_protrusion(s, tree, body, points, engine);
  Measured m;
  m.protrusion = protrusion.open * s.diagonal, m.gap = gap.open * s.diagonal;
  m.gap_anywhere = gap.anywhere * s.diagonal, m.patch_area = patch_area * s.diagonal * s.diagonal;
  // Moving the mesh into the audit's frame costs some digits. Patches nearer to the input than 1e-7 are left
  // out.
  const double rounding = 1e-8 * s.diagonal, left_out = surface ? 1e-7 * s.diagonal : 0;
  const Accuracy& reported = cluster.accuracy;
  // Of an open sheet the reported protrusion is a sample, and one sample does not prove another wrong.
  m.protrusion_holds = reported.proved_against == SurfaceKind::none ||
                       m.protrusion <= reported.protrusion_max * (1 + 1e-9) + rounding + left_out;
  m.gap_holds = m.gap <= reported.gap_max * (1 + 1e-9) + rounding;
  return m;
}

MassInside mass_inside(const Mesh& mesh, unsigned seed) {
  std::mt19937_64 engine(seed);
  const Scaled s = scaled(mesh, mesh, {});
  const Sums sums = mass_by_lines(s.mesh, engine);
  MassInside inside;
  if (!(sums.volume > 0)) return inside;
  inside.volume = sums.volume * std::pow(s.diagonal, 3);
  inside.inertia = sums.inertia() * std::pow(s.diagonal, 5);
  return inside;
}

}  // namespace padder::audit
