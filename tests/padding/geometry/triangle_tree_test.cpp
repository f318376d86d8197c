// SPDX-License-Identifier: MIT
#include "padding/geometry/triangle_tree.h"

#include <gtest/gtest.h>
#include <omp.h>

#include <atomic>
#include <mutex>
#include <set>

#include "tests/padding/random_input.h"

namespace padder {
namespace {

using shapes::RandomInput;

// Triangles of all sizes, and some on a grid, whose boxes touch without a rounding error to spare.
TEST(TriangleTree, PairsAreThoseWhoseBoxesTouch) {
  for (std::uint64_t seed = 1; seed <= 12; seed++) {
    RandomInput random(seed);
    Mesh mesh;
    const std::size_t n = seed <= 6 ? seed - 1 : 40 * seed;
    for (std::size_t t = 0; t < n; t++) {
      const Point place = random.point(4);
      const double size = std::pow(10, random.uniform(-3, 0.5));
      for (int k = 0; k < 3; k++) {
        Point p = place + random.point(size);
        if (t % 3 == 0) p = p.array().round();
        mesh.points.push_back(p);
      }
      const auto first = static_cast<std::uint32_t>(3 * t);
      mesh.triangles.push_back({first, first + 1, first + 2});
    }
    const auto box = [&](std::uint32_t t) {
      Box b;
      for (int k = 0; k < 3; k++) b.add(mesh.corner(t, k));
      return b;
    };
    std::set<std::array<std::uint32_t, 2>> expected, found;
    for (std::uint32_t s = 0; s < n; s++)
      for (std::uint32_t t = s + 1; t < n; t++)
        if ((box(s).low.array() <= box(t).high.array()).all() &&
            (box(t).low.array() <= box(s).high.array()).all())
          expected.insert({s, t});
    std::mutex mutex;
    const TriangleTree tree(mesh);
    tree.visit_pairs(mesh, [&](auto s, auto t) {
      const std::lock_guard lock(mutex);
      EXPECT_TRUE(found.insert({s, t}).second) << "seed " << seed << " twice: " << s << " and " << t;
      return false;
    });
    EXPECT_EQ(found, expected) << "seed " << seed;
    std::atomic<std::size_t> calls = 0;
    tree.visit_pairs(mesh, [&](auto, auto) { return ++calls > 0; });
    EXPECT_LE(calls, 16u * static_cast<std::size_t>(omp_get_max_threads()));  // those of a pair of leaves
    EXPECT_EQ(calls > 0, !expected.empty());
    for (std::uint32_t s = 0; s < n; s++) {  // in the box of a triangle are its partners and itself
      std::set<std::uint32_t> in_box;
      tree.visit(box(s), [&](auto t) { in_box.insert(t); });
      EXPECT_TRUE(in_box.contains(s)) << "seed " << seed;
      for (const auto& [low, high] : expected)
        if (low == s || high == s) {
          EXPECT_TRUE(in_box.contains(low == s ? high : low))
              << "seed " << seed << ": " << low << ", " << high;
        }
    }
  }
}

// The triangles in the slots that visit_near() names.
std::set<std::uint32_t> near(const TriangleTree& tree, const Point& p, double limit) {
  std::set<std::uint32_t> found;
  double limit2 = limit * limit;
  tree.visit_near(p, limit2, [&](std::uint32_t slot) {
    EXPECT_TRUE(found.insert(tree.triangles()[slot]).second);
    return false;
  });
  return found;
}

TEST(TriangleTree, SlabsLeaveOutNothingThatIsNear) {
  for (std::uint64_t seed = 1; seed <= 12; seed++) {
    RandomInput random(seed);
    const Mesh meshes[] = {shapes::random_soup(random, 3 * seed, 1, 0.3), shapes::blob(random, 3),
                           shapes::moved(shapes::sphere(3), {1e4, -2e4, 3e4}), shapes::face_of_cube(5, 8)};
    const Mesh& mesh = meshes[seed % 4];
    const TriangleTree boxes(mesh);
    TriangleTree slabs = boxes;
    slabs.find_slabs(mesh, slabs.triangles());
    const Box bounds = mesh.bounds();
    for (int k = 0; k < 200; k++) {
      const Point p = bounds.center() + random.point(random.uniform(0, 1) * bounds.diagonal());
      const std::size_t t = random.below(mesh.triangles.size());
      const double near_by = (random.on(mesh, t) - p).norm() * (1 + 1e-9);  // as triangle t is
      const std::set<std::uint32_t> found = near(slabs, p, near_by), all = near(boxes, p, near_by);
      ASSERT_TRUE(found.contains(static_cast<std::uint32_t>(t)));
      ASSERT_TRUE(std::includes(all.begin(), all.end(), found.begin(), found.end()));
    }
  }
}

// Nearly all triangles are about as near, and their boxes much nearer.
TEST(TriangleTree, SlabsLeaveOutMostOfASphereAroundThePoint) {
  RandomInput random(1);
  const Mesh mesh = shapes::sphere(5);
  const TriangleTree boxes(mesh);
  TriangleTree slabs = boxes;
  slabs.find_slabs(mesh, slabs.triangles());
  std::size_t found = 0, all = 0;
  for (int k = 0; k < 50; k++) {
    const Point p = random.point(0.05);
    double nearest = 2;
    for (const Point& q : mesh.points) nearest = std::min(nearest, (q - p).norm());
    found += near(slabs, p, nearest).size(), all += near(boxes, p, nearest).size();
  }
  EXPECT_LT(10 * found, all);
}

}  // namespace
}  // namespace padder
