// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/verify/accuracy.h"

#include <gtest/gtest.h>

#include <numbers>

#include "padding/meshing/repair.h"
#include "tests/padding/balls.h"
#include "tests/padding/random_input.h"
#include "tests/padding/threads.h"

namespace padder {
namespace {

Measured of(const Mesh& mesh, const std::vector<Ball>& balls, const AccuracyOptions& options = {}) {
  Repaired body;
  body.mesh = mesh;
  return measure(mesh, body, Surface(mesh), balls, options);
}

constexpr double kPi = std::numbers::pi;

TEST(Accuracy, OneBallOverASphereHasClosedForms) {
  const Mesh sphere = shapes::sphere(6);  // faces lie up to 0.0006 under the unit sphere
  const double d = 0.05;
  const auto over = of(sphere, {{Point::Zero(), 1 + d}}).accuracy;
  EXPECT_NEAR(over.protrusion_max, d, 1e-3);
  EXPECT_NEAR(over.protrusion_mean, d, 1e-3);
  EXPECT_NEAR(over.protrusion_p95, d, 1e-3);
  EXPECT_EQ(over.gap_max, 0);
  EXPECT_EQ(over.coverage, 1);
  EXPECT_NEAR(over.volume_ratio, std::pow(1 + d, 3), 0.005);
  EXPECT_LT(over.normal_error_p95_deg, 1.5);
  const auto under = of(sphere, {{Point::Zero(), 1 - d}}).accuracy;
  EXPECT_LE(under.protrusion_max, 0);
  EXPECT_NEAR(under.gap_max, d, 1e-3);
  EXPECT_NEAR(under.gap_mean, d, 1e-3);
  EXPECT_EQ(under.coverage, 0);
}

TEST(Accuracy, BallAroundACube) {
  const Mesh cube = shapes::box({-1, -1, -1}, {1, 1, 1}, 4);
  const Measured m = of(cube, {{Point::Zero(), std::sqrt(3.0)}});
  EXPECT_NEAR(m.accuracy.protrusion_max, std::sqrt(3.0) - 1, 1e-9);
  EXPECT_EQ(m.accuracy.gap_max, 0);
  EXPECT_NEAR(m.volume_union, 4 / 3. * kPi * std::pow(3, 1.5), 1e-3);
}

TEST(Accuracy, BallInACubeLeavesItsCornersOpen) {
  const Mesh cube = shapes::box({-1, -1, -1}, {1, 1, 1}, 4);
  const auto a = of(cube, {{Point::Zero(), 1}}).accuracy;
  EXPECT_NEAR(a.gap_max, std::sqrt(3.0) - 1, 2e-3);
  EXPECT_NEAR(a.protrusion_max, 0, 1e-12);
  // Mean of |x| - 1 over a face: integrate sqrt(1 + u^2 + v^2) over the unit square by the midpoint rule.
  double sum = 0;
  for (int i = 0; i < 1000; i++)
    for (int j = 0; j < 1000; j++)
      sum += std::sqrt(1 + std::pow((i + .5) / 1000, 2) + std::pow((j + .5) / 1000, 2));
  EXPECT_NEAR(a.gap_mean, sum / 1e6 - 1, 3e-4);
}

TEST(Accuracy, VolumeOfTwoOverlappingBalls) {
  const double r = 1, d = 1.2;  // distance of the centres
  const double lens = kPi * (4 * r + d) * std::pow(2 * r - d, 2) / 12;
  const Measured m = of(shapes::sphere(4), {{Point(-d / 2, 0, 0), r}, {Point(d / 2, 0, 0), r}});
  EXPECT_NEAR(m.volume_union, 2 * 4 / 3. * kPi - lens, 2e-3);
}

// The oracle: random points against all balls and triangles. It uses nothing of padding/ but the mesh.
struct BruteForce {
  const Mesh& mesh;

  double distance(const Point& x) const {  // by dense barycentric search on each triangle: plain, slow, sure
    double least = 1e300;
    for (std::size_t t = 0; t < mesh.triangles.size(); t++) {
      const Point a = mesh.corner(t, 0);
      const Vector u = mesh.corner(t, 1) - a, v = mesh.corner(t, 2) - a;
      if ((a - x).norm() - u.norm() - v.norm() > least) continue;
      for (int i = 0; i <= 12; i++)
        for (int j = 0; i + j <= 12; j++) least = std::min(least, (a + i / 12. * u + j / 12. * v - x).norm());
    }
    return least;
  }
  bool inside(const Point& x) const { return shapes::winding(mesh, x) > 0.5; }
};

TEST(Accuracy, AgreesWithBruteForceOnRandomClusters) {
  for (std::uint64_t seed = 1; seed <= 3; seed++) {
    shapes::RandomInput random(seed);
    const Mesh mesh = shapes::blob(random, 3);
    std::vector<Ball> balls;
    for (int k = 0; k < 40; k++) balls.push_back({0.8 * random.point(), random.uniform(0.1, 0.5)});
    const Measured m = of(mesh, balls);
    const BruteForce brute{mesh};
    double gap_max = 0, protrusion_max = 0;
    for (int k = 0; k < 20000; k++) {
      const Point x = random.on(mesh, random.below(mesh.triangles.size()));
      gap_max = std::max(gap_max, gap_to(balls, x));
    }
    double inside = 0, box = 0;
    for (int k = 0; k < 200000; k++) box++, inside += gap_to(balls, 2 * random.point()) <= 0;
    for (int k = 0; k < 3000; k++) {
      const Ball& b = balls[k % balls.size()];
      const Point x = b.center + b.radius * random.direction();
      if (gap_to(balls, x) < -1e-9 || brute.inside(x)) continue;
      protrusion_max = std::max(protrusion_max, brute.distance(x));
    }
    EXPECT_GE(m.accuracy.gap_max, gap_max);
    EXPECT_LE(m.accuracy.gap_max, gap_max + 0.05);
    EXPECT_GE(m.accuracy.protrusion_max,
              protrusion_max - 0.01);  // the oracle's distance is to a grid: a little too large
    EXPECT_LE(m.accuracy.protrusion_max,
              protrusion_max + 0.15);  // ours is a bound; 3,000 points miss the tips
    EXPECT_NEAR(m.volume_union, 64 * inside / box, 0.15);
  }
}

// What accuracy.h promises of the figures that are sampled. The balls follow the triangles, so that samples
// at centroids alone would find no gap.
TEST(Accuracy, SamplesGiveWhatManyMoreGive) {
  const Mesh mesh = shapes::torus(1, 0.4, 24, 12);
  std::vector<Ball> balls;
  for (std::size_t t = 0; t < mesh.triangles.size(); t++) {
    balls.push_back({mesh.middle(t), 0.35 * (mesh.corner(t, 1) - mesh.corner(t, 0)).norm()});
  }
  for (const bool few : {false, true}) {
    if (few) balls.resize(40);
    const Measured m = of(mesh, balls), more = of(mesh, balls, {400000, 400000, 1000});
    const Accuracy &a = m.accuracy, &b = more.accuracy;
    EXPECT_NEAR(a.gap_mean, b.gap_mean, 0.005 * b.gap_max);
    EXPECT_NEAR(a.gap_p95, b.gap_p95, 0.01 * b.gap_max);
    EXPECT_NEAR(a.protrusion_mean, b.protrusion_mean, 0.005 * b.protrusion_max);
    EXPECT_NEAR(a.protrusion_p95, b.protrusion_p95, 0.01 * b.protrusion_max);
    EXPECT_NEAR(a.coverage, b.coverage, 0.01);
    EXPECT_NEAR(a.normal_error_mean_deg, b.normal_error_mean_deg, 0.5);
    EXPECT_NEAR(a.normal_error_p95_deg, b.normal_error_p95_deg, 1);
    EXPECT_NEAR(a.volume_ratio, b.volume_ratio, 0.02 * b.volume_ratio);
    EXPECT_EQ(a.gap_bound, b.gap_bound);
  }
}

TEST(Accuracy, SameForAnyNumberOfThreads) {
  const Mesh mesh = shapes::torus(1, 0.3, 40, 16);
  std::vector<Ball> balls;
  for (int k = 0; k < 30; k++) balls.push_back({Point(std::cos(k), std::sin(k), 0), 0.35});
  const auto measured = [&] { return of(mesh, balls); };
  const Measured one = with_threads(1, measured), three = with_threads(3, measured);
  EXPECT_EQ(one.accuracy.protrusion_mean, three.accuracy.protrusion_mean);
  EXPECT_EQ(one.accuracy.gap_max, three.accuracy.gap_max);
  EXPECT_EQ(one.volume_union, three.volume_union);
}

TEST(Accuracy, NoBallsIsNoCoverage) { EXPECT_EQ(of(shapes::sphere(2), {}).accuracy.coverage, 0); }

}  // namespace
}  // namespace padder
