// SPDX-License-Identifier: MIT
// Which way bodies are searched: what must go one way does, and pairs of balls are estimated well enough for
// that, by brute force.
#include "detect/core/bodies/body_choice.h"

#include "detect/core/input.h"
#include "tests/detect/oracle.h"

namespace padder::detect {
namespace {

using Random = std::mt19937_64;

std::vector<Sphere> rod(std::uint32_t n) {
  std::vector<Sphere> s(n);
  for (std::uint32_t k = 0; k < n; k++) s[k] = {1.0 * k - 0.5 * n, 0, 0, 0.5};
  return s;
}

struct Strewn : TestBodies {
  Strewn() { assets = {rod(100), rod(3), {}}; }
  void add(std::uint32_t count, std::uint32_t shape, double edge, Random& random) {
    for (std::uint32_t k = 0; k < count; k++) {
      bodies.push_back(body_at(shape, 0, 0, 0, random));
      for (double& p : bodies.back().position) p = edge * unit(random);
    }
  }
  void add_loose(std::uint32_t count, double edge, Random& random) {
    for (std::uint32_t k = 0; k < count; k++)
      loose.push_back({edge * unit(random), edge * unit(random), edge * unit(random), 0.5});
  }
  bool first(const BodyCosts& costs) {
    Pieces pieces;
    const Input in = input();
    std::uint64_t spheres = in.spheres.count;
    for (const Body& b : in.bodies) spheres += in.shapes[b.shape].count;
    const auto moving =
        in.spheres.count - static_cast<std::uint64_t>(std::count(is_static.begin(), is_static.end(), 1));
    const BodyCensus census = census_of(in.shapes, tally_of(in), pieces);
    const double most = most_touching_balls(census, spheres, in.spheres.count, moving, costs);
    return most > 0 && touching_balls(in, 0, pieces) < most;
  }
  // All pairs of balls, but for two of one body and two loose ones.
  double pairs(double margin) {
    Pieces pieces;
    const Input in = input();
    pieces.update(in.shapes);
    std::vector<Sphere> balls;
    std::vector<Filter> filters;
    for (std::uint32_t b = 0; b < bodies.size(); b++)
      for (std::uint32_t p = pieces.shape_first[bodies[b].shape]; p < pieces.shape_first[bodies[b].shape + 1];
           p++)
        balls.push_back(ball_of(bodies[b], pieces.pieces[p])), filters.push_back(filter_of(bodies[b], b));
    const std::size_t of_bodies = balls.size();
    for (std::uint64_t k = 0; k < in.spheres.count; k++)
      balls.push_back(loose_at(in.spheres, k)), filters.push_back(filter_at(in.spheres, k));
    double count = 0;
    for (std::size_t i = 0; i < of_bodies; i++)
      for (std::size_t j = i + 1; j < balls.size(); j++)
        count += admitted(filters[i], filters[j]) && touching(balls[i], balls[j], margin);
    return count;
  }
};

TEST(BodyChoice, WhatHasNoOtherWayAndWhatIsCheaper) {
  Random random = random_of_new_seed();
  Strewn s;
  EXPECT_FALSE(s.first({})) << "no body";
  s.add(4, 0, 1e6, random);  // 400 spheres, eight balls, far from each other
  EXPECT_TRUE(s.first({.ball = 3}));
  EXPECT_FALSE(s.first({.ball = 50}));
  EXPECT_FALSE(s.first({.call = 400}));
  EXPECT_FALSE(s.first({.body = 100}));
  s.add_loose(1000, 1e6, random);  // loose spheres must pass the balls, too
  EXPECT_FALSE(s.first({.ball = 3}));
  for (std::size_t k = 0; k < 3; k++) s.bodies[k].is_static = true;  // two balls are left
  EXPECT_FALSE(s.first({.ball = 3}));
  s.loose.clear();
  EXPECT_TRUE(s.first({.ball = 150, .static_each = 40}));
  EXPECT_FALSE(s.first({.ball = 150, .static_each = 60}));
  EXPECT_FALSE(s.first({.ball = 150, .static_call = 150}));
  for (std::size_t k = 0; k < 3; k++) s.bodies[k].is_static = false;
  EXPECT_FALSE(s.first({.ball = 150}));
  s.add_loose(1000, 1e6, random);
  s.is_static.assign(1000, 0);
  EXPECT_FALSE(s.first({.ball = 3})) << "none is static";
  s.is_static.assign(1000, 1);  // in a table that is kept: eight balls are left
  EXPECT_TRUE(s.first({.ball = 3, .static_each = 100}));
  EXPECT_FALSE(s.first({.ball = 3, .static_each = 200}));
  EXPECT_FALSE(s.first({.ball = 3, .static_call = 1500}));
  s.bodies.clear();
  EXPECT_TRUE(s.first({.ball = 3})) << "nothing moves";
  s.is_static.assign(1000, 0);
  EXPECT_FALSE(s.first({.ball = 3}));
}

// Of a rod of n touching spheres, whose ball has n times their radius; and of many spheres at one place, each
// as large as their ball.
TEST(BodyChoice, TheCensusTellsHowFullBallsAre) {
  Random random = random_of_new_seed();
  Strewn s;
  Pieces pieces;
  const auto census = [&] { return census_of(s.input().shapes, tally_of(s.input()), pieces); };
  EXPECT_EQ(census().bodies, 0u) << "no body";
  s.add(7, 1, 10, random), s.bodies[2].is_static = true;  // of three spheres
  BodyCensus c = census();
  EXPECT_EQ(c.bodies, 7u);
  EXPECT_EQ(c.balls, 6u);
  EXPECT_TRUE(c.some_static);
  EXPECT_NEAR(c.filled, 1. / 9, 1e-3);
  EXPECT_NEAR(c.contacts, 1. / 3, 3e-3);
  s.bodies.clear(), s.assets[1].assign(20, {1, 2, 3, 0.7}), s.add(5, 1, 10, random), s.add(3, 2, 10, random);
  c = census();
  EXPECT_FALSE(c.some_static);
  EXPECT_NEAR(c.contacts, 400, 1);
}

TEST(BodyChoice, BallsThatTouchDecide) {
  Random random = random_of_new_seed();
  Strewn s;
  s.add(200, 0, 30, random);  // each within reach of most others
  EXPECT_GT(s.pairs(0), 20000);
  EXPECT_TRUE(s.first({.ball = 3}));
  EXPECT_FALSE(s.first({.ball = 3, .pair = 2}));
  EXPECT_TRUE(s.first({.ball = 3, .contact = 2})) << "rods have few contacts";
  EXPECT_FALSE(s.first({.ball = 3, .contact = 200}));
  for (Body& b : s.bodies) b.family = 3, b.mask = 1u << 2;  // they pass through each other
  EXPECT_EQ(s.pairs(0), 0);
  EXPECT_TRUE(s.first({.ball = 3, .pair = 2}));
  s.add_loose(3000, 30, random);
  EXPECT_FALSE(s.first({.ball = 3, .pair = 2}));
  EXPECT_GT(s.pairs(0), 100000);
}

// Up to 128 bodies and loose spheres the estimate is exact but for the choice of a piece; of more, chance is
// small over ten scenes. Two sorts of bodies in turn do not hide from a sample.
TEST(BodyChoice, TheEstimateIsThatOfBruteForce) {
  Random random = random_of_new_seed();
  for (const std::uint32_t n : {60u, 256u, 2000u})
    for (const double margin : {0.0, 2.0}) {
      double wanted = 0, found = 0;
      for (int scene = 0; scene < 10; scene++) {
        Strewn s;
        const double edge = 12 * std::cbrt(double(n));
        for (std::uint32_t k = 0; k < n; k++) s.add(1, k % 2, edge, random);
        s.add(n / 4, 2, edge, random);  // without spheres
        s.add_loose(n * 2, edge, random);
        Pieces pieces;
        const Input in = s.input();
        pieces.update(in.shapes);
        wanted += s.pairs(margin), found += touching_balls(in, margin, pieces);
      }
      EXPECT_LT(std::abs(found - wanted), 0.3 * wanted + 50) << n << " bodies: " << wanted;
    }
}

// Whatever stands in a pose, and however large it is.
TEST(BodyChoice, FaultyPosesAreNobodysNeighbours) {
  Random random = random_of_new_seed();
  Strewn s;
  s.add(20, 0, 1e300, random);
  s.bodies[3].position[0] = NAN, s.bodies[4].rotation[2] = INFINITY;
  s.assets[0][7].r = NAN;
  Pieces pieces;
  const Input in = s.input();
  pieces.update(in.shapes);
  EXPECT_EQ(touching_balls(in, 0, pieces), 0);
}

}  // namespace
}  // namespace padder::detect
