// SPDX-License-Identifier: MIT
// The wide tree, as the CPU builds it, beside a test of every box.
#include "detect/omp/worlds/sphere_tree.h"

#include <gtest/gtest.h>

#include "tests/detect/random.h"

namespace padder::detect::omp {
namespace {

TEST(WideTree, AWalkVisitsEveryBoxThatIsMetOnceAndInOrder) {
  std::mt19937_64 random(9);
  Budget budget;
  SphereTree tree(budget);  // one after the other, so that a tree is left from a larger one
  for (const std::uint32_t n : {0u, 1u, 7u, 8u, 9u, 64u, 65u, 4097u, 700u, 0u, 512u, 513u}) {
    std::vector<Sphere> balls;
    for (std::uint32_t k = 0; k < n; k++)
      balls.push_back({k * 0.1 + unit(random), unit(random), unit(random),
                       random() % 100 ? 0.2 * unit(random) : INFINITY});
    tree.build(balls.data(), n, 1);
    for (int again = 0; again < 100; again++) {
      const auto first = static_cast<std::uint32_t>(random() % (n + 1)),
                 end = again % 2 ? n : first + static_cast<std::uint32_t>(random() % (n - first + 1));
      const TreeBox box = box_of({n * 0.1 * unit(random), unit(random), unit(random), 0.5}, 0.1);
      std::vector<std::uint32_t> visited, expected;
      for (std::uint32_t k = first; k < end; k++)
        if (overlap(box, box_of(balls[k], 0))) expected.push_back(k);
      tree->visit(box, first, end, [&](std::uint32_t k) {
        visited.push_back(k);
        return true;
      });
      ASSERT_EQ(visited, expected) << n << " from " << first << " to " << end;
      if (expected.empty()) continue;
      expected.resize(1 + expected.size() / 2), visited.clear();  // a walk that ends early
      tree->visit(box, first, end, [&](std::uint32_t k) {
        visited.push_back(k);
        return visited.size() < expected.size();
      });
      ASSERT_EQ(visited, expected);
    }
  }
}

// A box that shrinks while the tree is walked, as it does when a nearer pair is found.
TEST(WideTree, ABoxMayShrinkInAWalk) {
  std::vector<Sphere> balls;
  for (int k = 0; k < 1000; k++) balls.push_back({static_cast<double>(k), 0, 0, 0.1});
  Budget budget;
  SphereTree tree(budget);
  tree.build(balls.data(), 1000, 1);
  TreeBox box = box_of({0, 0, 0, 5000}, 0);
  std::vector<std::uint32_t> visited;
  tree->visit(box, 0, 1000, [&](std::uint32_t k) {
    visited.push_back(k);
    if (k == 99) box = box_of({0, 0, 0, 99}, 0);
    return true;
  });
  ASSERT_GE(visited.size(), 100u);
  EXPECT_LE(visited.size(), 104u);  // those of the group that was tested before
}

}  // namespace
}  // namespace padder::detect::omp
