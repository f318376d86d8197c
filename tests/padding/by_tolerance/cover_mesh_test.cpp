// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/cover_mesh.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "padding/geometry/random.h"
#include "padding/verify/certify.h"
#include "tests/error_of.h"
#include "tests/padding/balls.h"
#include "tests/padding/shapes.h"
#include "tests/padding/threads.h"

namespace padder {
namespace {

std::string refusal(const Mesh& mesh, const Length& tolerance, const CoverMeshOptions& options = {}) {
  return error_of([&] { cover_mesh(mesh, tolerance, options); });
}

// The oracle is the certificate, applied to the cluster and the mesh in their own frame.
void expect_kept(const Cluster& cluster, const Mesh& mesh, double tolerance) {
  const std::vector<Ball> balls = balls_of(cluster);
  const double most = tolerance * (1 + 1e-6);
  EXPECT_TRUE(gap_failures(mesh, BallSet(balls), most, 0.1 * tolerance).empty());
  const ProtrusionBound protrusion = protrusion_bound(Surface(mesh), balls);
  EXPECT_TRUE(protrusion.proved);
  EXPECT_LE(protrusion.max, most);
}

TEST(CoverMesh, IsCertifiedInTheMeshsOwnFrameAndUnit) {
  const Mesh mesh = shapes::moved(shapes::torus(30, 10, 48, 24), {1000, -2000, 500});
  const Cluster cluster = cover_mesh(mesh, Length::share(0.02), {.name = "ring", .unit = "mm"});
  const double tolerance = 0.02 * mesh.bounds().diagonal();
  EXPECT_TRUE(cluster.accuracy.certified);
  EXPECT_EQ(cluster.accuracy.proved_against, SurfaceKind::input);
  EXPECT_LE(cluster.accuracy.gap_max, tolerance * (1 + 1e-9));
  EXPECT_LE(cluster.accuracy.protrusion_max, tolerance * (1 + 1e-9));
  EXPECT_GT(cluster.accuracy.coverage, 0.3);
  EXPECT_GT(cluster.size(), 10u);
  EXPECT_LT(cluster.size(), 300u);
  expect_kept(cluster, mesh, tolerance);
  const MassProperties mass = mass_properties(mesh);
  EXPECT_NEAR(cluster.mass.volume, mass.volume, 1e-6 * mass.volume);
  EXPECT_LT((cluster.mass.center - mass.center).norm(), 1e-5);
  EXPECT_EQ(cluster.name, "ring");
  EXPECT_EQ(cluster.unit, "mm");
  EXPECT_EQ(cluster.source.triangles, mesh.triangles.size());
  EXPECT_NEAR(nlohmann::json::parse(cluster.settings)["tolerance"].get<double>(), tolerance, 1e-12);
  EXPECT_EQ(cluster_from_json(to_json(cluster), "again").radii, cluster.radii);
}

Mesh box_at(double place) {
  return shapes::moved(shapes::box({0, 0, 0}, {0.01, 0.02, 0.03}), {place, place, place});
}

// There writing a sphere down moves it, by more than a protrusion of 0 allows or by more than the tolerance.
TEST(CoverMesh, ProvesTheSpheresAsTheyAreWritten) {
  const CoverMeshOptions inside{.protrusion = Length::of(0), .gap = Length::share(0.05)};
  for (const double place : {1e4, 1e6}) {
    const Mesh mesh = box_at(place);
    const Cluster cluster = cover_mesh(mesh, {}, inside);
    EXPECT_TRUE(cluster.accuracy.certified) << place;
    for (std::size_t k = 0; k < cluster.size(); k++) {
      const Vector low = cluster.centers[k] - mesh.bounds().low,
                   high = mesh.bounds().high - cluster.centers[k];
      EXPECT_LE(cluster.radii[k], std::min(low.minCoeff(), high.minCoeff())) << place;
    }
  }
  EXPECT_FALSE(cover_mesh(box_at(1e13), Length::share(0.05)).accuracy.certified);
}

// Writing the spheres down moves them by up to 1 % of the diagonal at 1e12, which once opened gaps, and by
// more than the protrusion at 1e13.
TEST(CoverMesh, ProvesThatTheSpheresAsTheyAreWrittenFillTheBody) {
  const CoverMeshOptions whole{.protrusion = Length::share(0.05), .gap = Length::of(0)};
  for (const double place : {1e5, 1e12}) {
    const Mesh mesh = box_at(place);
    const Cluster cluster = cover_mesh(mesh, {}, whole);
    EXPECT_TRUE(cluster.accuracy.certified) << place;
    EXPECT_EQ(cluster.accuracy.gap_max, 0) << place;
    const Box box = mesh.bounds();
    const BallSet set(balls_of(cluster, box.low));  // about the box's corner, where nothing is rounded
    Random random(5);
    for (int k = 0; k < 20000; k++) {
      const Vector share(random.uniform(), random.uniform(), random.uniform());
      ASSERT_TRUE(set.any_contains(share.cwiseProduct(box.high - box.low))) << place << ", seed 5";
    }
  }
  EXPECT_FALSE(cover_mesh(box_at(1e13), {}, whole).accuracy.certified);
}

TEST(CoverMesh, TakesAnAbsoluteTolerance) {
  const Mesh mesh = shapes::box({0, 0, 0}, {4, 2, 1}, 3);
  const Cluster cluster = cover_mesh(mesh, Length::of(0.1));
  EXPECT_TRUE(cluster.accuracy.certified);
  expect_kept(cluster, mesh, 0.1);
}

TEST(CoverMesh, SameForAnyNumberOfThreads) {
  const Mesh mesh = shapes::torus(3, 1, 24, 12);
  const auto text = [&] { return to_json(cover_mesh(mesh, Length::share(0.02))); };
  EXPECT_EQ(with_threads(1, text), with_threads(3, text));
}

// Two boxes that overlap. The winding number is 2 where they do.
TEST(CoverMesh, AMeshMayIntersectItself) {
  const Mesh mesh =
      shapes::joined(shapes::box({0, 0, 0}, {2, 1, 1}), shapes::box({1, 0.2, 0.2}, {3, 0.8, 0.8}));
  EXPECT_TRUE(cover_mesh(mesh, Length::share(0.03)).accuracy.certified);
}

TEST(CoverMesh, ARadiusLimitThatLeavesSurfaceOpenIsNotCertified) {
  CoverMeshOptions options{.min_radius = Length::share(0.2)};
  const Cluster cluster = cover_mesh(shapes::box({0, 0, 0}, {4, 2, 1}), Length::share(0.01), options);
  EXPECT_FALSE(cluster.accuracy.certified);
}

// Far from the origin and large: the promise holds in the mesh's own frame.
TEST(CoverMesh, EachErrorByItself) {
  const Mesh mesh = shapes::moved(shapes::box({0, 0, 0}, {40, 20, 10}), {300, -200, 50});
  CoverMeshOptions options{.protrusion = Length::share(0.02), .gap = Length::of(0)};
  const Cluster outer = cover_mesh(mesh, {}, options);
  EXPECT_TRUE(outer.accuracy.certified);
  const BallSet set(balls_of(outer));
  Random random(5);
  for (int k = 0; k < 20000; k++) {
    const Point x(300 + 40 * random.uniform(), -200 + 20 * random.uniform(), 50 + 10 * random.uniform());
    ASSERT_TRUE(set.any_contains(x)) << "seed 5, point " << k;
  }
  EXPECT_EQ(gap_bound(mesh, set).upper, 0);

  options.gap.reset(), options.protrusion = Length::of(0);
  const Cluster inner = cover_mesh(mesh, Length::share(0.02), options);
  EXPECT_TRUE(inner.accuracy.certified);
  EXPECT_LE(protrusion_bound(Surface(mesh), balls_of(inner)).max, 0);
  options.gap = Length::of(0);
  EXPECT_TRUE(holds(refusal(mesh, Length::share(0.02), options), "allow one"));
}

TEST(CoverMesh, RefusesWhatItCannotCover) {
  const Mesh cube = shapes::box({0, 0, 0}, {1, 1, 1});
  const Length tolerance = Length::share(0.05);
  CoverMeshOptions named{.name = "part 7"};
  EXPECT_EQ(refusal(Mesh(), tolerance, named).rfind("part 7: ", 0), 0u);
  Mesh open = cube;
  open.triangles.pop_back();
  EXPECT_TRUE(holds(refusal(open, tolerance), "open"));
  EXPECT_TRUE(holds(refusal(shapes::turned_over(cube), tolerance), "outward"));
  Mesh wrong = cube;
  wrong.triangles[3][1] = 99;
  EXPECT_TRUE(holds(refusal(wrong, tolerance), "triangle 3 names vertex 99"));
  Mesh infinite = cube;
  infinite.points[2].y() = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(holds(refusal(infinite, tolerance), "vertex 2 is not finite"));
  for (const Length& bad : {Length(), Length::of(-1), Length::share(std::nan(""))})
    EXPECT_TRUE(holds(refusal(cube, bad), "tolerance"));
  CoverMeshOptions effort{.effort = 4};
  EXPECT_TRUE(holds(refusal(cube, tolerance, effort), "effort"));
  CoverMeshOptions radius{.max_radius = Length::of(-1)};
  EXPECT_TRUE(holds(refusal(cube, tolerance, radius), "radius"));
}

}  // namespace
}  // namespace padder
