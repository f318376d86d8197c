// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/meshing/cells/contacts.h"

#include <CGAL/Triangle_3.h>
#include <CGAL/intersections.h>
#include <gtest/gtest.h>

#include <set>

#include "padding/geometry/random.h"
#include "padding/meshing/cgal_mesh.h"
#include "tests/padding/random_input.h"

namespace padder {
namespace {

CgalKernel::Triangle_3 triangle(const Mesh& mesh, std::size_t t) {
  return {to_cgal(mesh.corner(t, 0)), to_cgal(mesh.corner(t, 1)), to_cgal(mesh.corner(t, 2))};
}

// Coordinates on a coarse grid, so that all kinds of touching happen. Equal points have one index.
TEST(Contacts, OfTrianglesWithoutCommonVerticesAreThoseOfCgal) {
  for (std::uint64_t seed = 1; seed <= 20; seed++) {
    shapes::RandomInput random(seed);
    const int grid = 2 + static_cast<int>(seed % 4);
    Mesh mesh;
    std::map<std::array<double, 3>, std::uint32_t> index;
    for (int k = 0; k < 60; k++) {
      std::array<std::uint32_t, 3> t;
      for (auto& v : t) {
        const Point p = (random.point() * grid).array().round();
        const auto [at, fresh] =
            index.try_emplace({p.x(), p.y(), p.z()}, static_cast<std::uint32_t>(mesh.points.size()));
        if (fresh) mesh.points.push_back(p);
        v = at->second;
      }
      mesh.triangles.push_back(t);
    }
    std::erase_if(mesh.triangles, [](const auto& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; });
    const Contacts contacts = find_contacts(Surface(mesh));
    const std::set<std::array<std::uint32_t, 2>> found(contacts.pairs.begin(), contacts.pairs.end());
    std::size_t expected = 0;
    for (std::uint32_t s = 0; s < mesh.triangles.size(); s++)
      for (std::uint32_t t = s + 1; t < mesh.triangles.size(); t++) {
        if (is_flat(mesh, s) || is_flat(mesh, t)) continue;
        bool shared = false, in_one_plane = true;
        for (const auto v : mesh.triangles[t]) {
          shared |= std::count(mesh.triangles[s].begin(), mesh.triangles[s].end(), v) > 0;
          in_one_plane &= CGAL::coplanar(triangle(mesh, s)[0], triangle(mesh, s)[1], triangle(mesh, s)[2],
                                         to_cgal(mesh.points[v]));
        }
        if (shared) continue;
        const bool meet = CGAL::do_intersect(triangle(mesh, s), triangle(mesh, t));
        expected += meet;
        const bool ours = found.count({s, t}) > 0;
        // In one plane, triangles that only touch are no contact.
        if (in_one_plane)
          EXPECT_LE(ours, meet) << "seed " << seed << ": " << s << " and " << t;
        else
          EXPECT_EQ(ours, meet) << "seed " << seed << ": " << s << " and " << t;
      }
    EXPECT_GT(expected, 0u);
    EXPECT_EQ(any_contact(Surface(mesh)), !contacts.pairs.empty());
    EXPECT_FALSE(find_contacts(Surface(mesh), contacts.pairs.size()).too_many);
    EXPECT_TRUE(find_contacts(Surface(mesh), contacts.pairs.size() - 1).too_many);
  }
}

TEST(Contacts, NeighboursTouchOnlyWhereTheyFold) {
  EXPECT_TRUE(find_contacts(Surface(shapes::sphere(3))).pairs.empty());
  Mesh fold{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0.2, 0.2, 0}, {0.2, 0.2, 1}, {0.4, 0.3, -1}},
            {{0, 1, 2}, {0, 1, 3}}};
  EXPECT_EQ(find_contacts(Surface(fold)).overlaps.size(), 1u);
  fold.triangles = {{0, 1, 2}, {0, 1, 4}};
  EXPECT_TRUE(find_contacts(Surface(fold)).pairs.empty());
  fold.triangles = {{0, 1, 2}, {0, 4, 5}};  // through a common vertex and the inside
  const Contacts through = find_contacts(Surface(fold));
  ASSERT_EQ(through.pairs.size(), 1u);
  EXPECT_EQ(through.cuts[0].ends[0].is_vertex() + through.cuts[0].ends[1].is_vertex(), 1);
}

// Whether two triangles meet when there are no others.
bool meet_alone(const Mesh& mesh, std::uint32_t s, std::uint32_t t) {
  return any_contact(Surface({mesh.points, {mesh.triangles[s], mesh.triangles[t]}}));
}

// Two fans of so many triangles that they are looked at from their tips, which reach through each other and
// through loose triangles. On the coarse grid some lie in one plane, and some touch a tip.
TEST(Contacts, OfFansAreThoseOfTheirTrianglesByThemselves) {
  for (std::uint64_t seed = 1; seed <= 2; seed++) {
    shapes::RandomInput random(seed);
    Mesh mesh;
    for (int k = 0; k < 90; k++) mesh.points.push_back((random.point() * (seed % 3 + 2)).array().round());
    Random pick(seed);
    const auto any = [&] { return static_cast<std::uint32_t>(2 + pick.below(88)); };
    for (const std::uint32_t tip : {0u, 1u})
      for (int k = 0; k < 75; k++) mesh.triangles.push_back({tip, any(), any()});
    for (int k = 0; k < 30; k++) mesh.triangles.push_back({any(), any(), any()});
    std::erase_if(mesh.triangles, [](const auto& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; });
    const Contacts contacts = find_contacts(Surface(mesh));
    std::set<std::array<std::uint32_t, 2>> found;
    for (const auto& [s, t] : contacts.pairs)
      EXPECT_TRUE(found.insert({std::min(s, t), std::max(s, t)}).second) << "twice: " << s << " and " << t;
    for (std::uint32_t s = 0; s < mesh.triangles.size(); s++)
      for (std::uint32_t t = s + 1; t < mesh.triangles.size(); t++)
        EXPECT_EQ(found.count({s, t}) > 0, meet_alone(mesh, s, t))
            << "seed " << seed << ": " << s << " and " << t;
  }
}

// All pairs at the tip would be 2e8.
TEST(Contacts, OfACone) {
  Mesh cone = shapes::cone(20'000);
  EXPECT_FALSE(any_contact(Surface(cone)));
  cone.points[9] = {-0.9, 0.1, 0.4};  // through the other side
  EXPECT_TRUE(any_contact(Surface(cone)));
}

// A sheet through a box is cut by it and does not cut it; what two sheets have in common is not asked.
TEST(Contacts, PassiveTrianglesCutNothing) {
  Mesh mesh = shapes::box({0, 0, 0}, {1, 1, 1});
  const auto walls = static_cast<std::uint32_t>(mesh.triangles.size());
  for (const double turn : {0.1, 0.3})
    mesh.add({Point(-1, turn, 0.4), Point(2, 0.4, 0.5), Point(0.5, 0.8, 0.9 - turn)});
  std::vector<char> passive(mesh.triangles.size(), 0);
  passive[walls] = passive[walls + 1] = 1;
  const Contacts all = find_contacts(Surface(mesh)), some = find_contacts(Surface(mesh), 1000, passive);
  EXPECT_EQ(some.pairs.size() + 1, all.pairs.size());
  EXPECT_FALSE(some.cuts.empty());
  for (const Cut& cut : some.cuts) EXPECT_GE(cut.triangle, walls);
}

// Do edges lead from s to t whose ends lie within a ball around the middle of s?
bool is_fold(const Mesh& mesh, std::uint32_t s, std::uint32_t t, double size) {
  const Point middle = mesh.middle(s);
  const auto in = [&](std::uint32_t v) { return (mesh.points[v] - middle).norm() <= size; };
  std::set<std::uint32_t> reached(mesh.triangles[s].begin(), mesh.triangles[s].end());
  for (const auto& corners : {mesh.triangles[s], mesh.triangles[t]})
    if (!std::all_of(corners.begin(), corners.end(), in)) return false;
  for (bool more = true; more;) {
    more = false;
    for (const auto& c : mesh.triangles)
      for (int k = 0; k < 3; k++)
        for (int l = 0; l < 3; l++)
          if (reached.count(c[k]) > 0 && in(c[l])) more |= reached.insert(c[l]).second;
  }
  const auto& to = mesh.triangles[t];
  return std::any_of(to.begin(), to.end(), [&](auto v) { return reached.count(v) > 0; });
}

TEST(Contacts, FoldsAreCountedWhereNothingElseMeets) {
  shapes::RandomInput random(3);
  const Mesh rough = shapes::roughened(shapes::sphere(3), 0.16, random);
  Mesh plate = shapes::box({0, 0, 0}, {1, 1, 0.05}, 8);
  for (Point& p : plate.points)
    if (p.z() > 0.04 && (p - Point(0.5, 0.5, 0.05)).norm() < 0.15) p.z() = -0.05;  // through the other face
  std::set<bool> answers;
  for (const Mesh& mesh : {rough, plate, shapes::joined(rough, rough)})
    for (const double size : {0.01, 0.2, 0.3, 0.5, 0.7, 10.0}) {
      const Surface surface(mesh);
      const std::vector<std::array<std::uint32_t, 2>> pairs = find_contacts(surface).pairs;
      ASSERT_FALSE(pairs.empty());
      const bool all = std::all_of(pairs.begin(), pairs.end(),
                                   [&](const auto& p) { return is_fold(mesh, p[0], p[1], size); });
      const std::optional<std::size_t> folds = count_folds(surface, size);
      ASSERT_EQ(folds.has_value(), all) << size;
      if (all) {
        EXPECT_EQ(*folds, pairs.size());
      }
      answers.insert(all);
    }
  EXPECT_EQ(answers.size(), 2u);
  EXPECT_FALSE(count_folds(Surface(plate), 0.25));
}

}  // namespace
}  // namespace padder
