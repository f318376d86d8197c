// SPDX-License-Identifier: GPL-3.0-or-later
#include "assets/parts.h"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/intersection.h>
#include <CGAL/Polygon_mesh_processing/orient_polygon_soup.h>
#include <CGAL/Polygon_mesh_processing/orientation.h>
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Polygon_mesh_processing/self_intersections.h>
#include <CGAL/Surface_mesh.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <numbers>

#include "padding/asset/error.h"
#include "padding/asset/file.h"
#include "padding/input/read.h"
#include "tests/padding/shapes.h"
#include "tests/temporary_folder.h"

namespace padder::assets {
namespace {

namespace fs = std::filesystem;
namespace pmp = CGAL::Polygon_mesh_processing;
using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Surface = CGAL::Surface_mesh<Kernel::Point_3>;
using shapes::polygon_area, shapes::volume, std::numbers::pi;

Surface to_surface(const Mesh& mesh) {
  std::vector<Kernel::Point_3> points;
  std::vector<std::vector<std::size_t>> faces;
  for (const Point& p : mesh.points) points.emplace_back(p.x(), p.y(), p.z());
  for (const auto& t : mesh.triangles) faces.push_back({t[0], t[1], t[2]});
  EXPECT_TRUE(pmp::is_polygon_soup_a_polygon_mesh(faces)) << "not a manifold or not oriented";
  Surface surface;
  pmp::polygon_soup_to_polygon_mesh(points, faces, surface);
  return surface;
}

// One closed, manifold, outward surface without self-intersections, of this many handles.
void expect_solid(const Mesh& mesh, int genus) {
  const Surface s = to_surface(mesh);
  EXPECT_TRUE(CGAL::is_closed(s));
  EXPECT_FALSE(pmp::does_self_intersect(s));
  EXPECT_TRUE(pmp::does_bound_a_volume(s));
  EXPECT_GT(volume(mesh), 0);
  const long euler = static_cast<long>(s.number_of_vertices()) - static_cast<long>(s.number_of_edges()) +
                     static_cast<long>(s.number_of_faces());
  EXPECT_EQ(euler, 2 - 2 * genus);
  EXPECT_EQ(mesh.points.size(), s.number_of_vertices());  // and no point beside it
}

Vector size(const Mesh& mesh) { return mesh.bounds().high - mesh.bounds().low; }

TEST(Parts, TheCommittedFilesAreWhatTheGeneratorMakes) {
  if (!fs::exists(fs::path(PADDER_BIN) / "make_assets")) GTEST_SKIP() << "make_assets is not built here";
  const TemporaryFolder folder;
  const std::string command =
      std::string("'") + PADDER_BIN + "/make_assets' -o '" + folder.path().string() + "' 2>/dev/null";
  ASSERT_EQ(std::system(command.c_str()), 0);
  for (const char* part : {"track_shoe.obj", "road_wheel.obj", "grain.obj", "hopper.obj"}) {
    const std::string made = read_file(folder.path() / part);
    EXPECT_TRUE(made == read_file(fs::path(PADDER_ASSETS) / part))
        << part << " differs: make_assets -o assets";
    EXPECT_LT(made.size(), 400000u);
  }
}

TEST(Parts, TheCommittedFilesAreSolids) {
  const std::pair<const char*, int> table[] = {
      {"track_shoe.obj", 10}, {"road_wheel.obj", 15}, {"grain.obj", 0}, {"hopper.obj", 17}};
  for (const auto& [name, genus] : table) {
    SCOPED_TRACE(name);
    expect_solid(read_mesh(fs::path(PADDER_ASSETS) / name).mesh, genus);
  }
}

TEST(Parts, TrackShoeHasItsDimensions) {
  const TrackShoe d;
  const Mesh shoe = make_track_shoe(d);
  expect_solid(shoe, d.lugs + 2 + 1);  // bores, windows, the hole in the horn
  EXPECT_GT(shoe.triangles.size(), 2000u);
  EXPECT_LT(shoe.triangles.size(), 8000u);
  EXPECT_NEAR(size(shoe).x(), d.pitch + d.boss * std::cos(pi / d.segments), 1e-6);
  EXPECT_NEAR(size(shoe).y(), d.width, 1e-6);
  EXPECT_NEAR(size(shoe).z(), d.grouser + d.plate + d.horn, 1e-6);
  // More than its plate alone, less than plate, lugs and the boxes around horn, paths and grousers.
  const double plate = (d.pitch - d.boss - 0.06 * d.pitch) * d.width * d.plate;
  EXPECT_GT(volume(shoe), plate);
  EXPECT_LT(volume(shoe), plate + d.width * d.boss * (d.boss + 0.5 * d.pitch) +
                              0.1 * d.horn * d.pitch * d.width + d.grouser * d.width * 0.5 * d.pitch);
  // Each pin passes: nothing inside its bore, and the bore's wall there.
  for (const double side : {-1.0, 1.0}) {
    double nearest = 1;
    for (const Point& p : shoe.points)
      nearest = std::min(nearest, std::hypot(p.x() - side * d.pitch / 2, p.z()));
    EXPECT_NEAR(nearest, d.bore / 2, 1e-6);
  }
}

TEST(Parts, NeighbouringShoesDoNotMeet) {
  const TrackShoe d;
  const Mesh shoe = make_track_shoe(d);
  Mesh next = shoe;
  for (Point& p : next.points) p.x() += d.pitch;
  EXPECT_FALSE(pmp::do_intersect(to_surface(shoe), to_surface(next)));
  for (Point& p : next.points) p.y() += d.width / d.lugs;  // out of step they would
  EXPECT_TRUE(pmp::do_intersect(to_surface(shoe), to_surface(next)));
}

TEST(Parts, TrackShoesOfOtherDimensions) {
  TrackShoe wide;
  wide.width = 0.6, wide.lugs = 9, wide.segments = 24;
  expect_solid(make_track_shoe(wide), 12);
  TrackShoe small;
  small.pitch = 0.1, small.width = 0.3, small.bore = 0.018, small.boss = 0.036, small.plate = 0.014,
  small.grouser = 0.02;
  small.horn = 0.05, small.lugs = 5;
  expect_solid(make_track_shoe(small), 8);
  TrackShoe wrong;
  wrong.bore = 0.06;
  EXPECT_THROW(make_track_shoe(wrong), Error);
  wrong = {}, wrong.pitch = 0.08;
  EXPECT_THROW(make_track_shoe(wrong), Error);
  wrong = {}, wrong.lugs = 1;
  EXPECT_THROW(make_track_shoe(wrong), Error);
}

TEST(Parts, RoadWheelLosesWhatItsHolesTake) {
  RoadWheel d;
  d.bolts = 0, d.windows = 0;
  const Mesh plain = make_road_wheel(d);
  expect_solid(plain, 1);
  EXPECT_NEAR(size(plain).y(), d.width, 1e-6);
  EXPECT_NEAR(size(plain).x(), 2 * d.radius, 1e-6);
  EXPECT_LT(volume(plain), pi * d.radius * d.radius * d.width);
  d.bolts = 8;
  const Mesh bolted = make_road_wheel(d);
  expect_solid(bolted, 9);
  EXPECT_NEAR(volume(plain) - volume(bolted), 8 * 0.090 * polygon_area(16, 0.3 * 0.032),
              1e-9);  // the hub is 90 mm long
  d.bolts = 0, d.windows = 6;
  const Mesh pierced = make_road_wheel(d);
  expect_solid(pierced, 7);
  EXPECT_NEAR(volume(plain) - volume(pierced), 6 * 0.014 * polygon_area(28, 0.040),
              1e-8);  // the disc 14 mm along y
  d.bore = 0.1;
  EXPECT_THROW(make_road_wheel(d), Error);
}

TEST(Parts, GrainsAreConvexAlmostAndSeeded) {
  Grain d;
  for (const std::uint32_t seed : {1u, 2u, 3u}) {
    d.seed = seed;
    const Mesh grain = make_grain(d);
    expect_solid(grain, 0);
    EXPECT_EQ(grain.triangles.size(), 1620u);
    EXPECT_GT(volume(grain), 0.3 * std::pow(d.size, 3));
    EXPECT_LT(volume(grain), 1.2 * std::pow(d.size, 3));
    for (std::size_t t = 0; t < grain.triangles.size();
         t++)  // between its vertices the true body bulges a little
      for (const Point& p : grain.points)
        EXPECT_LT(grain.area_normal(t).normalized().dot(p - grain.corner(t, 0)), 0.02 * d.size);
  }
  EXPECT_EQ(make_grain().points, make_grain().points);
  EXPECT_NE(make_grain(d).points, make_grain().points);
  d.planes = 2;
  EXPECT_THROW(make_grain(d), Error);
}

TEST(Parts, HopperIsAWallOfItsThickness) {
  Hopper d;
  d.bolts = 0;
  const Mesh plain = make_hopper(d);
  expect_solid(plain, 1);
  EXPECT_NEAR(size(plain).z(), d.height, 1e-6);
  EXPECT_NEAR(size(plain).x(), 1.12 * d.inlet, 1e-6);
  // Both sides of the wall are its area: the body is about half of it times the wall.
  EXPECT_NEAR(volume(plain), 0.5 * plain.area() * d.wall, 0.1 * volume(plain));
  d.bolts = 4;
  const Mesh bolted = make_hopper(d);
  expect_solid(bolted, 17);
  EXPECT_NEAR(volume(plain) - volume(bolted), 16 * 2 * d.wall * polygon_area(16, 0.2 * 0.06 * d.inlet), 1e-9);
  d.outlet = 0.9;
  EXPECT_THROW(make_hopper(d), Error);
}

}  // namespace
}  // namespace padder::assets
