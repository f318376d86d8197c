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

// Both in a frame in which the mesh has its centre at the origin and a diagonal of 1.
struct Scaled {
  Mesh mesh;
  padder::Cluster cluster;
  double diagonal;  // in the mesh's unit
};

Scaled scaled(Mesh mesh, padder::Cluster cluster) {
  const double diagonal = mesh.bounds().diagonal();
  const Point center = mesh.bounds().center();
  for (Point& p : mesh.points) p = (p - center) / diagonal;
  for (Point& p : cluster.centers) p = (p - center) / diagonal;
  for (double& r : cluster.radii) r /= diagonal;
  return {std::move(mesh), std::move(cluster), diagonal};
}

// The triangles that have an area, each once: a doubled triangle would count twice in a parity.
Triangles triangles_of(const Mesh& mesh) {
  Triangles triangles;
  std::set<std::array<std::array<double, 3>, 3>> seen;
  for (std::size_t t = 0; t < mesh.triangles.size(); t++) {
    std::array<std::array<double, 3>, 3> corners;
    for (int k = 0; k < 3; k++) Eigen::Map<Point>(corners[k].data()) = mesh.corner(t, k);
    std::sort(corners.begin(), corners.end());
    if (mesh.area_normal(t).norm() > 1e-14 && seen.insert(corners).second)
      triangles.emplace_back(cgal(mesh.corner(t, 0)), cgal(mesh.corner(t, 1)), cgal(mesh.corner(t, 2)));
  }
  return triangles;
}

// Random points on the surface, and how far each is from the spheres.
struct GapSamples {
  double max = 0, sum = 0;
  long surface = 0, over = 0, hidden = 0;  // points; `over` the reported gap; `hidden` ones judge nothing
};

GapSamples sample_gaps(const Scaled& s, const Outside& body, int points, std::mt19937_64& engine) {
  std::vector<double> area;
  for (std::size_t t = 0; t < s.mesh.triangles.size(); t++) area.push_back(s.mesh.area_normal(t).norm());
  std::discrete_distribution<std::size_t> any_triangle(area.begin(), area.end());
  std::uniform_real_distribution<double> unit(0, 1);
  const double reported = s.cluster.accuracy.gap_max / s.diagonal;
  GapSamples found;
  for (int k = 0; k < points; k++) {
    const std::size_t t = any_triangle(engine);
    double u = unit(engine), v = unit(engine);
    if (u + v > 1) u = 1 - u, v = 1 - v;
    const Point a = s.mesh.corner(t, 0),
                x = a + u * (s.mesh.corner(t, 1) - a) + v * (s.mesh.corner(t, 2) - a);
    const Vector n = s.mesh.area_normal(t).normalized();
    if (!s.cluster.accuracy.certified && body.at(x + 1e-6 * n, engine) != Outside::Place::open &&
        body.at(x - 1e-6 * n, engine) != Outside::Place::open) {
      found.hidden++;  // inside of overlapping pieces, or sealed
      continue;
    }
    const double g = std::max(0.0, gap(s.cluster, x));
    found.surface++, found.sum += g, found.over += g > reported + 1e-6;
    if (g <= reported + 1e-6) found.max = std::max(found.max, g);
  }
  return found;
}

// Points on the spheres, and how far those in the open are from the surface.
struct ProtrusionSamples {
  double max = 0;
  long outside = 0, sealed = 0;  // points
};

ProtrusionSamples sample_protrusions(const Scaled& s, const Tree& tree, const Outside& body, int points,
                                     std::mt19937_64& engine) {
  const padder::Cluster& cluster = s.cluster;
  std::normal_distribution<double> normal;
  std::vector<double> sphere_area;
  for (const double r : cluster.radii) sphere_area.push_back(r * r);
  std::discrete_distribution<std::size_t> any_ball(sphere_area.begin(), sphere_area.end());
  ProtrusionSamples found;
  const auto stands_out = [&](const Point& x) {
    found.max = std::max(found.max, std::sqrt(tree.squared_distance(cgal(x))));
  };
  for (long tries = 0; found.outside < points / 2 && tries < 40L * points; tries++) {
    const std::size_t b = any_ball(engine);
    const Point x = cluster.centers[b] +
                    cluster.radii[b] * Vector(normal(engine), normal(engine), normal(engine)).normalized();
    if (gap(cluster, x) < -1e-9) continue;
    const auto place = body.at(x, engine);
    found.sealed += place == Outside::Place::sealed;
    if (place != Outside::Place::open) continue;
    found.outside++;
    stands_out(x);
  }
  for (std::size_t b = 0; b < cluster.size() && cluster.accuracy.certified; b++) {
    const Point c = cluster.centers[b];
    const auto near = tree.closest_point(cgal(c));
    const Vector out = Point(near.x(), near.y(), near.z()) - c;
    if (!(out.norm() > 0)) continue;
    for (const double side : {1., -1.}) {
      const Point x = c + side * cluster.radii[b] * out.normalized();
      if (body.at(x, engine) == Outside::Place::open) stands_out(x);
    }
  }
  return found;
}

struct Arguments {
  int points = 2000;
  unsigned seed = 1;
  // Share of the surface that a wrap's report says cannot be touched; the last argument.
  double left_out = 1;
};

// Prints what was measured beside what was reported, and gives the exit code.
int judge(const Scaled& s, const GapSamples& gaps, const ProtrusionSamples& protrusions,
          const Arguments& arguments) {
  const padder::Accuracy& reported = s.cluster.accuracy;
  const bool wrap = s.cluster.source.repair.find("wrapped") != std::string::npos;
  // Of what a wrap's report leaves out, the part that is not hidden anyway: slots that it bridges. Three
  // deviations of so many samples are granted.
  const double left_out = arguments.left_out, points = arguments.points,
               noise = 3 * std::sqrt(left_out * (1 - left_out) / points);
  const double bridged = wrap ? std::max(0.0, left_out - double(gaps.hidden) / points) + noise + 0.01 : 0;
  const double allowed = reported.certified ? 1 : 1.01;
  const bool protrusion_true = protrusions.max <= reported.protrusion_max / s.diagonal * allowed + 1e-6;
  const bool gap_true = double(gaps.over) <= bridged * points;
  const double surface = double(gaps.surface);
  const nlohmann::ordered_json j = {{"protrusion_max", protrusions.max * s.diagonal},
                                    {"protrusion_reported", reported.protrusion_max},
                                    {"gap_max", gaps.max * s.diagonal},
                                    {"gap_mean", gaps.surface ? gaps.sum / surface * s.diagonal : 0},
                                    {"gap_reported", reported.gap_max},
                                    {"gap_over_share", gaps.surface ? double(gaps.over) / surface : 0},
                                    {"surface_points", gaps.surface},
                                    {"hidden_points", gaps.hidden},
                                    {"outside_points", protrusions.outside},
                                    {"sealed_points", protrusions.sealed},
                                    {"certified", reported.certified},
                                    {"true", protrusion_true && gap_true}};
  std::printf("%s\n", j.dump(2).c_str());
  return protrusion_true && gap_true ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc < 3) {
    std::fprintf(stderr, "usage: audit MESH CLUSTER [POINTS] [SEED] [LEFT_OUT]\n");
    return 2;
  }
  Arguments arguments;
  if (argc > 3) arguments.points = std::atoi(argv[3]);
  if (argc > 4) arguments.seed = unsigned(std::atoi(argv[4]));
  if (argc > 5) arguments.left_out = std::atof(argv[5]);
  const Scaled s = scaled(padder::read_mesh(argv[1]).mesh, padder::read_cluster(argv[2]));
  const Triangles triangles = triangles_of(s.mesh);
  Tree tree(triangles.begin(), triangles.end());
  tree.accelerate_distance_queries();
  const Outside body(s.mesh, tree, s.cluster.source.repair);
  std::mt19937_64 engine(arguments.seed);
  const GapSamples gaps = sample_gaps(s, body, arguments.points, engine);
  const ProtrusionSamples protrusions = sample_protrusions(s, tree, body, arguments.points, engine);
  return judge(s, gaps, protrusions, arguments);
} catch (const padder::Error& e) {
  std::fprintf(stderr, "audit: %s\n", e.what());
  return 2;
}
