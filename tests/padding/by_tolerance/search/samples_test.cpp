// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/search/samples.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "padding/asset/error.h"
#include "padding/geometry/point_tree.h"
#include "padding/geometry/random.h"
#include "tests/padding/shapes.h"

namespace padder {
namespace {

TEST(Samples, CoveredDiscIsPythagoras) {
  EXPECT_NEAR(covered_disc(3, 2), 4, 1e-12);  // 3, 4, 5
  EXPECT_NEAR(covered_disc(0, 0.1), 0.1, 1e-12);
}

// Every surface point has a point to cover nearby, relative to the disc that a ball covers there.
TEST(Samples, PointsAreAsDenseAsTheThicknessAsks) {
  const Mesh meshes[] = {shapes::box({0, 0, 0}, {0.7, 0.7, 0.01}),
                         shapes::box({0, 0, 0}, {0.6, 0.6, 0.6}, 40), shapes::torus(0.3, 0.1, 40, 20)};
  for (const Mesh& mesh : meshes) {
    const Surface surface(mesh);
    const Samples samples = sample_surface(surface, {.tolerance_sum = 0.02});
    EXPECT_LE(samples.coarse.size(), samples.fine.size());
    std::vector<Point> points;
    for (const CoverPoint& c : samples.coarse) points.push_back(c.point);
    const PointTree tree(points);
    Random random(1);
    for (int k = 0; k < 2000; k++) {
      const Point x = random_point(random, mesh.corners(random.below(mesh.triangles.size())));
      std::vector<std::uint32_t> found;
      tree.find(x, 0.11,
                found);  // 0.11: larger than the disc of the thickest of these bodies, 0.3, over the density
      bool near = false;
      for (auto c : found) near = near || (points[c] - x).norm() <= 2.5 * samples.coarse[c].margin + 0.005;
      EXPECT_TRUE(near);
    }
    for (const Sample& s : samples.grown) {
      EXPECT_LT(surface.nearest(s.point).distance, 1e-12);
      EXPECT_NEAR(std::abs(surface.signed_nearest(s.ball.center).distance), s.ball.radius, 1e-12);
    }
  }
}

TEST(Samples, ThinWallKeepsBothSides) {
  const Surface surface(shapes::box({0, 0, 0}, {0.7, 0.7, 1e-6}, 90));
  SampleOptions options{.tolerance_sum = 0.03};
  std::size_t above = 0, below = 0;
  for (const CoverPoint& c : sample_surface(surface, options).coarse) (c.point.z() > 5e-7 ? above : below)++;
  EXPECT_GT(above, 500u);
  EXPECT_NEAR(static_cast<double>(above) / static_cast<double>(below), 1, 0.1);
}

// A bar with as many facets has slivers along its whole length. Their samples follow the area.
TEST(Samples, SliversSideBySideShareTheirSamples) {
  const auto count = [](int facets) {
    Mesh bar;
    for (int end = 0; end < 2; end++)
      for (int k = 0; k < facets; k++) bar.points.push_back(shapes::on_circle(k, facets, 0.1, 0.9 * end));
    const auto n = static_cast<std::uint32_t>(facets);
    for (std::uint32_t k = 0; k < n; k++) {
      const std::uint32_t next = (k + 1) % n;
      shapes::add_quad(bar, k, next, n + next, n + k);
      if (k > 0 && k + 1 < n) {
        bar.triangles.push_back({0, k + 1, k});
        bar.triangles.push_back({n, n + k, n + k + 1});
      }
    }
    const Samples samples = sample_surface(Surface(bar), {.tolerance_sum = 0.02});
    return static_cast<double>(samples.grown.size() + samples.fine.size());
  };
  const double few = count(100), many = count(4000);
  EXPECT_LT(many, 1.5 * few);
  EXPECT_GT(many, 0.5 * few);
}

// A million triangles and 32,768 of the same plate: what is finer than the spacing costs no samples.
TEST(Samples, OfAFineScanAreThoseOfACoarserOne) {
  const auto count = [](int n) {
    const Samples samples =
        sample_surface(Surface(shapes::square(1, n)), {.tolerance_sum = 0.1, .largest = 0.02});
    return static_cast<double>(samples.fine.size());
  };
  EXPECT_NEAR(count(724) / count(128), 1, 0.15);
}

Samples samples_of_sheets(const Mesh& sheets) {
  const auto nothing = std::make_shared<const Surface>(Mesh());
  return sample_surface(Surface(sheets, SideBy::winding, nothing), {.tolerance_sum = 0.1});
}
// 25 and 100 walls in the same place: a ball covers a part of each, so their number does not matter.
TEST(Samples, WallsOfAStackShareTheirSamples) {
  const auto count = [](int walls) {
    const Samples samples = samples_of_sheets(shapes::stack(shapes::square(0.5), walls, 0.1));
    return std::array{static_cast<double>(samples.grown.size()), static_cast<double>(samples.fine.size())};
  };
  const auto few = count(25), many = count(100);
  EXPECT_LT(many[0], 1.5 * few[0]);
  EXPECT_LT(many[1], 1.5 * few[1]);
}

// 21 walls that stand farther apart than samples, and nearer to each other than a ball reaches. The points
// that they share know how far from them there is surface without a point of its own.
TEST(Samples, WallsThatABallReachesShareTheirSamples) {
  const Mesh walls = shapes::stack(shapes::square(0.5), 21, 0.25);
  const std::vector<CoverPoint> points = samples_of_sheets(walls).fine;
  EXPECT_LT(points.size(), 8 * samples_of_sheets(shapes::square(0.5)).fine.size());
  Random random(3);
  for (int k = 0; k < 2000; k++) {
    const Point x = random_point(random, walls.corners(random.below(walls.triangles.size())));
    EXPECT_TRUE(std::any_of(points.begin(), points.end(), [&](const CoverPoint& c) {
      return (c.point - x).norm() <= 1.25 * c.margin;
    })) << x.transpose();
  }
}

TEST(Samples, TooSmallAToleranceIsRefused) {
  const Surface surface(shapes::box({0, 0, 0}, {0.5, 0.5, 0.5}));
  SampleOptions options{.tolerance_sum = 1e-6, .largest = 1e-9};
  EXPECT_THROW(sample_surface(surface, options), Error);
}

}  // namespace
}  // namespace padder
