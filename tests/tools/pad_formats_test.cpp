// SPDX-License-Identifier: GPL-3.0-or-later
// The program pad itself: endings, formats, robots, exit codes.
#include <nlohmann/json.hpp>

#include "tests/error_of.h"
#include "tests/padding/export/samples.h"

namespace padder::samples {
namespace {

class PadFormatsTest : public ExportTest {
 protected:
  void SetUp() override {
    write_file(folder_ / "cube.obj",
               "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n"
               "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n");
    write_file(folder_ / "r.urdf",
               "<robot name='r'><link name='a'><collision><geometry><mesh "
               "filename='cube.obj'/></geometry></collision></link>"
               "<link name='b'><collision><geometry><sphere radius='0.5'/></geometry></collision></link>"
               "<joint name='j' type='continuous'><parent link='a'/><child link='b'/><axis xyz='0 0 "
               "1'/></joint></robot>");
  }
  Ran pad(const std::string& arguments, const std::string& before = "") {
    return run("cd '" + folder_.string() + "' && " + before + " '" PADDER_BIN "/pad' " + arguments);
  }
};

TEST_F(PadFormatsTest, EndingsAndFormats) {
  ASSERT_EQ(pad("cube.obj --edge-length 10% -q").output, "");
  const Cluster cube = read_spheres(folder_ / "cube.spheres.json");
  const auto read_again = {"c.npz", "c.vtp", "c.urdf", "c.xml", "c.yaml", "c.xrdf", "c.srdf"},
             written = {"c.csv", "c.glb", "c.usda", "c.stl", "c.ply", "c.obj"};
  std::string words = "cube.obj --edge-length 10% -q";
  for (const auto& list : {read_again, written})
    for (const std::string file : list) words += " -o out/" + file;
  ASSERT_EQ(pad(words).output, "");
  for (const char* file : read_again) expect_same_spheres(read_spheres(folder_ / "out" / file), cube);
  for (const char* file : written) EXPECT_TRUE(fs::exists(folder_ / "out" / file)) << file;
  for (const char* format : {"liggghts", "yade", "mercury", "chrono"})
    EXPECT_EQ(pad(std::string("cube.obj --edge-length 10% -q -o f_") + format + " --format " + format).output,
              "");
  EXPECT_TRUE(fs::exists(folder_ / "f_mercury/Inertia/TOI.txt"));
  expect_same_spheres(read_spheres(folder_ / "f_yade"), cube);
  EXPECT_EQ(pad("cube.obj --edge-length 10% -q --format liggghts -o many/").output, "");
  EXPECT_TRUE(fs::exists(folder_ / "many/cube.txt"));
}

TEST_F(PadFormatsTest, AnEndingInCapitalsMeansTheSame) {
  fs::rename(folder_ / "cube.obj", folder_ / "CUBE.OBJ");
  ASSERT_EQ(
      pad("CUBE.OBJ --edge-length 10% -q -o C.JSON -o C.VTP -o C.STL --write-mesh S.PLY --preview C.PNG")
          .output,
      "");
  expect_same_spheres(read_spheres(folder_ / "C.VTP"), read_spheres(folder_ / "C.JSON"));
  for (const char* file : {"C.STL", "S.PLY", "C.PNG"}) EXPECT_TRUE(fs::exists(folder_ / file)) << file;
}

TEST_F(PadFormatsTest, AMercuryFolderIsReadBack) {
  ASSERT_EQ(pad("cube.obj --edge-length 10% -q -o c.spheres.json -o c.vtp").output, "");
  ASSERT_EQ(pad("c.spheres.json -o m --format mercury -q").output, "");
  for (const char* name : {"m", "m/"}) {
    EXPECT_EQ(pad(std::string(name) + " -o b.spheres.json -q").output, "");
    EXPECT_EQ(read_spheres(folder_ / "b.spheres.json").size(), read_spheres(folder_ / "c.vtp").size());
    EXPECT_EQ(read_spheres(folder_ / "b.spheres.json").name, "m");
    fs::remove(folder_ / "b.spheres.json");
    EXPECT_EQ(pad(std::string(name) + " --format npz -q").output, "");
    EXPECT_TRUE(fs::remove(folder_ / "m.npz"));
  }
}

TEST_F(PadFormatsTest, AFullDiskLeavesNoMercuryFolders) {
  const Ran full = pad("cube.obj --edge-length 10% -q -o full --format mercury", "ulimit -f 0 && ");
  EXPECT_TRUE(full.output.starts_with("pad: cannot write full/")) << full.output;
  EXPECT_FALSE(fs::exists(folder_ / "full"));
}

TEST_F(PadFormatsTest, AUnitIsNeverLostWithoutAWord) {
  ASSERT_EQ(pad("cube.obj --edge-length 10% -q --unit mm -o c.spheres.json -o c.npz -o c.vtp").output, "");
  for (const char* file : {"c.spheres.json", "c.npz", "c.vtp"}) {
    ASSERT_EQ(pad(std::string(file) + " -q -o c.xml").output, "") << file;
    EXPECT_LT(read_spheres(folder_ / "c.xml").bounds.diagonal(), 0.003) << file;
  }
  ASSERT_EQ(pad("c.npz -q --format liggghts -o c.txt").output, "");
  const Ran silent = pad("c.txt -o c.xml");
  EXPECT_TRUE(holds(silent.output, "c.txt does not say its unit, so c.xml takes its lengths for metres"));
  EXPECT_EQ(pad("c.txt --unit mm -q -o c.xml").output, "");
  EXPECT_LT(read_spheres(folder_ / "c.xml").bounds.diagonal(), 0.003);
}

TEST_F(PadFormatsTest, AConversionToAnotherUnitKeepsTheSize) {
  ASSERT_EQ(pad("cube.obj --lod 10%,5% --max-radius 20% -q --unit m -o c.spheres.json").output, "");
  ASSERT_EQ(pad("c.spheres.json --unit mm -q -o mm.spheres.json -o mm.urdf").output, "");
  ASSERT_EQ(pad("c.spheres.json -q -o m.urdf").output, "");
  EXPECT_TRUE(holds(pad("c.spheres.json -o m.xml").output, "levels of detail are left out of m.xml"));
  const Cluster m = read_spheres(folder_ / "c.spheres.json"), mm = read_spheres(folder_ / "mm.spheres.json");
  EXPECT_EQ(mm.unit, "mm");
  EXPECT_NEAR(mm.bounds.diagonal(), 1000 * m.bounds.diagonal(), 1e-9);
  EXPECT_NEAR(mm.mass.volume, 1e9, 1);
  const auto settings = nlohmann::json::parse(m.settings), longer = nlohmann::json::parse(mm.settings);
  EXPECT_NEAR(longer["lod"][1], 1000 * settings["lod"][1].get<double>(), 1e-9);
  EXPECT_NEAR(longer["max_radius"], 1000 * settings["max_radius"].get<double>(), 1e-9);
  EXPECT_NEAR(mm.lods[0].tolerance, 1000 * m.lods[0].tolerance, 1e-9);
  EXPECT_EQ(longer["effort"], settings["effort"]);
  expect_same_spheres(read_spheres(folder_ / "mm.urdf"), read_spheres(folder_ / "m.urdf"), 1e-15);
  ASSERT_EQ(pad("c.spheres.json --unit in --scale 2 -q -o in.spheres.json").output, "");
  EXPECT_NEAR(read_spheres(folder_ / "in.spheres.json").bounds.diagonal(), 2 * m.bounds.diagonal() / 0.0254,
              1e-9);
}

TEST_F(PadFormatsTest, AConversionChangesFamilyAndMaskToNone) {
  ASSERT_EQ(pad("cube.obj --edge-length 10% --family 3 --mask 4 -q -o c.spheres.json").output, "");
  const Ran full = pad("c.spheres.json -q -o c.urdf");
  EXPECT_TRUE(holds(full.output, "take family 0 and mask 0 (--family 0 --mask 0)"));
  ASSERT_EQ(pad("c.spheres.json --mask 0 -q -o d.spheres.json").output, "");
  EXPECT_EQ(read_spheres(folder_ / "d.spheres.json").family, 3u);
  EXPECT_EQ(read_spheres(folder_ / "d.spheres.json").mask, 0u);
  EXPECT_EQ(pad("c.spheres.json --family 0 --mask 0 -q -o c.urdf").output, "");
}

TEST_F(PadFormatsTest, AConversionIntoAFolderKeepsTheName) {
  ASSERT_EQ(pad("cube.obj --edge-length 10% -q -o c.spheres.json").output, "");
  ASSERT_EQ(pad("c.spheres.json cube.obj --edge-length 10% -q -o d/").status, 2);
  ASSERT_EQ(pad("c.spheres.json cube.obj -q -o d/").output, "");
  EXPECT_TRUE(fs::exists(folder_ / "d/c.spheres.json"));
}

TEST_F(PadFormatsTest, ARobotOfOneLinkHasNoFamily) {
  ASSERT_EQ(pad("cube.obj --unit m --edge-length 10% -q -o c.urdf").output, "");
  ASSERT_EQ(pad("c.urdf -q -o links/").output, "");
  EXPECT_EQ(read_spheres(folder_ / "links/cube.spheres.json").family, 0u);
  EXPECT_EQ(pad("c.urdf -q --format liggghts -o c.txt").output, "");
}

TEST_F(PadFormatsTest, WhatAConversionLeavesOutIsSaid) {
  ASSERT_EQ(pad("r.urdf --tolerance 10% -q -o r.yaml -o r.srdf").output, "");
  EXPECT_EQ(pad("r.yaml -q -o s.srdf").output, "");
  EXPECT_TRUE(holds(read_file(folder_ / "s.srdf"), "link1=\"a\" link2=\"b\""));
  const Ran r = pad("r.srdf -o s.xrdf");
  EXPECT_TRUE(
      holds(r.output, "the joints, the base and the tool of r.srdf are not read: set them in s.xrdf"));
}

TEST_F(PadFormatsTest, WhatCannotBeReadIsTheCause) {
  const auto included = [&](const std::string& name) {
    write_file(folder_ / "m.xml", "<mujoco><include file='" + name + "'/></mujoco>");
    return pad("m.xml -o o.urdf").output;
  };
  EXPECT_EQ(included("nothere.xml"),
            "pad: m.xml, <include>: cannot open nothere.xml: check the name and that it may be read\n");
  EXPECT_EQ(included("m.xml"), "pad: m.xml, <include>: the file m.xml is included twice\n");
  std::string nested = "<mujoco>";
  for (int k = 0; k < 100; k++) nested += "<default class='a'>";
  for (int k = 0; k < 100; k++) nested += "</default>";
  write_file(folder_ / "nested.xml", nested + "</mujoco>");
  EXPECT_EQ(pad("nested.xml -o o.urdf --memory 1G --seconds 20").output,
            "pad: nested.xml, <default>: there is a class \"a\" already\n");
  write_file(folder_ / "cut.xml", "<mujoco><worldbody><geom type='box' si");
  EXPECT_TRUE(pad("cut.xml --tolerance 2%").output.starts_with("pad: cut.xml: not XML at byte "));
  for (const std::string absent : {"absent.xml", "absent.yaml"})
    EXPECT_EQ(pad(absent + " --tolerance 2%").output,
              "pad: cannot open " + absent + ": check the name and that it may be read\n");
}

TEST_F(PadFormatsTest, ARobotThatContradictsItselfIsASentence) {
  const auto joints = [&](const std::string& inside, const std::string& more) {
    write_file(
        folder_ / "j.urdf",
        "<robot name='r'><link name='a'><collision><geometry><sphere radius='0.5'/></geometry></collision>"
        "</link><link name='b'/><link name='c'/>"
        "<joint name='j' type='revolute'><parent link='a'/><child link='b'/><limit lower='-1' upper='1'/>" +
            inside + "</joint><joint name='k' type='prismatic'><parent link='a'/><child link='c'/>" +
            "<mimic joint='j'/></joint></robot>");
    return pad("j.urdf -q -o o.urdf " + more).output;
  };
  EXPECT_EQ(joints("", "--joint j=1"), "");
  EXPECT_EQ(joints("<mimic joint='k'/>", ""),
            "pad: j.urdf: joint j: the joints that it mimics go round in a circle at j\n");
  EXPECT_EQ(joints("", "--joint j=99"), "pad: j.urdf: --joint j: its limits are from -1 to 1 radians\n");
  EXPECT_EQ(joints("", "--joint k=0"), "pad: j.urdf: --joint k: it follows the joint j: place that one\n");
  write_file(folder_ / "l.urdf",
             "<robot name='r'><link name='a b'/><link name='s/t'><visual><geometry><sphere radius='1'/>"
             "</geometry></visual></link><link name='s_t'><visual><geometry><sphere radius='1'/></geometry>"
             "</visual></link><joint name='j' type='fixed'><parent link='a b'/><child link='s/t'/></joint>"
             "<joint name='k' type='fixed'><parent link='a b'/><child link='s_t'/></joint></robot>");
  EXPECT_EQ(pad("l.urdf -o links/").output,
            "pad: link s_t of l.urdf and link s/t of l.urdf would both write links/s_t.spheres.json: name "
            "another file\n");
  const auto point = [&](const std::string& shape) {
    write_file(folder_ / "p.urdf", "<robot name='r'><link name='a'><collision><geometry><" + shape +
                                       "/></geometry></collision></link></robot>");
    return pad("p.urdf").output;
  };
  EXPECT_EQ(
      point("sphere radius='0'"),
      "pad: p.urdf: no link has any geometry (a: a sphere of radius 0, which is a point, was left out)\n");
  EXPECT_EQ(point("box size='0 0 0'"),
            "pad: p.urdf: no link has any geometry (a: a box of size 0, which is a point, was left out)\n");
  EXPECT_EQ(point("box size='0 1 1'"), "pad: p.urdf: link a: a box has no positive size\n");
  EXPECT_EQ(point("box"), "pad: p.urdf: link a: a box has no positive size\n");
}

TEST_F(PadFormatsTest, WhatAFormatCannotHoldIsASentenceAndNoFile) {
  const Ran r = pad("cube.obj --edge-length 10% --family 3 -q -o c.csv");
  EXPECT_EQ(r.status, 1);
  EXPECT_TRUE(holds(r.output, "cannot hold"));
  EXPECT_EQ(std::count(r.output.begin(), r.output.end(), '\n'), 1);
  EXPECT_FALSE(fs::exists(folder_ / "c.csv"));
  EXPECT_EQ(pad("cube.obj -o c.xyz").status, 2);
  EXPECT_EQ(pad("cube.obj -o cube.obj").status, 2);  // which would be the end of the mesh
  EXPECT_EQ(pad("cube.obj --format povray").status, 2);
  EXPECT_EQ(pad("r.urdf -o r.spheres.json").status, 2);
  EXPECT_EQ(pad("cube.obj --density 0 -o c.csv").status, 2);
}

// Before it is covered: at this tolerance that takes longer than it is given here.
TEST_F(PadFormatsTest, ASheetIsRefusedAtOnceWhereAMassIsWanted) {
  write_file(folder_ / "sheet.obj",
             "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 1 1 1\nf 1 2 3\nf 1 2 4\nf 3 4 5\n");
  for (const char* output : {"-o s.csv", "-o s.json -o s.csv", "--format chrono -o s.h"}) {
    const Ran r = pad(std::string("sheet.obj --tolerance 0.05% --seconds 10 -q ") + output);
    EXPECT_EQ(r.status, 1);
    EXPECT_TRUE(holds(r.output, "sheet.obj: it has no volume (an open sheet), and ")) << r.output;
    EXPECT_FALSE(fs::exists(folder_ / "s.json"));
  }
}

TEST_F(PadFormatsTest, SpheresAreConvertedWithoutPadding) {
  ASSERT_EQ(pad("cube.obj --edge-length 10% -q -o c.spheres.json -o c.xml -o c.npz").output, "");
  ASSERT_EQ(pad("c.spheres.json -q -o d.xml -o d.npz -o d.yaml -o d.spheres.json").output, "");
  for (const char* file : {"xml", "npz", "spheres.json"})
    EXPECT_EQ(read_file(folder_ / (std::string("c.") + file)),
              read_file(folder_ / (std::string("d.") + file)))
        << file;
  ASSERT_EQ(pad("d.yaml -q -o e.xml --family 3").output, "");
  expect_same_spheres(read_spheres(folder_ / "e.xml"), read_spheres(folder_ / "c.xml"));
  ASSERT_EQ(pad("r.urdf --edge-length 10% -q -o r.yaml -o r.xrdf -o r.xml").output, "");
  ASSERT_EQ(pad("r.yaml -q -o s.xrdf -o s.srdf").output, "");
  expect_same_spheres(read_spheres(folder_ / "s.srdf", "a"), read_spheres(folder_ / "r.xml", "a"));
  const Ran unplaced = pad("r.yaml -q -o s.xml");
  EXPECT_EQ(unplaced.status, 1);
  EXPECT_TRUE(holds(unplaced.output, "not where the links are"));
  EXPECT_FALSE(fs::exists(folder_ / "s.xml"));
  for (const char* wrong :
       {"c.spheres.json", "c.spheres.json -o x.xml --tolerance 1%", "c.spheres.json -o x.xml --effort 2",
        "d.yaml c.npz -o many/ --format mjcf --repair fill", "c.spheres.json -o c.spheres.json",
        "cube.obj c.npz -o many/ --format mjcf --effort 2", "c.spheres.json -o x.xml --preview x.png",
        "cube.obj -o x.xml -o x.xml", "cube.obj -o x.xml -o y.foo", "r.urdf -o x.xml -o x.json"})
    EXPECT_EQ(pad(wrong).status, 2) << wrong;
  EXPECT_FALSE(fs::exists(folder_ / "x.xml"));
}

// A failure with --json is JSON on stdout, whatever is wrong.
TEST_F(PadFormatsTest, FailuresAreJson) {
  for (const char* wrong : {"absent.obj --json", "cube.obj -o c.xyz --json", "cube.obj --effort 7 --json"}) {
    const Ran r = pad(std::string(wrong) + " 2>/dev/null");
    EXPECT_NE(r.status, 0);
    const auto report = nlohmann::json::parse(r.output, nullptr, false);
    ASSERT_FALSE(report.is_discarded()) << wrong << r.output;
    EXPECT_TRUE(report.contains("input") && report["error"].is_string()) << wrong;
  }
}

// In kg where the unit of lengths is known, else in the unit of lengths cubed.
TEST_F(PadFormatsTest, AMassIsInKilogrammes) {
  for (const auto& [unit, mass] : {std::pair("", 1000.), {"--unit m", 1000.}, {"--unit mm", 1e-6}}) {
    const Ran r = pad("cube.obj --edge-length 10% --json " + std::string(unit) + " 2>/dev/null");
    EXPECT_NEAR(nlohmann::json::parse(r.output)["mass"].get<double>(), mass, 1e-6 * mass) << unit;
  }
}

TEST_F(PadFormatsTest, ARobotIsReadOnce) {
  write_file(folder_ / "xacro", "#!/bin/sh\necho read >> reads\ncat \"$1\"\n");
  fs::permissions(folder_ / "xacro", fs::perms::owner_all);
  fs::rename(folder_ / "r.urdf", folder_ / "r.xacro");
  EXPECT_EQ(pad("r.xacro --edge-length 10% -q -o all/", "PATH=\"$PWD:$PATH\"").output, "");
  EXPECT_EQ(read_file(folder_ / "reads"), "read\n");
  fs::remove(folder_ / "reads"), write_file(folder_ / "list", "r.xacro --edge-length 10%\n");
  EXPECT_EQ(pad("--manifest list -q -o all/", "PATH=\"$PWD:$PATH\"").output, "");
  EXPECT_EQ(read_file(folder_ / "reads"), "read\nread\n");  // once more for the list, in another process
}

// The .srdf that a URDF brings along lists pairs alone; one that is asked for has the spheres, too.
TEST_F(PadFormatsTest, AnSrdfThatIsAskedForIsNotLostToThatOfAUrdf) {
  ASSERT_EQ(pad("r.urdf --edge-length 10% -q -o p.srdf").output, "");
  ASSERT_EQ(pad("r.urdf --edge-length 10% -q -o q.srdf -o q.urdf").output, "");
  EXPECT_EQ(read_file(folder_ / "q.srdf"), read_file(folder_ / "p.srdf"));
  ASSERT_EQ(pad("r.urdf --edge-length 10% -q -o p.npz").output, "");
  ASSERT_EQ(pad("p.npz -q -o s.srdf").output, "");
  ASSERT_EQ(pad("p.npz -q -o t.srdf -o t.urdf").output, "");
  EXPECT_TRUE(holds(read_file(folder_ / "t.srdf"), "link_sphere_approximation"));
  EXPECT_EQ(read_file(folder_ / "t.srdf"), read_file(folder_ / "s.srdf"));
}

TEST_F(PadFormatsTest, Robots) {
  const Ran r = pad("r.urdf --edge-length 10% --json 2>/dev/null");
  ASSERT_EQ(r.status, 0) << r.output;
  const auto report = nlohmann::json::parse(r.output);
  EXPECT_EQ(report["links"].size(), 2u);
  EXPECT_EQ(report["links"][1]["spheres"], 1);
  EXPECT_TRUE(report["links"][1]["accuracy"].is_null());  // it was a sphere: there is nothing to measure
  EXPECT_TRUE(report["links"][0]["accuracy"].is_object());
  EXPECT_EQ(report["pairs_apart"]["Adjacent"], 1);
  // A page costs less time than a picture, but needs a template that not every build has.
  const std::string shown = fs::exists(PADDER_BIN "/../page/page.html") ? "r.html" : "r.png";
  EXPECT_EQ(pad("r.urdf --robot-spheres 9 -q -o few.urdf --joint j=1.5 --preview " + shown).output, "");
  EXPECT_GT(fs::file_size(folder_ / shown), 1000u);
  const Ran unknown = pad("r.urdf -o few.urdf --preview r.png --joint elbow=1.5");
  EXPECT_EQ(unknown.status, 1);
  EXPECT_TRUE(holds(unknown.output, "no joint elbow that moves; its joints are j\n"));
  EXPECT_EQ(pad("r.urdf -o few.urdf --preview r.png --joint j").status, 2);
  EXPECT_EQ(pad("r.urdf -o few.urdf --package-path nowhere").output,
            "pad: --package-path: there is no folder \"nowhere\"\n");
  EXPECT_EQ(pad("r.urdf --format yade").output,
            "pad: cannot write r for YADE: it takes one body a file and there are 2: write each as "
            ".spheres.json (-o FOLDER/), and these one by one\n");
  EXPECT_TRUE(fs::exists(folder_ / "r.spheres.urdf"));
  EXPECT_TRUE(fs::exists(folder_ / "r.spheres.srdf"));
  EXPECT_EQ(pad("r.urdf --edge-length 10% -q -o all/").output, "");
  EXPECT_TRUE(fs::exists(folder_ / "all/r.spheres.urdf"));
  EXPECT_EQ(read_spheres(folder_ / "all/b.spheres.json").family, report["links"][1]["family"]);
  EXPECT_EQ(pad("r.urdf --edge-length 10% -q -o r.xml").output, "");
  EXPECT_EQ(read_spheres(folder_ / "r.xml", "b").radii[0], 0.5);
  EXPECT_EQ(pad("r.urdf --scale 2").status, 1);
}

}  // namespace
}  // namespace padder::samples
