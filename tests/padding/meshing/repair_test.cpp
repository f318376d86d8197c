// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/meshing/repair.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "padding/asset/error.h"
#include "padding/geometry/surface.h"
#include "padding/meshing/pieces.h"
#include "tests/error_of.h"
#include "tests/padding/random_input.h"

namespace padder {
namespace {

using shapes::joined, shapes::turned_over;

Mesh soup_of(const Mesh& mesh) {  // every triangle with corners of its own
  Mesh soup;
  for (std::size_t t = 0; t < mesh.triangles.size(); t++) soup.add(mesh.corners(t));
  return soup;
}

Mesh hills() {
  return shapes::mapped(shapes::square(1, 20), [](const Point& p) {
    return Point(p.x(), p.y(), 0.05 * std::sin(9 * p.x()) * std::cos(7 * p.y()));
  });
}

double volume(const Repaired& r) { return mass_properties(r.mesh).volume; }

const Mesh kCube = shapes::box({0, 0, 0}, {1, 1, 1}, 4);

TEST(Repair, WallsInsideThatAreTooSmallToSeeAreNotWorthAWord) {
  Mesh mesh = kCube;
  const auto [a, b, c] = mesh.triangles[0];
  const auto foot = static_cast<std::uint32_t>(mesh.points.size()), top = foot + 1;
  mesh.points.push_back(mesh.points[a] + 1e-3 * (mesh.middle(0) - mesh.points[a]));
  mesh.points.push_back(mesh.points[foot] - 1e-3 * mesh.area_normal(0).normalized());
  mesh.triangles[0] = {a, b, foot};
  for (const Corners& t : {Corners{b, c, foot}, Corners{c, a, foot}, Corners{a, foot, top}})
    mesh.triangles.push_back(t);
  const Repaired r = repair(mesh, {}, "cube");
  EXPECT_EQ(r.report, "none needed");
  EXPECT_GT(r.steps.buried_area, 0);
  EXPECT_NEAR(r.boundary().area(), 6, 1e-12);
}

TEST(Repair, ACleanSolidIsLeftAlone) {
  const Repaired r = repair(kCube, {}, "cube");
  EXPECT_EQ(r.kind, BodyKind::solid);
  EXPECT_EQ(r.report, "none needed");
  EXPECT_EQ(r.mesh.triangles.size(), kCube.triangles.size());
  EXPECT_NEAR(volume(r), 1, 1e-12);
}

TEST(Repair, NestedShellsAreCavitiesAndTheReportSaysSo) {
  const Mesh inner = shapes::box({0.25, 0.25, 0.25}, {0.75, 0.75, 0.75});
  const Mesh hollow = joined(kCube, turned_over(inner)), nested = joined(kCube, inner);
  for (const Mesh& mesh : {hollow, turned_over(hollow), nested, turned_over(nested)}) {
    const Repaired r = repair(mesh, {}, "nested");
    EXPECT_EQ(r.kind, BodyKind::solid);
    EXPECT_NEAR(volume(r), 0.875, 1e-12);
    EXPECT_EQ(r.steps.cavities, 1u);
    EXPECT_TRUE(holds(r.report, "kept 1 inner shell as cavities"));
  }
  EXPECT_EQ(repair(hollow, {}, "hollow").report.find("outward"), std::string::npos);
  EXPECT_EQ(repair(turned_over(hollow), {}, "hollow").report.find("outward"), std::string::npos);
  EXPECT_NE(repair(nested, {}, "nested").report.find("though 1 faces outward"), std::string::npos);
}

TEST(Repair, AShellJustInsideAnotherIsACopyAndNoCavity) {
  const auto shrunk = [](double by) {
    return shapes::mapped(kCube, [&](const Point& p) {
      return Point(Point(0.5, 0.5, 0.5) + (1 - by) * (p - Point(0.5, 0.5, 0.5)));
    });
  };
  const Mesh copy = shrunk(1e-4);
  for (const Mesh& mesh : {joined(kCube, copy), turned_over(joined(copy, kCube))}) {
    const Repaired r = repair(mesh, {}, "copies");
    EXPECT_NEAR(volume(r), 1, 1e-12);
    EXPECT_EQ(r.steps.copies, 1u);
    EXPECT_TRUE(holds(r.report, "took 1 inner shell for a copy"));
  }
  // A shell that faces the other way is a cavity, however thin the wall, and so is one with a thicker wall.
  const Repaired thin = repair(joined(kCube, turned_over(copy)), {}, "thin");
  EXPECT_EQ(thin.steps.copies, 0u);
  EXPECT_NEAR(volume(thin), 3e-4, 1e-6);
  EXPECT_EQ(repair(joined(kCube, shrunk(0.02)), {}, "thick").steps.cavities, 1u);
  // Copies do not count around a cavity.
  const Mesh inner = shapes::box({0.25, 0.25, 0.25}, {0.75, 0.75, 0.75}, 2);
  const Repaired hollow = repair(joined(joined(kCube, copy), inner), {}, "hollow");
  EXPECT_EQ(hollow.steps.copies, 1u);
  EXPECT_EQ(hollow.steps.cavities, 1u);
  EXPECT_NEAR(volume(hollow), 1 - 0.125, 1e-12);
}

TEST(Repair, SoupShuffledDuplicatedAndInsideOut) {
  shapes::RandomInput random(3);
  Mesh soup = soup_of(turned_over(kCube));
  for (auto& t : soup.triangles)
    if (random.uniform(0, 1) < 0.5) std::swap(t[0], t[1]);
  soup.triangles.push_back(soup.triangles[5]);                       // twice the same
  soup.add({Point(0, 0, 0), Point(1, 1, 1), Point(0.5, 0.5, 0.5)});  // no area
  const Repaired r = repair(soup, {}, "soup");
  EXPECT_EQ(r.kind, BodyKind::solid);
  EXPECT_NEAR(volume(r), 1, 1e-12);
  EXPECT_TRUE(holds(r.report, "dropped 1 triangle without area"));
}

TEST(Repair, ASmallHoleIsClosed) {
  Mesh mesh = shapes::sphere(5);
  mesh.triangles.erase(mesh.triangles.begin() + 100);
  const Repaired r = repair(mesh, {}, "sphere");
  EXPECT_EQ(r.kind, BodyKind::solid);
  EXPECT_TRUE(holds(r.report, "closed 1 hole"));
  EXPECT_EQ(r.mesh.triangles.size(), shapes::sphere(5).triangles.size());
}

TEST(Repair, AWrapOfAnOpenBoxIsAShell) {
  const Mesh mesh = shapes::without(kCube, [](const Point& p) { return p.z() == 1; });
  EXPECT_EQ(repair(mesh, {}, "open box").kind, BodyKind::sheet);
  const Repaired r = repair(mesh, {.mode = RepairMode::wrap, .tolerance = 0.04}, "open box");
  EXPECT_EQ(r.kind, BodyKind::wrap);
  // The wrap is a shell of five unit walls, a little thicker than twice the offset.
  EXPECT_NEAR(volume(r), 5 * 2 * r.offset, 2 * r.offset);
  const Surface input(mesh), wrap(r.mesh);
  for (const Point& p : r.mesh.points)
    EXPECT_NEAR(input.nearest(p).distance, r.offset, 0.5 * r.offset + 0.2 * r.alpha);
  std::set<std::uint32_t> used;
  for (const auto& t : mesh.triangles) used.insert(t.begin(), t.end());
  for (const auto v : used) EXPECT_LE(wrap.signed_nearest(mesh.points[v]).distance, 0);  // encloses the input
}

TEST(Repair, AWrapForAToleranceOfNothingComesToAnEnd) {
  const Repaired r = repair(kCube, {.mode = RepairMode::wrap, .accuracy = 1e-300, .alpha = 0.5}, "cube");
  EXPECT_GE(r.offset, 1e-9);
  EXPECT_NEAR(volume(r), 1, 1e-6);
}

TEST(Repair, OverlappingBoxesBecomeTheirUnion) {
  const Repaired r = repair(joined(kCube, shapes::box({0.45, 0.2, 0.2}, {1.5, 0.7, 0.7}, 2)), {}, "boxes");
  EXPECT_EQ(r.kind, BodyKind::solid);
  EXPECT_TRUE(holds(r.report, "made one body of 2 pieces"));
  EXPECT_NEAR(volume(r), 1.125, 1e-9);
}

// The noise of a scan folds the surface over; where the folds are small, cutting them out gains nothing.
TEST(Repair, SmallFoldsAreKept) {
  shapes::RandomInput random(3);
  const Mesh rough = shapes::roughened(shapes::sphere(4), 0.08, random);
  RepairOptions options;
  EXPECT_TRUE(holds(repair(rough, options, "rough").report, "made one body"));
  options.fold_size = 0.4;
  for (const Mesh& mesh : {rough, turned_over(rough)}) {
    const Repaired r = repair(mesh, options, "rough");
    EXPECT_TRUE(holds(r.report, "kept folds"));
    EXPECT_GT(r.steps.crossing_pairs, 0u);
    EXPECT_EQ(r.mesh.triangles.size(), rough.triangles.size());
    EXPECT_EQ(r.side(), SideBy::winding);
    EXPECT_EQ(r.ready->signed_nearest(Point::Zero()).distance,
              Surface(r.mesh, SideBy::winding).signed_nearest(Point::Zero()).distance);
    EXPECT_LT(r.ready->signed_nearest(Point::Zero()).distance, -0.9);
  }
  const Mesh two = joined(kCube, shapes::box({0.5, 0.5, 0.5}, {2, 2, 2}));
  EXPECT_TRUE(holds(repair(two, options, "two").report, "made one body"));
}

TEST(Repair, ATerrainStaysASheet) {
  const Mesh mesh = hills();
  const Repaired r = repair(mesh, {}, "terrain");
  EXPECT_EQ(r.kind, BodyKind::sheet);
  EXPECT_TRUE(holds(r.report, "open sheet"));
  EXPECT_EQ(r.mesh.triangles.size(), mesh.triangles.size());
}

TEST(Repair, AStackOfSheetsIsNoTerrain) {
  const Mesh field = hills();
  const RepairOptions below{.below_terrain = true};
  EXPECT_FALSE(repair(field, below, "terrain").solid);
  // A tenth of it above the corner of the other.
  const Mesh above = shapes::moved(shapes::square(1, 20), {0.7, 0.7, 0.3});
  for (const Mesh& two : {joined(field, above), shapes::stack(shapes::square(1), 100, 2)}) {
    const Repaired r = repair(two, below, "stack");
    EXPECT_EQ(r.kind, BodyKind::sheet);
    EXPECT_TRUE(r.solid) << r.report;
  }
}

TEST(Repair, NeverTrustsTheFile) {
  const RepairOptions never{.mode = RepairMode::never};
  EXPECT_EQ(repair(soup_of(kCube), never, "cube").kind, BodyKind::solid);
  EXPECT_EQ(repair(shapes::square(1), never, "square").kind, BodyKind::sheet);
  Mesh turned = kCube;
  std::swap(turned.triangles[0][0], turned.triangles[0][1]);
  EXPECT_THROW(repair(turned, never, "turned"), Error);
}

// 7 blades across 7 others: each crosses each of the others.
TEST(Repair, WhatCrossesAllOverIsWrappedOrRefusedInASentence) {
  Mesh mesh;
  constexpr int strips = 7;
  for (int way = 0; way < 2; way++)
    for (int k = 0; k < strips; k++) {
      const double at = (k + 0.3) / strips;
      const auto point = [&](double along, double z, double beside = 0) {
        mesh.points.push_back(way == 0 ? Point(along, at + beside, z) : Point(at + beside, along, z));
        return static_cast<std::uint32_t>(mesh.points.size() - 1);
      };
      const auto a = point(-0.5, 0), b = point(1.5, 0), c = point(0.5, 0.2), d = point(0.5, 0.05, 0.02);
      mesh.triangles.insert(mesh.triangles.end(), {{a, b, c}, {a, d, b}, {b, d, c}, {c, d, a}});
    }
  RepairOptions options{.tolerance = 0.05};
  const std::size_t pairs = repair(mesh, options, "grille").steps.crossing_pairs;
  EXPECT_GT(pairs, 49u);
  options.most_pairs = pairs;
  EXPECT_EQ(repair(mesh, options, "grille").kind, BodyKind::solid);
  options.most_pairs = pairs - 1;
  const Repaired r = repair(mesh, options, "grille");
  EXPECT_EQ(r.kind, BodyKind::wrap);
  EXPECT_TRUE(holds(r.report, "its triangles cross at more than"));
  options.mode = RepairMode::united;
  EXPECT_EQ(error_of([&] { repair(mesh, options, "grille"); }),
            "grille: its triangles cross at more than " + std::to_string(pairs - 1) +
                " places, too many to be cut apart: smooth the mesh, or give --repair wrap");
}

// Twelve plates in each of three directions: two of them cross in lines, but three in points, and of these
// there are more.
TEST(Repair, WhatCrossesByThreesAllOverIsWrapped) {
  Mesh mesh;
  constexpr int plates = 12;
  for (int axis = 0; axis < 3; axis++)
    for (int k = 0; k < plates; k++) {
      Point low(0, 0, 0), high(1, 1, 1);
      low[axis] = (k + 0.3) / plates, high[axis] = (k + 0.4) / plates;
      mesh.add(shapes::box(low, high));
    }
  RepairOptions options{.tolerance = 0.05};
  const std::size_t pairs = repair(mesh, options, "plates").steps.crossing_pairs;
  options.most_pairs = pairs;
  EXPECT_EQ(repair(mesh, options, "plates").kind, BodyKind::wrap);
  options.most_pairs = 100 * pairs;
  EXPECT_EQ(repair(mesh, options, "plates").kind, BodyKind::solid);
}

TEST(Repair, NothingWithAnAreaIsRefusedInASentence) {
  const Mesh line{{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, {{0, 1, 2}}};
  EXPECT_TRUE(refuses([&] { repair(line, {}, "line.obj"); }, "line.obj"));
}

// Two parts of a few centimetres, a kilometre apart, with triangles of a tenth of a millimetre.
TEST(Repair, SmallTrianglesFarApartHaveAnArea) {
  const Mesh mesh =
      joined(shapes::box({0, 0, 0}, {6e-8, 6e-8, 6e-8}), shapes::box({1, 0, 0}, {1 + 6e-8, 6e-8, 6e-8}));
  const Repaired r = repair(mesh, {}, "apart");
  EXPECT_EQ(r.kind, BodyKind::solid);
  EXPECT_EQ(r.mesh.triangles.size(), 24u);
}

TEST(Repair, AClosedSoupIsOnePieceWithTheSameTriangles) {
  for (const Mesh& mesh :
       {shapes::box({0, 0, 0}, {1, 2, 3}), shapes::sphere(3), shapes::torus(1, 0.3, 20, 10)}) {
    const auto piece = one_closed_piece(soup_of(mesh));
    ASSERT_TRUE(piece);
    EXPECT_EQ(piece->points.size(), mesh.points.size());
    ASSERT_EQ(piece->triangles.size(), mesh.triangles.size());
    for (std::size_t t = 0; t < mesh.triangles.size(); t++)
      for (int k = 0; k < 3; k++) EXPECT_EQ(piece->corner(t, k), mesh.corner(t, k));
  }
}

TEST(Repair, WhatIsOpenTurnedRepeatedOrPinchedIsNoClosedPiece) {
  const Mesh whole = shapes::sphere(2);
  Mesh open = whole, turned = whole, repeated = whole, flat = whole;
  open.triangles.pop_back();
  std::swap(turned.triangles[7][0], turned.triangles[7][1]);
  repeated.triangles.push_back(repeated.triangles[3]);
  flat.triangles.push_back({1, 1, 2});
  const Mesh one = shapes::box({0, 0, 0}, {1, 1, 1});  // and another: apart, at a corner, at an edge
  for (const Mesh& mesh : {open, turned, repeated, flat}) EXPECT_FALSE(one_closed_piece(mesh));
  for (const Point& low : {Point(2, 2, 2), Point(1, 1, 1), Point(1, 1, 0)}) {
    EXPECT_FALSE(one_closed_piece(soup_of(joined(one, shapes::box(low, low + Vector(1, 1, 1))))));
  }
  // One surface that meets itself in a point.
  Mesh pinched = shapes::torus(1, 0.3, 20, 10);
  pinched.points[105] = pinched.points[100];
  EXPECT_FALSE(one_closed_piece(pinched));
}

}  // namespace
}  // namespace padder
