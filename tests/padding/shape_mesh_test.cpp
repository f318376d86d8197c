// SPDX-License-Identifier: GPL-3.0-or-later
// Spheres for the round shapes of robots, against the shapes themselves: what a report proves holds for the
// cylinder of the file, and not only for the polyhedron that stands for it.
#include <algorithm>
#include <functional>
#include <numbers>

#include "padding/asset/error.h"
#include "padding/robot.h"
#include "padding/verify/sphere_points.h"
#include "tests/padding/balls.h"
#include "tests/padding/export/samples.h"

namespace padder::samples {
namespace {

// A shape by closed formulas: the distance of a point to it, 0 inside, and points on its surface.
struct Exact {
  std::function<double(const Point&)> distance;
  std::vector<Point> surface;
};

constexpr int kPoints = 20000;

Exact moved(Exact shape, const Vector& by) {
  for (Point& p : shape.surface) p += by;
  return {[=](const Point& p) { return shape.distance(p - by); }, shape.surface};
}

// Along z. Half of the points lie on the wall, and those of the ends also near their rims.
Exact cylinder(double r, double length) {
  Exact e;
  e.distance = [=](const Point& p) {
    return std::hypot(std::max(0.0, std::hypot(p.x(), p.y()) - r),
                      std::max(0.0, std::abs(p.z()) - length / 2));
  };
  for (int k = 0; k < kPoints; k++) {
    const Vector n = sphere_point(k, kPoints);
    const double angle = std::atan2(n.y(), n.x()), z = n.z() * length / 2;
    e.surface.emplace_back(r * std::cos(angle), r * std::sin(angle), z);
    const double in = r * std::sqrt(std::abs(n.z()));
    e.surface.emplace_back(in * std::cos(angle), in * std::sin(angle), std::copysign(length / 2, z));
  }
  return e;
}

Exact capsule(double r, double length) {
  Exact e;
  e.distance = [=](Point p) {
    p.z() -= std::clamp(p.z(), -length / 2, length / 2);
    return std::max(0.0, p.norm() - r);
  };
  for (int k = 0; k < kPoints; k++) {
    const Vector n = sphere_point(k, kPoints);
    e.surface.push_back(r * n + Vector(0, 0, std::copysign(length / 2, n.z())));
    const double wide = r / std::hypot(n.x(), n.y());
    e.surface.emplace_back(wide * n.x(), wide * n.y(), n.z() * length / 2);
  }
  return e;
}

// The nearest point q of the surface has p - q = t q / a^2 for a t > 0, found by bisection.
Exact ellipsoid(const Vector& a) {
  Exact e;
  e.distance = [=](const Point& p) {
    const Vector a2 = a.cwiseProduct(a);
    if (p.cwiseQuotient(a).norm() <= 1) return 0.0;
    const auto nearest = [&](double t) -> Point {
      return p.cwiseProduct(a2).cwiseQuotient(a2 + Vector::Constant(t));
    };
    double low = 0, high = p.cwiseProduct(a).norm();
    for (int k = 0; k < 60; k++) {
      const double t = 0.5 * (low + high);
      (nearest(t).cwiseQuotient(a).norm() > 1 ? low : high) = t;
    }
    return (p - nearest(high)).norm();
  };
  for (int k = 0; k < 2 * kPoints; k++) e.surface.push_back(sphere_point(k, 2 * kPoints).cwiseProduct(a));
  return e;
}

Exact united(const std::vector<Exact>& shapes) {
  Exact e;
  e.distance = [=](const Point& p) {
    double least = shapes[0].distance(p);
    for (const Exact& s : shapes) least = std::min(least, s.distance(p));
    return least;
  };
  for (const Exact& s : shapes)
    for (const Point& p : s.surface) {
      const Vector off = 1e-9 * sphere_point(7, 20);  // tells no inside at a surface, but at others' insides
      const bool buried = std::ranges::count_if(shapes, [&](const Exact& o) {
                            return o.distance(p + off) == 0 && o.distance(p - off) == 0;
                          }) > 0;
      if (!buried) e.surface.push_back(p);
    }
  return e;
}

double largest_gap(const Cluster& c, const std::vector<Point>& points) {
  const std::vector<Ball> balls = balls_of(c);
  double most = 0;
#pragma omp parallel for reduction(max : most)
  for (std::size_t k = 0; k < points.size(); k++) most = std::max(most, gap_to(balls, points[k]));
  return most;
}

// Each sphere is sampled, and from the farthest sample the way goes on uphill.
double largest_protrusion(const Cluster& c, const Exact& shape) {
  double most = 0;
#pragma omp parallel for reduction(max : most)
  for (std::size_t k = 0; k < c.size(); k++) {
    const auto out = [&](const Vector& n) { return shape.distance(c.centers[k] + c.radii[k] * n); };
    Vector best = Vector::UnitX();
    for (int j = 0; j < 300; j++)
      if (const Vector n = sphere_point(j, 300, double(k)); out(n) > out(best)) best = n;
    for (double step = 0.1; step > 1e-4; step *= 0.7)
      for (const Vector& by : {Vector(1, 0, 0), Vector(0, 1, 0), Vector(0, 0, 1)})
        for (const double sign : {-step, step})
          if (const Vector n = (best + sign * by).normalized(); out(n) > out(best)) best = n;
    most = std::max(most, out(best));
  }
  return most;
}

class ShapeMeshTest : public ExportTest {
 protected:
  Padded pad(const std::string& geoms, const PadOptions& options) {
    write_file(folder_ / "r.xml",
               "<mujoco><worldbody><body name='a'>" + geoms + "</body></worldbody></mujoco>");
    const PaddedRobot r = pad_robot(folder_ / "r.xml", options, {.reading = {}, .poses = 0});
    for (std::size_t k = 0; k < r.model.bodies.size(); k++)
      if (r.model.bodies[k].name == "a") return {r.model.bodies[k].cluster, r.reports[k], {}, {}};
    throw Error("no body");
  }

  Padded expect_true(const std::string& geoms, const Exact& shape, const PadOptions& options) {
    SCOPED_TRACE(geoms);
    Padded p = pad(geoms, options);
    const Accuracy& a = p.cluster.accuracy;
    const double protrusion = largest_protrusion(p.cluster, shape),
                 gap = largest_gap(p.cluster, shape.surface);
    EXPECT_LE(protrusion, a.protrusion_bound + kRounding);
    EXPECT_LE(gap, a.gap_bound + kRounding);
    EXPECT_TRUE(a.certified) << p.report.reason;
    return p;
  }

  static PadOptions within(double tolerance) { return {.tolerance = Length::of(tolerance)}; }
  static PadOptions each(double protrusion, double gap) {
    return {.protrusion = Length::of(protrusion), .gap = Length::of(gap)};
  }

  static constexpr double kRounding = 1e-9;
  const std::string kCylinder = "<geom type='cylinder' size='0.5 1'/>",
                    kCapsule = "<geom type='capsule' size='0.2 0.5'/>",
                    kEllipsoid = "<geom type='ellipsoid' size='1 0.6 0.4'/>";
};

TEST_F(ShapeMeshTest, AToleranceHoldsForTheBodyOfTheFile) {
  expect_true(kCylinder, cylinder(0.5, 2), within(0.01));
  expect_true(kCapsule, capsule(0.2, 1), within(0.003));
  expect_true(kEllipsoid, ellipsoid({1, 0.6, 0.4}), within(0.01));
}

TEST_F(ShapeMeshTest, BoundsWithoutAToleranceHoldForTheBodyOfTheFile) {
  const PadOptions by_depth{.edge_length = Length::share(0.08)}, count{.max_spheres = 40};
  expect_true(kCylinder, cylinder(0.5, 2), by_depth);
  expect_true(kCapsule, capsule(0.2, 1), by_depth);
  expect_true(kEllipsoid, ellipsoid({1, 0.6, 0.4}), by_depth);
  expect_true(kCylinder, cylinder(0.5, 2), count);
}

TEST_F(ShapeMeshTest, EveryLevelOfDetailHoldsForTheBodyOfTheFile) {
  const PadOptions ladder{.lod = {Length::of(0.04), Length::of(0.02)}};
  const Cluster c = expect_true(kCylinder, cylinder(0.5, 2), ladder).cluster;
  ASSERT_EQ(c.lods.size(), 1u);
  Cluster coarse;
  coarse.centers = c.lods[0].centers, coarse.radii = c.lods[0].radii;
  EXPECT_LE(largest_protrusion(coarse, cylinder(0.5, 2)), c.lods[0].accuracy.protrusion_bound + kRounding);
  EXPECT_LE(largest_gap(coarse, cylinder(0.5, 2).surface), c.lods[0].accuracy.gap_bound + kRounding);
  const PadOptions thinned{.depth_ratio = 0.2, .tolerance = Length::of(0.04)};
  expect_true(kCylinder, cylinder(0.5, 2), thinned);
  const PadOptions volume{.tolerance = Length::of(0.02), .balance = Balance::volume};
  expect_true(kCylinder, cylinder(0.5, 2), volume);
}

TEST_F(ShapeMeshTest, AProtrusionOfZeroStaysWithinTheBodyOfTheFile) {
  EXPECT_EQ(expect_true(kCylinder, cylinder(0.5, 2), each(0, 0.03)).cluster.accuracy.protrusion_bound, 0);
  EXPECT_EQ(expect_true(kCapsule, capsule(0.2, 1), each(0, 0.01)).cluster.accuracy.protrusion_bound, 0);
}

TEST_F(ShapeMeshTest, AGapOfZeroCoversTheBodyOfTheFile) {
  const auto expect_filled = [&](const std::string& geoms, const Exact& shape, double protrusion) {
    const Padded p = expect_true(geoms, shape, each(protrusion, 0));
    EXPECT_TRUE(p.report.filled_body);
    EXPECT_EQ(p.cluster.accuracy.gap_bound, 0);
    std::vector<Point> inside;
    for (const Point& s : shape.surface)
      for (const double share : {0.999, 0.9, 0.5}) inside.push_back(share * s);
    EXPECT_LE(largest_gap(p.cluster, inside), 0);
  };
  expect_filled(kCylinder, cylinder(0.5, 2), 0.03);
  expect_filled(kCapsule, capsule(0.2, 1), 0.02);
  expect_filled(kEllipsoid, ellipsoid({1, 0.6, 0.4}), 0.03);
}

// The wedge between two cylinders that touch is surface, too, as deep as it goes.
TEST_F(ShapeMeshTest, SeveralShapesOfALinkAreOneBody) {
  const std::string geoms =
      "<geom type='cylinder' size='0.2 0.3'/><geom type='cylinder' size='0.2 0.3' pos='0.4 0 0'/>"
      "<geom type='sphere' size='0.3' pos='0 0 0.4'/>";
  const Exact shape = united(
      {cylinder(0.2, 0.6), moved(cylinder(0.2, 0.6), {0.4, 0, 0}), moved(capsule(0.3, 0), {0, 0, 0.4})});
  expect_true(geoms, shape, within(0.01));
  expect_true(geoms, shape, each(0.02, 0));
}

TEST_F(ShapeMeshTest, AToleranceThatIsNoNumberIsRefused) {
  EXPECT_THROW(pad(kCylinder, within(std::nan(""))), Error);
}

TEST_F(ShapeMeshTest, TheMassIsWithinHalfAPercent) {
  const auto volume = [&](const std::string& geoms) { return pad(geoms, within(0.04)).cluster.mass.volume; };
  EXPECT_NEAR(volume(kCylinder) / (0.5 * std::numbers::pi), 1, 0.005);
  EXPECT_NEAR(volume(kEllipsoid) / (0.32 * std::numbers::pi), 1, 0.005);
}

}  // namespace
}  // namespace padder::samples
