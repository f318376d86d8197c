// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/by_depth/refit.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "padding/meshing/remesh.h"
#include "padding/verify/certify.h"
#include "tests/padding/balls.h"
#include "tests/padding/random_input.h"
#include "tests/padding/threads.h"

namespace padder {
namespace {

struct Case {
  std::string name;
  Mesh mesh;
  double edge;
};

std::vector<Case> bodies() {
  std::vector<Case> all = {{"cube", shapes::box({0, 0, 0}, {1, 1, 1}), 0.2},
                           {"plate 40:1", shapes::box({0, 0, 0}, {1, 1, 0.025}), 0.14},
                           {"plate 1000:1", shapes::box({0, 0, 0}, {1, 1, 0.001}), 0.14},
                           {"sphere", shapes::sphere(4), 0.2},
                           {"torus", shapes::torus(1, 0.2, 40, 12), 0.2}};
  for (std::uint64_t seed = 1; seed <= 2; seed++) {
    shapes::RandomInput random(seed);
    all.push_back({"blob, seed " + std::to_string(seed), shapes::blob(random), 0.15});
  }
  return all;
}

double largest_cap(const std::vector<FittedBall>& balls) {
  double cap = 0;
  for (const auto& b : balls) cap = std::max(cap, b.cap);
  return cap;
}

std::vector<Ball> plain(const std::vector<FittedBall>& fitted) {
  std::vector<Ball> balls;
  for (const auto& f : fitted) balls.push_back(f.ball);
  return balls;
}

TEST(Refit, NothingStandsOutByMoreThanItsCapAndNothingIsLeftOpen) {
  for (const auto& [name, mesh, edge] : bodies()) {
    SCOPED_TRACE(name);
    const Surface body(mesh);
    const Mesh remeshed = remesh(mesh, {.edge_length = edge}).mesh;
    for (const double depth : {0.1, 0.6}) {
      const auto before = fit(remeshed, depth, edge);
      const auto after = refit(body, remeshed, before, {});
      for (std::size_t k = 0; k < after.size(); k++) {
        EXPECT_LE(protrusion_bound(body, {after[k].ball}).max, after[k].cap * (1 + 1e-6)) << "ball " << k;
        EXPECT_LT(after[k].triangle, remeshed.triangles.size());
      }
      EXPECT_LE(gap_bound(mesh, BallSet(plain(after))).upper, largest_cap(before) * 1.001);
    }
  }
}

TEST(Refit, WithoutItAThinPlateFails) {  // the figure that refitting is there for
  const Mesh plate = shapes::box({0, 0, 0}, {2, 2, 0.05});
  const Mesh remeshed = remesh(plate, {.edge_length = 0.08}).mesh;
  const auto before = fit(remeshed, 0.2, 0.08);
  EXPECT_GT(protrusion_bound(Surface(plate), plain(before)).max, 5 * largest_cap(before));
}

TEST(Refit, WhereTheBodyIsThickThePapersSpheresStay) {
  const Mesh cube = shapes::box({0, 0, 0}, {1, 1, 1});
  const Mesh remeshed = remesh(cube, {.edge_length = 0.05}).mesh;
  const auto before = fit(remeshed, 0.2, 0.05);
  const auto after = refit(Surface(cube), remeshed, before, {});
  std::size_t same = 0, far = 0;
  for (std::size_t k = 0; k < before.size(); k++) {
    const Point p = remeshed.corner(before[k].triangle, 0);
    int inner = 0;  // coordinates well away from an edge of the cube
    for (int axis = 0; axis < 3; axis++) inner += std::min(p[axis], 1 - p[axis]) > 0.25;
    if (inner < 2) continue;
    far++;
    same += after[k].ball.radius == before[k].ball.radius && after[k].ball.center == before[k].ball.center;
  }
  EXPECT_GT(far, 100u);
  EXPECT_EQ(same, far);
}

// At the end the parts are as small as the gap. Parts of that size from the beginning would be a million.
TEST(Refit, FlatCapsOnLargeTrianglesAreCoveredWithoutVeryManyParts) {
  const Mesh cube = shapes::box({0, 0, 0}, {0.5, 0.5, 0.5});
  const Mesh remeshed = remesh(cube, {.edge_length = 0.05}).mesh;
  const auto before = fit(remeshed, 0.03, 0.05);
  std::size_t most = 0, rounds = 0;
  const auto tell = [&](std::size_t open) { most = std::max(most, open), rounds++; };
  const auto after = refit(Surface(cube), remeshed, before, {.tell = tell});
  EXPECT_GT(rounds, 2u);
  EXPECT_LT(most, 100'000u);
  EXPECT_LE(gap_bound(cube, BallSet(plain(after))).upper, largest_cap(before) * 1.001);
}

TEST(Refit, ItsCallerMayEndIt) {
  const Mesh plate = shapes::box({0, 0, 0}, {1, 1, 0.001});
  const Mesh remeshed = remesh(plate, {.edge_length = 0.14}).mesh;
  const RefitOptions options{.tell = [](std::size_t) { throw std::runtime_error("ended"); }};
  EXPECT_THROW(refit(Surface(plate), remeshed, fit(remeshed, 0.1, 0.14), options), std::runtime_error);
}

TEST(Refit, ASheetIsPaddedBelow) {
  const Mesh sheet = shapes::square(1, 8);
  const Mesh remeshed = remesh(sheet, {.edge_length = 0.1}).mesh;
  const auto after = refit(Surface(sheet), remeshed, fit(remeshed, 0.2, 0.1), {});
  ASSERT_FALSE(after.empty());
  for (const auto& b : after) {
    EXPECT_LT(b.ball.center.z(), 0);
    EXPECT_LE(b.ball.center.z() + b.ball.radius, b.cap * (1 + 1e-6));
  }
}

TEST(Refit, SameForAnyNumberOfThreads) {
  shapes::RandomInput random(7);
  const Mesh mesh = shapes::blob(random);
  const Surface body(mesh);
  const Mesh remeshed = remesh(mesh, {.edge_length = 0.2}).mesh;
  const auto balls = fit(remeshed, 0.3, 0.2);
  const auto found = [&] { return refit(body, remeshed, balls, {}); };
  expect_same(plain(with_threads(1, found)), plain(with_threads(5, found)));
}

}  // namespace
}  // namespace padder
