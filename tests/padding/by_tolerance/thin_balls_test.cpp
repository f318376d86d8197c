// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/thin_balls.h"

#include <gtest/gtest.h>

#include "padding/geometry/random.h"
#include "tests/padding/shapes.h"

namespace padder {
namespace {

using shapes::unit;

TEST(ThinBalls, KeepsWhatTheBallsCoverWithFewer) {
  const Surface surface(unit(shapes::torus(1, 0.3, 28, 14)));
  std::vector<Ball> balls;
  Random random(4);
  const Mesh& mesh = surface.mesh();
  for (std::size_t t = 0; t < mesh.triangles.size(); t++) {
    if (mesh.corner(t, 0).z() < -0.05) continue;  // the underside stays open
    balls.push_back({mesh.middle(t), 0.03 + 0.03 * random.uniform()});
  }
  const double gap = 0.03;
  const std::vector<std::uint32_t> kept = thin_balls(surface, balls, gap);
  EXPECT_LT(kept.size(), balls.size() / 3);
  std::vector<Ball> thin;
  for (auto k : kept) thin.push_back(balls[k]);
  const BallSet all(balls), few(thin);
  for (int k = 0; k < 50000; k++) {
    const Point x = random_point(random, mesh.corners(random.below(mesh.triangles.size())));
    if (all.gap(x).value < 0.99 * gap) {
      EXPECT_LE(few.gap(x).value, gap * 1.01);
    }
  }
}

}  // namespace
}  // namespace padder
