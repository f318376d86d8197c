// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/meshing/contacts.h"

#include <CGAL/Triangle_3.h>
#include <CGAL/intersections.h>
#include <gtest/gtest.h>

#include <set>

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
  Mesh fold;
  fold.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0.2, 0.2, 0}, {0.2, 0.2, 1}, {0.4, 0.3, -1}};
  fold.triangles = {{0, 1, 2}, {0, 1, 3}};
  EXPECT_EQ(find_contacts(Surface(fold)).overlaps.size(), 1u);
  fold.triangles = {{0, 1, 2}, {0, 1, 4}};
  EXPECT_TRUE(find_contacts(Surface(fold)).pairs.empty());
  fold.triangles = {{0, 1, 2}, {0, 4, 5}};  // through a common vertex and the inside
  const Contacts through = find_contacts(Surface(fold));
  ASSERT_EQ(through.pairs.size(), 1u);
  EXPECT_EQ(through.cuts[0].ends[0].is_vertex() + through.cuts[0].ends[1].is_vertex(), 1);
}

}  // namespace
}  // namespace padder
