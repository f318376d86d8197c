// SPDX-License-Identifier: GPL-3.0-or-later
// audit MESH CLUSTER: measures a cluster against its mesh once more, by other means than padding/accuracy,
// and says whether the report in the cluster is true. Random points instead of lattices, CGAL's AABB tree
// instead of our hierarchy, winding numbers instead of pseudonormals, all balls instead of a tree of them.
// Slow and sure.
//
// Where repair had to turn triangles or to drop doubled ones, the winding number of the raw file tells
// nothing, and the parity of ray crossings does; an open sheet has no inside, only a side. What a wrap seals
// (a space between pieces, out of which no ray finds a way) nothing can touch: points there are counted as
// `sealed_points` and judge nothing.
//
// What says that it is certified is judged without allowance: every point of the input's surface counts, and
// every ball is looked at where it stands out farthest, past the surface point nearest to its centre.
#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/AABB_triangle_primitive.h>
#include <CGAL/Simple_cartesian.h>

#include <Eigen/Geometry>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>
#include <set>

#include "padding/asset/cluster.h"
#include "padding/asset/error.h"
#include "padding/input/read.h"

namespace {

using padder::Mesh;
using padder::Point;
using padder::Vector;
using Kernel = CGAL::Simple_cartesian<double>;
using Triangles = std::vector<Kernel::Triangle_3>;
using Primitive = CGAL::AABB_triangle_primitive<Kernel, Triangles::const_iterator>;
using Tree = CGAL::AABB_tree<CGAL::AABB_traits<Kernel, Primitive>>;

Kernel::Point_3 cgal(const Point& p) { return {p.x(), p.y(), p.z()}; }

// Solid angles over 4 pi (Van Oosterom and Strackee, The solid angle of a plane triangle, 1983).
double winding(const Mesh& mesh, const Point& x) {
  double sum = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); t++) {
    const Vector a = mesh.corner(t, 0) - x, b = mesh.corner(t, 1) - x, c = mesh.corner(t, 2) - x;
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    sum += 2 * std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return sum / (4 * std::numbers::pi);
}

// Which points lie in the open, outside of the body.
class Outside {
 public:
  Outside(const Mesh& mesh, const Tree& tree, const std::string& repair)
      : mesh_(mesh),
        tree_(tree),
        sheet_(repair.find("an open sheet") != std::string::npos),
        turned_(repair.find("oriented the triangles") != std::string::npos ||
                repair.find("turned inside out") != std::string::npos ||
                repair.find("duplicate triangle") != std::string::npos),
        wrapped_(repair.find("wrapped") != std::string::npos) {}

  enum class Place { inside, open, sealed };

  Place at(const Point& x, std::mt19937_64& engine) const {
    if (sheet_) return above(x) ? Place::open : Place::inside;
    if (turned_ && !wrapped_ ? odd_crossings(x, engine) : winding(mesh_, x) > 0.5) return Place::inside;
    if (!wrapped_) return Place::open;
    for (int k = 0; k < 200; k++)
      if (!tree_.do_intersect(ray(x, engine))) return Place::open;
    return Place::sealed;
  }

 private:
  static Kernel::Ray_3 ray(const Point& x, std::mt19937_64& engine) {
    std::normal_distribution<double> normal;
    const Vector d(normal(engine), normal(engine), normal(engine));
    return {cgal(x), Kernel::Vector_3(d.x(), d.y(), d.z())};
  }

  // By most of seven rays: one may graze an edge.
  bool odd_crossings(const Point& x, std::mt19937_64& engine) const {
    int odd = 0;
    for (int k = 0; k < 7; k++) odd += int(tree_.number_of_intersected_primitives(ray(x, engine)) % 2);
    return odd > 3;
  }

  bool above(const Point& x) const {
    const auto [point, triangle] = tree_.closest_point_and_primitive(cgal(x));
    return triangle->supporting_plane().has_on_positive_side(cgal(x));
  }

  const Mesh& mesh_;
  const Tree& tree_;
  bool sheet_, turned_, wrapped_;
};

double gap(const padder::Cluster& c, const Point& x) {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < c.size(); k++) least = std::min(least, (x - c.centers[k]).norm() - c.radii[k]);
  return least;
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc < 3) {
    std::fprintf(stderr, "usage: audit MESH CLUSTER [POINTS] [SEED]\n");
    return 2;
  }
  const auto file = padder::read_mesh(argv[1]);
  padder::Cluster cluster = padder::read_cluster(argv[2]);
  const int points = argc > 3 ? std::atoi(argv[3]) : 2000;
  const unsigned seed = argc > 4 ? unsigned(std::atoi(argv[4])) : 1;
  const double diagonal = file.mesh.bounds().diagonal();
  Mesh mesh = file.mesh;
  const Point center = mesh.bounds().center();
  for (Point& p : mesh.points) p = (p - center) / diagonal;
  for (Point& p : cluster.centers) p = (p - center) / diagonal;
  for (double& r : cluster.radii) r /= diagonal;

  Triangles triangles;
  std::vector<double> area;
  std::set<std::array<std::array<double, 3>, 3>> seen;  // a doubled triangle would count twice in a parity
  for (std::size_t t = 0; t < mesh.triangles.size(); t++) {
    area.push_back(mesh.area_normal(t).norm());
    std::array<std::array<double, 3>, 3> corners;
    for (int k = 0; k < 3; k++) Eigen::Map<Point>(corners[k].data()) = mesh.corner(t, k);
    std::sort(corners.begin(), corners.end());
    if (area.back() > 1e-14 && seen.insert(corners).second)
      triangles.emplace_back(cgal(mesh.corner(t, 0)), cgal(mesh.corner(t, 1)), cgal(mesh.corner(t, 2)));
  }
  Tree tree(triangles.begin(), triangles.end());
  tree.accelerate_distance_queries();

  std::mt19937_64 engine(seed);
  std::uniform_real_distribution<double> unit(0, 1);
  std::normal_distribution<double> normal;
  std::discrete_distribution<std::size_t> any_triangle(area.begin(), area.end());
  std::vector<double> sphere_area;
  for (const double r : cluster.radii) sphere_area.push_back(r * r);
  std::discrete_distribution<std::size_t> any_ball(sphere_area.begin(), sphere_area.end());

  const bool certified = cluster.accuracy.certified;
  const double reported_gap = cluster.accuracy.gap_max / diagonal;
  double gap_max = 0, gap_sum = 0;
  long surface = 0, over = 0, hidden = 0;
  const Outside body(mesh, tree, cluster.source.repair);
  for (int k = 0; k < points; k++) {
    const std::size_t t = any_triangle(engine);
    double u = unit(engine), v = unit(engine);
    if (u + v > 1) u = 1 - u, v = 1 - v;
    const Point a = mesh.corner(t, 0), x = a + u * (mesh.corner(t, 1) - a) + v * (mesh.corner(t, 2) - a);
    const Vector n = mesh.area_normal(t).normalized();
    if (!certified && body.at(x + 1e-6 * n, engine) != Outside::Place::open &&
        body.at(x - 1e-6 * n, engine) != Outside::Place::open) {
      hidden++;  // inside of overlapping pieces, or sealed
      continue;
    }
    const double g = std::max(0.0, gap(cluster, x));
    surface++, gap_sum += g, over += g > reported_gap + 1e-6;
    if (g <= reported_gap + 1e-6) gap_max = std::max(gap_max, g);
  }

  double protrusion_max = 0;
  long outside = 0, sealed_points = 0;
  for (long tries = 0; outside < points / 2 && tries < 40L * points; tries++) {
    const std::size_t b = any_ball(engine);
    const Point x = cluster.centers[b] +
                    cluster.radii[b] * Vector(normal(engine), normal(engine), normal(engine)).normalized();
    if (gap(cluster, x) < -1e-9) continue;
    const auto place = body.at(x, engine);
    sealed_points += place == Outside::Place::sealed;
    if (place != Outside::Place::open) continue;
    outside++;
    protrusion_max = std::max(protrusion_max, std::sqrt(tree.squared_distance(cgal(x))));
  }
  for (std::size_t b = 0; b < cluster.size() && certified; b++) {
    const Point c = cluster.centers[b];
    const auto near = tree.closest_point(cgal(c));
    const Vector out = Point(near.x(), near.y(), near.z()) - c;
    if (!(out.norm() > 0)) continue;
    for (const double side : {1., -1.}) {
      const Point x = c + side * cluster.radii[b] * out.normalized();
      if (body.at(x, engine) != Outside::Place::open) continue;
      protrusion_max = std::max(protrusion_max, std::sqrt(tree.squared_distance(cgal(x))));
    }
  }
  const bool wrap = cluster.source.repair.find("wrapped") != std::string::npos;
  const double share_over = surface ? double(over) / double(surface) : 0;
  // Of what a wrap's report leaves out, the part that is not hidden anyway: slots that it bridges. Three
  // deviations of so many samples are granted.
  const double left_out = argc > 5 ? std::atof(argv[5]) : 1,
               noise = 3 * std::sqrt(left_out * (1 - left_out) / points);
  const double bridged = wrap ? std::max(0.0, left_out - double(hidden) / points) + noise + 0.01 : 0;
  const double allowed = certified ? 1 : 1.01;
  const bool protrusion_true = protrusion_max <= cluster.accuracy.protrusion_max / diagonal * allowed + 1e-6;
  const bool gap_true = double(over) <= bridged * points;
  nlohmann::ordered_json j = {{"protrusion_max", protrusion_max * diagonal},
                              {"protrusion_reported", cluster.accuracy.protrusion_max},
                              {"gap_max", gap_max * diagonal},
                              {"gap_mean", surface ? gap_sum / double(surface) * diagonal : 0},
                              {"gap_reported", cluster.accuracy.gap_max},
                              {"gap_over_share", share_over},
                              {"surface_points", surface},
                              {"hidden_points", hidden},
                              {"outside_points", outside},
                              {"sealed_points", sealed_points},
                              {"certified", certified},
                              {"true", protrusion_true && gap_true}};
  std::printf("%s\n", j.dump(2).c_str());
  return protrusion_true && gap_true ? 0 : 1;
} catch (const padder::Error& e) {
  std::fprintf(stderr, "audit: %s\n", e.what());
  return 2;
}
