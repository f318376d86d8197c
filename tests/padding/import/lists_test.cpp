// SPDX-License-Identifier: MIT
// Sphere lists of DEM programs and Chrono's header: padding/export/dem.cpp, chrono.cpp, read_lists.cpp.
#include "padding/asset/error.h"
#include "tests/error_of.h"
#include "tests/padding/export/samples.h"

namespace padder::samples {
namespace {

class ListsTest : public ExportTest {};

// In the frame of the sample's own box: centre at the origin, sides along the axes.
Cluster brick_in_mass_frame() {
  Cluster c = brick();
  for (Point& p : c.centers) p = c.mass.axes.transpose() * (p - c.mass.center);
  return c;
}

TEST_F(ListsTest, DemEngineCsv) {
  const std::string csv = text(model_of(brick()), "b.csv");
  // Its reader's rules: lines that begin with # are left out, then the header, then four numbers a line.
  std::istringstream in(csv);
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);)
    if (line[0] != '#') lines.push_back(line);
  ASSERT_EQ(lines.size(), 4u);
  EXPECT_EQ(lines[0], "x,y,z,r");
  expect_same_spheres(read_spheres(folder_ / "b.csv"), brick_in_mass_frame());
  // The principal axes of a box are its sides: the sphere made at (-0.2, 0.01, -0.02) is there again, up to
  // the axes' order.
  const Cluster back = read_spheres(folder_ / "b.csv");
  Vector sides = back.centers[0].cwiseAbs();
  std::sort(sides.data(), sides.data() + 3);
  EXPECT_LT((sides - Vector(0.01, 0.02, 0.2)).norm(), 1e-12);
  // Mass 1000 * 0.6 * 0.4 * 0.2, moments m / 12 (b^2 + c^2) ascending.
  const auto at = csv.find(": mass ");
  ASSERT_NE(at, std::string::npos);
  double mass, moments[3];
  ASSERT_EQ(std::sscanf(csv.c_str() + at, ": mass %lf, moments %lf %lf %lf", &mass, moments, moments + 1,
                        moments + 2),
            4);
  EXPECT_NEAR(mass, 48, 1e-9);
  EXPECT_NEAR(moments[0], 4 * (0.16 + 0.04), 1e-9);
  EXPECT_NEAR(moments[2], 4 * (0.36 + 0.16), 1e-9);
}

TEST_F(ListsTest, AllFilesOfAClumpAreWrittenOrNone) {
  fs::create_directory(folder_ / "m");
  write_file(folder_ / "m/Inertia", "a file where a folder must be");
  EXPECT_TRUE(refuses([&] { write(model_of(brick()), "m", "mercury"); }, "cannot write"));
  EXPECT_FALSE(fs::exists(folder_ / "m/Clump"));
}

TEST_F(ListsTest, DemEngineCsvByHand) {
  const auto read = [&](const std::string& content) {
    write_file(folder_ / "h.csv", content);
    return read_spheres(folder_ / "h.csv");
  };
  const Cluster c = read("# head\nx,y,z,r\r\n0.5,0.34,0,0.8\n# between\n-1e-3,+2,3,1\n\n");
  ASSERT_EQ(c.size(), 2u);
  EXPECT_EQ(c.centers[1], Point(-1e-3, 2, 3));
  EXPECT_EQ(c.bounds.low, Point(-1.001, -0.46000000000000002, -0.8));
  for (const char* wrong :
       {"x,y,z,radius\n1,2,3,4\n", "x,y,z,r\n1,2,3\n", "x,y,z,r\n1,2,3,4,5\n", "x,y,z,r\n1,2,three,4\n",
        "x,y,z,r\n1,2,3,-4\n", "x,y,z,r\n1,2,nan,4\n", "x,y,z,r\n", ""})
    EXPECT_THROW(read(wrong), Error) << wrong;
  EXPECT_TRUE(refuses([&] { read("x,y,z,r\n1,2,3,4\n1,2,x,4\n"); }, "h.csv, line 3: \"x\" is not a number"));
  write_file(folder_ / "part.OBJ", "v 0 0 0\n");
  EXPECT_TRUE(refuses([&] { read_spheres(folder_ / "part.OBJ"); },
                      "if it is a mesh, make spheres of it with pad, in Python with pad_file"));
}

TEST_F(ListsTest, Liggghts) {
  expect_same_spheres(read_spheres(write(model_of(brick()), "b.txt", "liggghts")), brick());
}

TEST_F(ListsTest, Yade) {
  const std::string list = text(model_of(brick()), "b.txt", "yade");
  EXPECT_TRUE(list.starts_with("#format x_y_z_r_clumpId\n"));
  EXPECT_EQ(list.find("\n\n"), std::string::npos);
  EXPECT_EQ(list.find('#', 1), std::string::npos);
  const Cluster back = read_spheres(folder_ / "b.txt");
  expect_same_spheres(back, brick());
  EXPECT_EQ(back.name, "b");
  write_file(folder_ / "two.txt", "#format r_x_y_z_clumpId\n0.5 1 2 3 7\n0.6 4 5 6 8\n");
  EXPECT_EQ(read_spheres(folder_ / "two.txt", "8").centers[0], Point(4, 5, 6));
  EXPECT_EQ(read_spheres(folder_ / "two.txt", "8").radii[0], 0.6);
  EXPECT_THROW(read_spheres(folder_ / "two.txt"), Error);
  EXPECT_THROW(read_spheres(folder_ / "two.txt", "9"), Error);
}

TEST_F(ListsTest, Mercury) {
  write(model_of(brick()), "brick", "mercury");
  expect_same_spheres(read_spheres(folder_ / "brick"), brick_in_mass_frame());
  fs::create_directories(folder_ / "earlier/clump");
  write_file(folder_ / "earlier/clump/clump.txt", read_file(folder_ / "brick/Clump/Clump.txt"));
  expect_same_spheres(read_spheres(folder_ / "earlier"), brick_in_mass_frame());
  // As its own reader does: the first number of Mass.txt, three rows of three by commas.
  EXPECT_NEAR(std::stof(read_file(folder_ / "brick/Inertia/Mass.txt")), 48, 1e-5);
  std::istringstream rows(read_file(folder_ / "brick/Inertia/TOI.txt"));
  std::vector<double> toi;
  for (std::string line; std::getline(rows, line);) {
    std::istringstream row(line);
    for (std::string value; std::getline(row, value, ',');) toi.push_back(std::stod(value));
  }
  ASSERT_EQ(toi.size(), 9u);
  EXPECT_NEAR(toi[0], 4 * 0.20, 1e-9);
  EXPECT_NEAR(toi[4], 4 * 0.40, 1e-9);
  EXPECT_NEAR(toi[8], 4 * 0.52, 1e-9);
  EXPECT_EQ(read_file(folder_ / "brick/Inertia/PD.txt"), "1,0,0\n0,1,0\n0,0,1\n");
  EXPECT_THROW(read_spheres(folder_), Error);
}

TEST_F(ListsTest, ChronoHeaderCompilesAndHoldsTheNumbers) {
  Cluster c = brick();
  c.name = "brick no. 1";
  c.family = 3;
  write(model_of(c), "brick.h", "chrono");
  write_file(folder_ / "main.cpp",
             "#include \"brick.h\"\nnamespace b = brick_no__1;\nstatic_assert(b::family_group == 8 && "
             "b::family_mask == 0x7ff7);\n"
             "static_assert(b::mass > 47.999999 && b::mass < 48.000001);\nstatic_assert(sizeof(b::spheres) "
             "== 3 * 4 * sizeof(double));\n"
             "static_assert(b::spheres[0][3] == " +
                 std::to_string(c.radii[0]).substr(0, 4) +
                 " + 0.04 / 7 || b::spheres[0][3] > 0.155);\nint main() {}\n");
  const Ran r = run_here("c++ -std=c++17 -Wall -Wextra -Werror -fsyntax-only main.cpp");
  EXPECT_EQ(r.status, 0) << r.output;
}

TEST_F(ListsTest, ChronoTakesFourteenFamilies) {
  Model m;
  m.name = "chain";
  for (std::uint32_t k = 1; k <= 15; k++) {
    Body b;
    b.cluster = brick();
    b.name = "b" + std::to_string(k);
    b.cluster.family = k, b.cluster.mask = k == 1 ? 0 : 1u << (k - 2);
    m.bodies.push_back(b);
  }
  EXPECT_THROW(write(m, "c.h", "chrono"), Error);
  EXPECT_FALSE(fs::exists(folder_ / "c.h"));
  m.bodies.pop_back();
  const std::string header = text(m, "c.h", "chrono");
  EXPECT_NE(header.find("family_group = 16384, family_mask = 8191;"), std::string::npos);  // 14 masks 13
  EXPECT_NE(header.find("family_group = 2, family_mask = 32765;"), std::string::npos);     // 1
}

// A part alone: none meets everything, family and mask are told from others.
TEST_F(ListsTest, ChronoKeepsTheFamilyOfAPartAlone) {
  const auto bits = [&](std::uint32_t family, std::uint32_t mask) {
    Cluster c = brick();
    c.family = family, c.mask = mask;
    const std::string header = text(model_of(c), "one.h", "chrono");
    const auto at = header.find("family_group =");
    return header.substr(at, header.find(';', at) - at);
  };
  EXPECT_EQ(bits(0, 0), "family_group = 1, family_mask = 32767");
  EXPECT_EQ(bits(0, 4), "family_group = 1, family_mask = 32759");
  EXPECT_EQ(bits(1, 0), "family_group = 2, family_mask = 32765");
  EXPECT_EQ(bits(3, 0), "family_group = 8, family_mask = 32759");
  EXPECT_THROW(bits(15, 0), Error);
}

TEST_F(ListsTest, WhatTheyCannotHoldIsRefusedAndNothingWritten) {
  Cluster family = brick(), masked = brick(), sheet = brick(), none = brick(), flat = brick();
  family.family = 3, masked.mask = 1;
  sheet.mass = {};
  none.centers.clear(), none.radii.clear(), none.triangle.clear();
  flat.radii[1] = 0;
  for (const auto& [file, format] :
       {std::pair("b.csv", ""), {"b.txt", "liggghts"}, {"b.txt", "yade"}, {"b", "mercury"}}) {
    for (const Cluster& c : {family, masked, none, flat})
      EXPECT_THROW(write(model_of(c), file, format), Error) << format;
    EXPECT_THROW(write(arm(), file, format), Error);
    EXPECT_FALSE(fs::exists(folder_ / file));
  }
  // They name pairs of bodies in one file: a part alone would lose its family without a word.
  for (const char* file : {"b.urdf", "b.srdf", "b.yaml", "b.xrdf", "b.usda"}) {
    for (const Cluster& c : {family, masked}) EXPECT_THROW(write(model_of(c), file), Error) << file;
    EXPECT_FALSE(fs::exists(folder_ / file));
    write(model_of(brick()), file);
  }
  EXPECT_THROW(write(model_of(sheet), "b.csv"), Error);
  EXPECT_THROW(write(model_of(sheet), "b", "mercury"), Error);
  EXPECT_THROW(write(model_of(brick()), "b.xyz"), Error);
  EXPECT_THROW(write(model_of(brick()), "b.csv", "povray"), Error);
  EXPECT_THROW(write(model_of(brick()), "absent/b.csv"), Error);
}

}  // namespace
}  // namespace padder::samples
