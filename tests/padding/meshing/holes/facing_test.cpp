// SPDX-License-Identifier: GPL-3.0-or-later
// Pieces that border on each other across cracks and T-junctions face alike, although no corner is moved.
#include "padding/meshing/holes/facing.h"

#include <gtest/gtest.h>

#include "padding/geometry/indices.h"
#include "padding/meshing/mend.h"
#include "padding/meshing/pieces.h"
#include "tests/padding/random_input.h"

namespace padder {
namespace {

using shapes::RandomInput, shapes::joined, shapes::moved, shapes::turned_over;

std::vector<std::uint32_t> all_of(const Mesh& mesh) { return numbered(mesh.triangles.size()); }

// The faces of a unit cube, each divided by itself, and some of them turned. The edges of one lie on those of
// its neighbours, off by up to `off`.
Mesh faces_of_a_cube(RandomInput& random, double off) {
  Mesh all;
  for (int face = 0; face < 6; face++) {
    const int parts = 1 + static_cast<int>(random.uniform(0, 4.999));
    const Mesh one = shapes::roughened(shapes::face_of_cube(face, parts), off, random);
    all.add(random.uniform(0, 1) < 0.5 ? turned_over(one) : one);
  }
  return all;
}

TEST(FaceAlike, FacesOfACubeThatAreDividedEachByItself) {
  for (std::uint64_t seed = 1; seed <= 20; seed++) {
    RandomInput random(seed);
    const double off = seed % 2 ? 0 : 1e-8;
    Mesh mesh = faces_of_a_cube(random, off);
    const Mesh given = mesh;
    const std::size_t turned = face_alike(mesh, all_of(mesh), 1e-5);
    EXPECT_NEAR(std::abs(signed_volume(mesh, all_of(mesh))), 1, 1e-6);
    EXPECT_LE(turned, mesh.triangles.size() / 2);
    std::size_t differ = 0;
    for (std::size_t t = 0; t < mesh.triangles.size(); t++) differ += mesh.triangles[t] != given.triangles[t];
    EXPECT_EQ(differ, turned);
    EXPECT_EQ(face_alike(mesh, all_of(mesh), 1e-5), 0u);
    // With a gap of 0 nothing may be moved or split.
    const Repaired r = mend(given, {.join_width = 0}).value();
    EXPECT_EQ(r.kind, BodyKind::solid);
    EXPECT_NEAR(mass_properties(r.boundary()).volume, 1, 1e-6);
  }
}

// A copy that lies on a sheet would close it to a shell without thickness.
TEST(FaceAlike, ACopyTellsNothing) {
  const Mesh sheet = shapes::square(1, 3), copy = moved(sheet, {0, 0, 1e-6});
  for (const Mesh& other : {copy, turned_over(copy)}) {
    Mesh mesh = joined(sheet, other);
    EXPECT_EQ(face_alike(mesh, all_of(mesh), 1e-5), 0u);
  }
  // What goes on beside it does.
  Mesh mesh = joined(sheet, turned_over(moved(copy, {1, 0, 0})));
  EXPECT_EQ(face_alike(mesh, all_of(mesh), 1e-5), copy.triangles.size());
}

// Pieces that touch in a corner, or whose borders are farther apart, do not border on each other.
TEST(FaceAlike, OnlyAcrossACrack) {
  const Mesh sheet = shapes::square(1, 2);
  for (const Vector& by : {Vector(1 + 1e-4, 0, 0), Vector(1, 1, 0)}) {
    Mesh mesh = joined(sheet, turned_over(moved(sheet, by)));
    EXPECT_EQ(face_alike(mesh, all_of(mesh), 1e-5), 0u);
  }
}

}  // namespace
}  // namespace padder
