// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/cover.h"

#include <gtest/gtest.h>

#include "padding/asset/error.h"
#include "padding/geometry/random.h"
#include "tests/padding/balls.h"
#include "tests/padding/random_input.h"
#include "tests/padding/shapes.h"
#include "tests/padding/threads.h"

namespace padder {
namespace {

using shapes::unit;

// An oracle without the certificate: random points of the surface against all balls, and random exposed
// points of the balls against the mesh.
struct Sampled {
  double gap = 0, protrusion = 0;
};
Sampled sampled_errors(const Surface& surface, const std::vector<Ball>& balls, int count) {
  const Mesh& mesh = surface.mesh();
  Sampled errors;
  Random random(9);
  for (int k = 0; k < count; k++) {
    const Point x = random_point(random, mesh.corners(random.below(mesh.triangles.size())));
    errors.gap = std::max(errors.gap, gap_to(balls, x));
    const Ball& ball = balls[random.below(balls.size())];
    const double z = 2 * random.uniform() - 1, phi = 2 * std::numbers::pi * random.uniform();
    const double s = std::sqrt(1 - z * z);
    const Point y = ball.center + ball.radius * Vector(s * std::cos(phi), s * std::sin(phi), z);
    errors.protrusion = std::max(errors.protrusion, surface.signed_nearest(y).distance);
  }
  return errors;
}

TEST(Cover, SphereNeedsOneBall) {
  for (int levels : {3, 4, 6}) {
    const Surface surface(unit(shapes::sphere(levels)));
    const Cover cover = cover_surface(surface, {.protrusion = 0.02, .gap = 0.02});
    EXPECT_TRUE(cover.proved);
    EXPECT_EQ(cover.balls.size(), 1u);
  }
}

// The triangles of a fine sphere lie a little below it: one ball in its middle needs no more than that.
TEST(Cover, SphereNeedsOneBallAlsoWhereOnlyOnePlaceIsLeftForIt) {
  for (int levels : {2, 4, 5}) {
    const Surface surface(unit(shapes::sphere(levels)));
    const Point middle = surface.bounds().center();
    double sag = 0;
    for (const Point& p : surface.mesh().points) sag = std::max(sag, (p - middle).norm());
    sag -= surface.nearest(middle).distance;
    const Cover cover = cover_surface(surface, {.protrusion = 0.51 * sag, .gap = 0.51 * sag});
    EXPECT_TRUE(cover.proved);
    EXPECT_EQ(cover.balls.size(), 1u);
  }
}

// A plate of half thickness h: a ball in the middle plane covers a disc of radius sqrt((h + 2e)^2 - h^2) on
// both sides, and no cover of the plane by equal discs is thinner than 2 pi / sqrt(27) (Kershner, The number
// of circles covering a set, 1939).
TEST(Cover, PlateComesNearTheThinnestCover) {
  const double e = 0.015, h = 0.008;
  const Mesh mesh = shapes::box({-0.35, -0.35, -h}, {0.35, 0.35, h}, 12);
  const Surface surface(mesh);
  const Cover cover = cover_surface(surface, {.protrusion = e, .gap = e});
  ASSERT_TRUE(cover.proved);
  const double disc2 = (h + 2 * e) * (h + 2 * e) - h * h;
  const double least = 0.7 * 0.7 / (1.5 * std::sqrt(3.0) * disc2);
  EXPECT_GT(static_cast<double>(cover.balls.size()), least);
  // Without centring it has 1.32 times as many, borders included.
  EXPECT_LT(static_cast<double>(cover.balls.size()), 1.29 * least);
}

class CoverShapes : public testing::TestWithParam<int> {};

TEST_P(CoverShapes, BoundsAreProvedAndSamplingAgrees) {
  const Mesh meshes[] = {shapes::box({0, 0, 0}, {1, 0.6, 0.3}), shapes::torus(1, 0.2, 60, 24),
                         shapes::box({0, 0, 0}, {1, 1, 1e-4}, 3)};
  const Surface surface(unit(meshes[GetParam()]));
  for (const auto& [protrusion, gap] : {std::pair(0.02, 0.02), std::pair(0.0, 0.04)}) {
    const Cover cover = cover_surface(surface, {.protrusion = protrusion, .gap = gap});
    EXPECT_TRUE(cover.proved);
    ASSERT_EQ(cover.triangle.size(), cover.balls.size());
    EXPECT_LE(protrusion_bound(surface, cover.balls).max, protrusion + 1e-15);
    EXPECT_LE(gap_bound(surface.mesh(), BallSet(cover.balls), gap).upper, gap);
    const Sampled sampled = sampled_errors(surface, cover.balls, 20000);
    EXPECT_LE(sampled.gap, gap);
    EXPECT_LE(sampled.protrusion, protrusion + 1e-12);
    EXPECT_GT(sampled.gap, 0.5 * gap);  // the tolerance is used
  }
}
INSTANTIATE_TEST_SUITE_P(Shapes, CoverShapes, testing::Range(0, 3));

// Wedges, needle cones and flat tetrahedra, turned at random: no ball inside touches their edges, which a
// ball deeper inside must cover. Half of them have edges far sharper than a right angle.
Mesh sharp_solid(shapes::RandomInput& random, int kind) {
  Mesh mesh;
  const double thin = std::exp(random.uniform(std::log(1e-3), 0));
  if (kind == 0) {  // 1 long, with the sharp edge at the origin
    const double width = random.uniform(0.1, 1);
    mesh.points = {{0, 0, 0}, {1, 0, 0}, {1, width, 0}, {0, width, 0}, {1, 0, thin}, {1, width, thin}};
    mesh.triangles = {{0, 2, 1}, {0, 3, 2}, {0, 1, 4}, {3, 5, 2}, {1, 2, 5}, {1, 5, 4}, {0, 4, 5}, {0, 5, 3}};
  } else if (kind == 1) {  // a cone, a needle or a disc
    const std::uint32_t sides = 3 + static_cast<std::uint32_t>(random.uniform(0, 22));
    const double radius = random.uniform(0, 1) < 0.5 ? thin : 1, height = radius < 1 ? 1 : thin;
    mesh = shapes::mapped(shapes::cone(sides), [&](const Point& p) {
      return Point(radius * p.x(), radius * p.y(), height * p.z());
    });
  } else {
    const double a = random.uniform(0, 1), b = random.uniform(0, 1);
    mesh.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {a * b, (1 - a) * b, thin}};
    mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
  }
  return unit(shapes::moved(mesh, random.rotation(), Vector::Zero()));
}

TEST(Cover, BallsInsideCoverSharpEdges) {
  for (std::uint64_t seed = 1; seed <= 12; seed++) {
    shapes::RandomInput random(seed);
    const Surface surface(sharp_solid(random, static_cast<int>(seed % 3)));
    const double gap = std::exp(random.uniform(std::log(0.01), std::log(0.05)));
    SCOPED_TRACE(testing::Message() << "seed " << seed << ", gap " << gap);
    const Cover cover = cover_surface(surface, {.gap = gap, .effort = static_cast<int>(seed % 2)});
    EXPECT_TRUE(cover.proved);
    EXPECT_LE(protrusion_bound(surface, cover.balls).max, 0);
    EXPECT_LE(gap_bound(surface.mesh(), BallSet(cover.balls), gap).upper, gap);
    const Sampled sampled = sampled_errors(surface, cover.balls, 5000);
    EXPECT_LE(sampled.gap, gap);
    EXPECT_LE(sampled.protrusion, 1e-12);
    // A protrusion too small to matter finds about as many.
    const Cover free =
        cover_surface(surface, {.protrusion = 1e-7 * gap, .gap = gap, .effort = static_cast<int>(seed % 2)});
    EXPECT_TRUE(free.proved);
    EXPECT_LE(static_cast<double>(cover.balls.size()), 1.1 * static_cast<double>(free.balls.size()) + 3);
  }
}

// A minimal cover without one of its balls, or with one of them moved, must be no cover.
TEST(Cover, CertificateSeesABallRemovedOrMoved) {
  const Surface surface(unit(shapes::torus(1, 0.2, 60, 24)));
  const double e = 0.02;
  const Cover cover = cover_surface(surface, {.protrusion = e, .gap = e});
  ASSERT_TRUE(gap_failures(surface.mesh(), BallSet(cover.balls), e, 0.1 * e).empty());
  for (std::size_t k = 0; k < cover.balls.size(); k++) {
    std::vector<Ball> fewer = cover.balls;
    fewer.erase(fewer.begin() + static_cast<std::ptrdiff_t>(k));
    EXPECT_GT(gap_bound(surface.mesh(), BallSet(fewer), e).upper, e) << k;
    EXPECT_FALSE(gap_failures(surface.mesh(), BallSet(fewer), e, 0.1 * e).empty()) << k;
    std::vector<Ball> moved = cover.balls;
    moved[k].center += 3 * e * Vector(0, 0, k % 2 ? 1 : -1);
    EXPECT_TRUE(protrusion_bound(surface, moved).max > 1.5 * e ||
                !gap_failures(surface.mesh(), BallSet(moved), e, 0.1 * e).empty())
        << k;
  }
}

// The search asks the first walls of a stack until nothing fails, and then all of them: the outermost, too.
TEST(Cover, AStackOfWallsIsCoveredToTheLast) {
  const Mesh walls = shapes::stack(shapes::square(0.4), 40, 0.08), nothing;
  const Surface surface(walls, SideBy::winding, std::make_shared<const Surface>(nothing));
  for (const int effort : {0, 1}) {
    const Cover cover = cover_surface(surface, {.protrusion = 0.02, .gap = 0.02, .effort = effort});
    EXPECT_TRUE(cover.proved) << effort;
    EXPECT_TRUE(gap_failures(walls, BallSet(cover.balls), 0.02, 0.002).empty()) << effort;
    EXPECT_LE(sampled_errors(surface, cover.balls, 3000).gap, 0.02) << effort;
  }
}

TEST(Cover, SearchBeatsGreedy) {
  const Surface surface(unit(shapes::box({0, 0, 0}, {1, 0.6, 0.3})));
  const auto count = [&](int effort) {
    const Cover cover = cover_surface(surface, {.protrusion = 0.015, .gap = 0.015, .effort = effort});
    EXPECT_TRUE(cover.proved);
    return static_cast<double>(cover.balls.size());
  };
  EXPECT_LT(count(1), 0.9 * count(0));
}

// A search for a count needs to know no more than that there are too many balls.
TEST(Cover, OneOfFarTooManyBallsIsLeftUnfinished) {
  const Surface surface(unit(shapes::torus(1, 0.3, 60, 20)));
  CoverOptions options{.protrusion = 0.01, .gap = 0.01};
  const Cover whole = cover_surface(surface, options);
  EXPECT_TRUE(whole.proved);
  options.most_balls = whole.balls.size() / 4;
  const Cover same = cover_surface(surface, options);
  EXPECT_TRUE(same.proved);
  EXPECT_EQ(same.balls.size(), whole.balls.size());
  options.most_balls = whole.balls.size() / 20;
  const Cover unfinished = cover_surface(surface, options);
  EXPECT_FALSE(unfinished.proved);
  EXPECT_EQ(unfinished.open.why, WhyOpen::unfinished);
  EXPECT_GT(unfinished.balls.size(), options.most_balls);
}

TEST(Cover, RadiusLimitsAreKept) {
  const Surface surface(unit(shapes::box({0, 0, 0}, {1, 0.6, 0.3})));
  const Cover small = cover_surface(surface, {.protrusion = 0.02, .gap = 0.02, .max_radius = 0.05});
  EXPECT_TRUE(small.proved);
  for (const Ball& ball : small.balls) EXPECT_LE(ball.radius, 0.05 + 1e-12);
  const Cover tiny = cover_surface(surface, {.protrusion = 0.03, .gap = 0.03, .max_radius = 0.025});
  EXPECT_TRUE(tiny.proved);
  for (const Ball& ball : tiny.balls) EXPECT_LE(ball.radius, 0.025 + 1e-12);
  // No ball of radius 0.1 fits into a corner within the tolerance. So the corner stays open, and nothing is
  // proved.
  const Cover large = cover_surface(surface, {.protrusion = 0.02, .gap = 0.02, .min_radius = 0.1});
  EXPECT_FALSE(large.proved);
  for (const Ball& ball : large.balls) EXPECT_GE(ball.radius, 0.1);
}

// With no protrusion, no ball lies in a sheet. The body beside it is covered for all that.
TEST(Cover, WhatHasNoInsideStaysOpenAndAllElseIsCovered) {
  const Mesh box = shapes::box({0, 0, 0}, {0.5, 0.5, 0.5}), fin = shapes::box({0.8, 0, 0}, {0.8, 0.5, 0.5});
  const Surface surface(shapes::joined(box, fin), SideBy::winding, std::make_shared<const Surface>(box));
  const Cover cover = cover_surface(surface, {.protrusion = 0, .gap = 0.05, .effort = 0});
  EXPECT_EQ(cover.open.why, WhyOpen::no_inside);
  EXPECT_EQ(cover.open.at.x(), 0.8);
  EXPECT_FALSE(cover.proved);
  EXPECT_LE(sampled_errors(Surface(box), cover.balls, 20000).gap, 0.05);
  EXPECT_TRUE(gap_failures(box, BallSet(cover.balls), 0.05, 1e-3).empty());
}

// The side that pseudonormals give is no proof, whoever calls.
TEST(Cover, ProvesNothingWithoutAnInside) {
  const CoverOptions options{.protrusion = 0.03, .gap = 0.03, .max_radius = 0.1, .effort = 0};
  const Cover sheet = cover_surface(Surface(unit(shapes::square(1, 4))), options);
  EXPECT_EQ(sheet.open.why, WhyOpen::nothing);
  EXPECT_FALSE(sheet.proved);
  const Surface surface(unit(shapes::turned_over(shapes::box({0, 0, 0}, {1, 1, 1}))));
  const Cover cover = cover_surface(surface, options);
  EXPECT_EQ(cover.open.why, WhyOpen::nothing);
  EXPECT_EQ(cover.proved, protrusion_bound(surface, cover.balls).max <= 0.03);
  EXPECT_FALSE(cover.proved);  // the balls lie outside, where the normals say inside is
}

TEST(Cover, SameResultForAnyNumberOfThreads) {
  const Surface surface(unit(shapes::torus(1, 0.3, 40, 20)));
  const auto cover = [&] { return cover_surface(surface, {.protrusion = 0.01, .gap = 0.01}); };
  const Cover one = with_threads(1, cover);
  for (const int threads : {2, 5}) expect_same(with_threads(threads, cover).balls, one.balls);
}

// Many balls: the blocks of one search run in parallel, and not the searches.
TEST(Cover, LargeCoversAreTheSameForAnyNumberOfThreads) {
  const double e = 0.005;
  const Surface surface(unit(shapes::box({0, 0, 0}, {1, 0.6, 0.05})));
  const auto cover = [&] { return cover_surface(surface, {.protrusion = e, .gap = e}); };
  const Cover one = with_threads(1, cover), three = with_threads(3, cover);
  ASSERT_GT(one.balls.size(), 400u);  // three blocks of the search
  ASSERT_TRUE(one.proved);
  EXPECT_LE(protrusion_bound(surface, one.balls).max, e + 1e-15);
  EXPECT_LE(gap_bound(surface.mesh(), BallSet(one.balls), e).upper, e);
  expect_same(one.balls, three.balls);
}

TEST(Cover, AHigherEffortNeverGivesMoreBalls) {
  const Mesh meshes[] = {unit(shapes::box({0, 0, 0}, {1, 0.6, 0.2})), unit(shapes::torus(0.3, 0.1, 40, 20)),
                         unit(shapes::box({0, 0, 0}, {1, 0.1, 0.1}))};
  for (const Mesh& mesh : meshes)
    for (const double e : {0.03, 0.06}) {
      std::size_t fewest = mesh.triangles.size() * 1000;
      for (int effort = 0; effort <= 3; effort++) {
        const Cover cover = cover_surface(Surface(mesh), {.protrusion = e, .gap = e, .effort = effort});
        EXPECT_TRUE(cover.proved);
        EXPECT_LE(cover.balls.size(), fewest) << "effort " << effort << ", tolerance " << e;
        fewest = cover.balls.size();
      }
    }
}

TEST(Cover, RefusesWhatCannotBeCovered) {
  EXPECT_THROW(cover_surface(Surface(Mesh()), {.protrusion = 0.01, .gap = 0.01}), Error);
  EXPECT_THROW(cover_surface(Surface(shapes::sphere(1)), {}), Error);
}

}  // namespace
}  // namespace padder
