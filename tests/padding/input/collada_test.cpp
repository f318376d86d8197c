// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include "padding/input/read.h"
#include "tests/error_of.h"
#include "tests/padding/shapes.h"
#include "tests/temporary_folder.h"

namespace padder {
namespace {

// A tetrahedron of volume 1/6 in a COLLADA file that a test changes.
class Collada : public ::testing::Test, protected TemporaryFolder {
 protected:
  static std::string file() {
    return R"(<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset/>)"
           R"(<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="a" count="12">)"
           "0 0 0\t1 0 0\r\n 0 1 0\n0 0 1\n"
           R"(</float_array>)"
           R"(<technique_common><accessor source="#a" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>)"
           R"(<vertices id="v"><input semantic="POSITION" source="#p"/></vertices><triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/><p>0 2 1 0 1 3 1 2 3 0 3 2</p></triangles></mesh></geometry></library_geometries>)"
           R"(<library_visual_scenes><visual_scene id="s"><node id="n"><translate>0 0 5</translate><instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>)"
           R"(<scene><instance_visual_scene url="#s"/></scene></COLLADA>)";
  }
  static std::string with(std::string text, const std::string& old, const std::string& replacement) {
    EXPECT_NE(text.find(old), text.npos) << old;
    for (auto at = text.find(old); at != text.npos; at = text.find(old, at + replacement.size()))
      text.replace(at, old.size(), replacement);
    return text;
  }
  ReadResult read(const std::string& text) const { return read_mesh(put("t.dae", text)); }
  void expect_fault(const std::string& text, const std::string& words) const {
    EXPECT_TRUE(refuses([&] { read(text); }, words));
  }
};

double volume(const ReadResult& result) { return shapes::volume(result.mesh); }

TEST_F(Collada, AWrongCountOfAnArrayIsMended) {
  for (const char* count : {" count=\"6\"", " count=\"0\"", " count=\"13\"", ""})
    EXPECT_NEAR(volume(read(with(file(), " count=\"12\"", count))), 1.0 / 6, 1e-7) << count;
}

TEST_F(Collada, AnAccessorThatLeavesItsArrayIsRefused) {
  expect_fault(with(file(), "0 0 1\n</float_array>", "</float_array>"),
               "takes 12 values from the array 'a', which has 9");
  expect_fault(with(file(), "stride=\"3\"", "stride=\"4\""), "takes 15 values");
  expect_fault(with(file(), "stride=\"3\"", "stride=\"3\" offset=\"1\""), "takes 13 values");
  expect_fault(with(file(), "stride=\"3\"", "stride=\"4294967295\""), "which has 12");
  // Of items that lie between those of another accessor, the last may end the array.
  const ReadResult between =
      read(with(with(with(file(), ">0 0 0\t1 0 0\r\n 0 1 0\n0 0 1", ">9 0 0 0 9 1 0 0 9 0 1 0 9 0 0 1"),
                     "stride=\"3\"", "stride=\"4\" offset=\"1\""),
                "\"12\"", "\"16\""));
  EXPECT_NEAR(volume(between), 1.0 / 6, 1e-7);
}

// assimp read on without end after an index with letters behind it, and took what is none for 0.
TEST_F(Collada, WhatIsNoIndexIsRefused) {
  for (const char* index : {"3!1", "3.5", "-1", "4294967296", "1e3", "x"})
    expect_fault(with(file(), "0 3 2</p>", std::string("0 ") + index + " 2</p>"),
                 std::string("a <triangles> has '") + index + "' in its <p>, where an index");
}

TEST_F(Collada, AHullThatIsWrittenOutIsAMesh) {
  const std::string hull = with(with(file(), "<mesh>", "<convex_mesh>"), "</mesh>", "</convex_mesh>");
  EXPECT_NEAR(volume(read(hull)), 1.0 / 6, 1e-7);
}

TEST_F(Collada, WhereNoNodeShowsAMeshAllAreReadAndANoteSaysSo) {
  EXPECT_TRUE(read(file()).notes.empty());
  const std::string hidden = with(file(), "<instance_geometry url=\"#g\"/>", "");
  for (const std::string& text :
       {hidden, with(hidden, "<scene><instance_visual_scene url=\"#s\"/></scene>", "")}) {
    const ReadResult result = read(text);
    EXPECT_EQ(result.mesh.bounds().high, Point(1, 1, 1));
    ASSERT_EQ(result.notes.size(), 1u);
    EXPECT_NE(result.notes[0].find("no node of its scene shows a mesh"), std::string::npos);
  }
}

TEST_F(Collada, PlacesOfItsPhysicsAreSaidNotToBeRead) {
  const std::string hidden = with(file(), "<instance_geometry url=\"#g\"/>", "");
  const ReadResult result = read(with(hidden, "<scene>", "<library_physics_models/><scene>"));
  ASSERT_EQ(result.notes.size(), 1u);
  EXPECT_NE(result.notes[0].find("and not where its physics puts them"), std::string::npos);
}

// Nor is a skin looked at. The second one holds the first.
TEST_F(Collada, ASkinnedMeshIsReadWhereItsNodeStands) {
  const std::string skins =
      R"(<library_controllers><controller id="c"><skin source="#g"><joints/></skin></controller>)"
      R"(<controller id="d"><morph source="#c"/></controller></library_controllers><library_visual_scenes>)";
  for (const char* controller : {"c", "d"})
    EXPECT_EQ(read(with(with(file(), "<library_visual_scenes>", skins), "instance_geometry url=\"#g\"",
                        std::string("instance_controller url=\"#") + controller + "\""))
                  .mesh.bounds()
                  .high,
              Point(1, 1, 6));
}

TEST_F(Collada, AFileThatNamesNoSceneMeansItsFirst) {
  EXPECT_EQ(read(with(file(), "<scene><instance_visual_scene url=\"#s\"/></scene>", "")).mesh.bounds().high,
            Point(1, 1, 6));
}

TEST_F(Collada, WhatIsNotReadIsNamed) {
  expect_fault(with(file(), "<translate>0 0 5</translate>", "<skew>45 1 0 0 0 1 0</skew>"), "<skew>");
  expect_fault(with(with(file(), "<p>0 2 1 0 1 3 1 2 3 0 3 2</p>", "<ph><p>0 2 1</p><h>0 1 2</h></ph>"),
                    "triangles", "polygons"),
               "polygons with holes (<ph>)");
}

}  // namespace
}  // namespace padder
