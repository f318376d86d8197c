// SPDX-License-Identifier: GPL-3.0-or-later
// The library on small meshes that every build has (make_data.py writes them), and on a robot beside this
// file.
#include <gtest/gtest.h>

#include <cmath>

#include <filesystem>

#include "padding/asset/mesh.h"
#include "padding/export/families.h"
#include "padding/export/writers.h"
#include "padding/input/read.h"
#include "padding/robot.h"
#include "tests/error_of.h"

namespace padder {
namespace {

namespace fs = std::filesystem;

const fs::path kData = fs::path(PADDER_BIN).parent_path() / "data";
const fs::path kRobots = fs::path(PADDER_ASSETS).parent_path() / "tests/data/robot";

PadOptions within(const char* tolerance) {
  PadOptions options;
  options.tolerance = *length_of(tolerance);
  return options;
}

// Its volume: the hexagon less the bore's polygon, times the height.
TEST(Data, EveryFormatHoldsTheSameNut) {
  const struct {
    const char* file;
    const char* unit;
    double millimetre;  // in the file's unit
  } table[] = {{"nut.obj", "", 1},
               {"nut_negative_indices.obj", "", 1},
               {"nut.off", "", 1},
               {"nut_ascii.stl", "", 1},
               {"nut_binary.stl", "", 1},
               {"nut_ascii.ply", "", 1},
               {"nut_binary.ply", "", 1},
               {"nut.gltf", "m", 1e-3},
               {"nut_mirrored.glb", "m", 1e-3},
               {"nut.dae", "m", 1e-3},
               {"nut.3mf", "mm", 1},
               {"nut.msh", "", 1}};
  std::size_t files = 0;
  for (const auto& entry : fs::directory_iterator(kData / "formats")) files += entry.is_regular_file();
  EXPECT_EQ(files, std::size(table)) << "a file of formats/ is not in the table";
  for (const auto& row : table) {
    SCOPED_TRACE(row.file);
    const ReadResult nut = read_mesh(kData / "formats" / row.file);
    EXPECT_EQ(nut.mesh.triangles.size(), 128u);
    EXPECT_EQ(nut.unit, row.unit);
    const double volume = mass_properties(nut.mesh).volume;  // positive: seen from outside, mirrored or not
    EXPECT_NEAR(volume, 585.194747 * std::pow(row.millimetre, 3), 1e-5 * volume);
    EXPECT_NEAR(nut.mesh.bounds().diagonal(), std::sqrt(225.3333333 + 169 + 36) * row.millimetre,
                1e-5 * row.millimetre * 20);
  }
}

TEST(Data, MalformedFilesEndInASentenceThatNamesThem) {
  for (const auto& entry : fs::directory_iterator(kData / "malformed")) {
    SCOPED_TRACE(entry.path().string());
    EXPECT_TRUE(refuses([&] { read_mesh(entry.path()); }, entry.path().string()));
  }
}

TEST(Data, WhatIsClosedIsCertified) {
  for (const char* file :
       {"formats/nut.off", "hard/turned.off", "hard/far_away.obj", "hard/thin_plate.obj"}) {
    SCOPED_TRACE(file);
    const Padded padded = pad(read_mesh(kData / file), within("5%"));
    EXPECT_TRUE(padded.cluster.accuracy.certified);
    EXPECT_LE(padded.cluster.accuracy.protrusion_bound, 0.05001 * padded.report.diagonal);
    EXPECT_LE(padded.cluster.accuracy.gap_bound, 0.05001 * padded.report.diagonal);
  }
}

TEST(Data, WhatIsNotClosedIsRepairedAndSaysSo) {
  for (const char* file : {"hard/cracked_soup.stl", "hard/sheet_with_hole.obj"}) {
    SCOPED_TRACE(file);
    const Padded padded = pad(read_mesh(kData / file), within("5%"));
    EXPECT_GT(padded.cluster.size(), 0u);
    EXPECT_NE(padded.cluster.source.repair, "none needed");
  }
}

TEST(Data, EveryLinkOfTheArmIsPadded) {
  const PaddedRobot arm = pad_robot(kRobots / "arm_description/arm.urdf", within("5%"));
  ASSERT_EQ(arm.model.bodies.size(), 4u);
  for (const Body& body : arm.model.bodies) {
    EXPECT_GT(body.cluster.size(), 0u) << body.name;
    EXPECT_TRUE(body.cluster.accuracy.certified) << body.name;
  }
  // base, upper and fore are joined one to the next, and tool is fixed to fore: only base and fore may touch
  // (and base and tool).
  const std::vector<CollisionFilter> filters = exporting::filters_of(arm.model);
  EXPECT_FALSE(may_touch(filters[0], filters[1]));
  EXPECT_FALSE(may_touch(filters[1], filters[2]));
  EXPECT_TRUE(may_touch(filters[0], filters[2]));
}

}  // namespace
}  // namespace padder
