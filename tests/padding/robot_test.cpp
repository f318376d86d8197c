// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/robot.h"
#include "padding/robots/urdf.h"

#include <algorithm>
#include <cstdlib>
#include <map>
#include <set>

#include "padding/asset/error.h"
#include "padding/export/families.h"
#include "padding/export/writers.h"
#include "tests/error_of.h"
#include "tests/padding/export/samples.h"
#include "tests/padding/threads.h"
#ifdef PADDER_MUJOCO
#include "tests/padding/in_mujoco.h"
#endif

namespace padder::samples {
namespace {

const PadOptions kCoarse{.edge_length = Length::share(0.08)};

class RobotTest : public ExportTest {
 protected:
  fs::path urdf(const std::string& inside, const std::string& file = "pkg/urdf/r.urdf") {
    fs::create_directories((folder_ / file).parent_path());
    write_file(folder_ / file, "<?xml version='1.0'?>\n<robot name='r'>" + inside + "</robot>");
    return folder_ / file;
  }
  Model read_and_keep_apart(const std::string& inside) {
    RobotTree u = read_urdf(urdf(inside));
    keep_neighbours_apart(u);
    return u.model;
  }
  PaddedRobot coarse(const std::string& inside) { return pad_robot(urdf(inside), kCoarse); }
};

// What is inside <geometry>, and what stands beside that.
std::string shape(const std::string& geometry, const std::string& place = "") {
  return "<collision>" + place + "<geometry>" + geometry + "</geometry></collision>";
}
std::string mesh(const std::string& file, const std::string& more = "") {
  return "<mesh filename='" + file + "'" + more + "/>";
}
const std::string kBox = shape("<box size='0.2 0.4 0.6'/>");
const std::string kBar = shape("<box size='.6 .05 .05'/>", "<origin xyz='.6 0 0'/>");
const std::string kSeven =
    "<inertial><mass value='7'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/></inertial>";
std::string ball(const std::string& radius, const std::string& place = "0 0 0") {
  return shape("<sphere radius='" + radius + "'/>", "<origin xyz='" + place + "'/>");
}
std::string link(const std::string& name, const std::string& inside = kBox) {
  return "<link name='" + name + "'>" + inside + "</link>";
}
std::string joint(
    const std::string& parent, const std::string& child, const std::string& type = "revolute",
    const std::string& inside = "<axis xyz='0 0 2'/><limit lower='-1' upper='2' effort='1' velocity='1'/>") {
  return "<joint name='" + parent + "_" + child + "' type='" + type + "'><parent link='" + parent +
         "'/><child link='" + child + "'/>" + inside + "</joint>";
}

TEST_F(RobotTest, ReadsTheTreeParentsFirst) {
  const RobotTree u = read_urdf(
      urdf(joint("b", "c") + joint("a", "b", "fixed", "<origin xyz='1 2 3' rpy='0 0 1.5707963267948966'/>") +
           link("c") + link("b", "") + link("a")));
  ASSERT_EQ(u.links.size(), 3u);
  EXPECT_EQ(u.links[0].name, "a");
  EXPECT_EQ(u.model.bodies[2].name, "c");
  EXPECT_EQ(u.model.bodies[2].parent, 1);
  EXPECT_EQ(u.model.bodies[2].joint.axis, Vector(0, 0, 1));
  EXPECT_EQ(u.model.bodies[2].joint.upper, 2);
  EXPECT_LT((u.model.bodies[1].pose * Point(1, 0, 0) - Point(1, 3, 3)).norm(), 1e-12);
}

TEST_F(RobotTest, RefusesWhatIsNoRobot) {
  const std::string ab = link("a") + link("b");
  for (const std::string& inside : {std::string(), link("a") + link("a"), ab, ab + joint("a", "x"),
                                    ab + joint("a", "b") + joint("b", "a"), ab + joint("a", "b", "glued"),
                                    ab + joint("a", "b", "revolute", "<origin xyz='0 0'/>"),
                                    ab + link("c") + joint("a", "c") + joint("b", "c"),
                                    link("a", shape("<torus/>")), link("a", shape("<box size='1 0 1'/>")),
                                    link("a", shape("<mesh filename='package://pkg/none.stl'/>")),
                                    link("a", shape("<mesh filename='none.stl'/>"))})
    EXPECT_THROW(read_urdf(urdf(inside)), Error) << inside;
  EXPECT_THROW(read_urdf(folder_ / "absent.urdf"), Error);
  EXPECT_THROW(coarse(link("a", "")), Error);
}

TEST_F(RobotTest, NeighboursAreRigidGroupsAndTheNextAboveWithShapes) {
  // base - frame (no shape) - arm; arm = tool (fixed); tool - finger1, finger2; base - leg
  RobotTree u = read_urdf(urdf(link("base") + link("frame", "") + link("arm") + link("tool") +
                               link("finger1") + link("finger2") + link("leg") + joint("base", "frame") +
                               joint("frame", "arm") + joint("arm", "tool", "fixed") +
                               joint("tool", "finger1") + joint("tool", "finger2") + joint("base", "leg")));
  std::set<std::string> names;
  for (const auto& [i, j] : neighbours(u)) names.insert(u.links[i].name + " " + u.links[j].name);
  EXPECT_EQ(names, (std::set<std::string>{"base arm", "base tool", "base leg", "arm tool", "arm finger1",
                                          "arm finger2", "tool finger1", "tool finger2"}));
  keep_neighbours_apart(u);
  EXPECT_EQ(filtered_pairs(exporting::filters_of(u.model)), neighbours(u));
}

// A free body stands on the table that its joint hangs it on, and touches it even in the first pose.
TEST_F(RobotTest, AFreeBodyMayTouchWhatItHangsOn) {
  for (const char* z : {"0.59", "5"}) {
    const PaddedRobot r =
        coarse(link("table") + link("frame", "") + link("box") + joint("table", "frame", "continuous") +
               joint("frame", "box", "floating", "<origin xyz='0 0 " + std::string(z) + "'/>"));
    EXPECT_TRUE(r.model.apart.empty()) << z;
    EXPECT_EQ(r.model.bodies[2].cluster.mask, 0u);
  }
  for (const char* type : {"planar", "spherical"})
    EXPECT_EQ(neighbours(read_urdf(urdf(link("a") + link("b") + joint("a", "b", type, "")))).size(), 1u)
        << type;
}

// The other bar may turn into the first one, which has no limits: crossed ones and none are the same.
TEST_F(RobotTest, JointsWithoutLimitsTurnAllTheWay) {
  const std::string turn = "<origin rpy='0 0 1.6'/><axis xyz='0 0 1'/>";
  for (const std::string limit : {"", "<limit lower='3' upper='-3'/>", "<limit lower='-3' upper='3'/>"}) {
    const PaddedRobot r = coarse(link("a") + link("b", kBar) + link("c", kBar) +
                                 joint("a", "b", "revolute", "<axis xyz='0 0 1'/>" + limit) +
                                 joint("a", "c", "revolute", turn + "<limit lower='0' upper='.1'/>"));
    for (const Apart& p : r.model.apart) EXPECT_EQ(p.reason, "Adjacent") << limit;
  }
}

// No random place of a slide without limits says anything, nor of one that follows it.
TEST_F(RobotTest, SlidesWithoutLimitsLeavePairsUndecided) {
  const auto reasons = [&](const std::string& limit) {
    std::set<std::string> out;
    const PaddedRobot r = coarse(
        link("a") + link("b") + link("c") + joint("a", "b", "prismatic", "<origin xyz='3 0 0'/>" + limit) +
        joint("a", "c", "prismatic",
              "<origin xyz='-3 0 0'/><limit lower='0' upper='1'/><mimic joint='a_b' multiplier='-1'/>"));
    for (const Apart& p : r.model.apart) out.insert(p.reason);
    return out;
  };
  EXPECT_EQ(reasons("<limit lower='0' upper='1'/>"), (std::set<std::string>{"Adjacent", "Never"}));
  EXPECT_EQ(reasons(""), std::set<std::string>{"Adjacent"});
}

// At 0, which is beyond the limits of the first one, the bars are one in the other.
TEST_F(RobotTest, TheFirstPoseIsWithinTheLimits) {
  const PaddedRobot r =
      coarse(link("a") + link("b", kBar) + link("c", kBar) +
             joint("a", "b", "revolute", "<axis xyz='0 0 1'/><limit lower='.5' upper='3'/>") +
             joint("a", "c", "revolute", "<axis xyz='0 0 1'/><limit lower='-3' upper='3'/>"));
  for (const Apart& p : r.model.apart) EXPECT_EQ(p.reason, "Adjacent");
  EXPECT_TRUE(holds(text(r.model, "r.xml"), "ref=\"1.75\""));
}

// Equal limits lock a joint. <limit> without them means 0 and 0 in URDF.
TEST_F(RobotTest, EqualLimitsLockAJoint) {
  for (const std::string limit : {"lower='1.6' upper='1.6' ", ""}) {
    const bool turned = !limit.empty();
    const PaddedRobot r = coarse(
        link("a") + link("b", kBar) + link("c", kBar) +
        joint("a", "b", "revolute", "<axis xyz='0 0 1'/><limit " + limit + "effort='1' velocity='1'/>") +
        joint("a", "c", "revolute",
              std::string("<origin rpy='0 0 ") + (turned ? "0" : "1.6") +
                  "'/><axis xyz='0 0 1'/><limit lower='0' upper='.1'/>"));
    ASSERT_EQ(r.model.apart.size(), 3u);
    EXPECT_EQ(r.model.apart.back().reason, "Never") << limit;
    EXPECT_EQ(r.notes.size(), 1u);
    EXPECT_TRUE(holds(r.notes.back(), "only one place: a_b"));
    const std::string xml = text(r.model, "r.xml"), yaml = text(r.model, "r.yaml"),
                      usd = text(r.model, "r.usda");
    EXPECT_EQ(xml.find("\"a_b\""), std::string::npos) << xml;
    EXPECT_EQ(xml.find("<body name=\"b\" quat=") != std::string::npos, turned) << xml;
    EXPECT_EQ(yaml.find("\"a_b\""), std::string::npos) << yaml;
    EXPECT_TRUE(holds(usd, "physics:lowerLimit = " + std::string(turned ? "91.67" : "0\n")));
  }
}

// 40 pairs of parts around a body, each with a part of its own: no 32 families keep all neighbours apart.
TEST_F(RobotTest, MoreMovingPartsThanFamiliesAreListedAsPairs) {
  std::string inside = link("base", ball("0.1"));
  for (int k = 0; k < 40; k++) {
    const std::string a = "a" + std::to_string(k), b = "b" + std::to_string(k);
    inside += link(a, ball("0.1")) + link(b, ball("0.1")) + joint("base", a) + joint(a, b);
  }
  const PaddedRobot r = coarse(inside);
  EXPECT_EQ(std::ranges::count_if(r.model.apart, [](const Apart& p) { return p.reason == "Adjacent"; }), 80);
  for (const Body& b : r.model.bodies) EXPECT_EQ(b.cluster.family, 0u);
  for (const char* file : {"r.xml", "r.srdf"}) {
    const std::string out = text(r.model, file);
    EXPECT_TRUE(holds(out, "\"a39\"")) << file;
  }
  EXPECT_THROW(check_filters(read_and_keep_apart(inside), find_format({}, "chrono")), Error);
}

// The oracle tests every sphere of one link against every sphere of another, in poses of its own.
TEST_F(RobotTest, LinksThatNeverOrAlwaysTouchAreFound) {
  const std::string turn =
      "<origin xyz='0 0 1'/><axis xyz='0 1 0'/><limit lower='-3' upper='3' effort='1' velocity='1'/>";
  const fs::path file =
      urdf(link("base", ball("0.2")) + link("upper", ball("0.2", "0 0 0.5")) +
           link("fore", ball("0.2", "0 0 0.9")) + link("mount", "") + link("ring", ball("1.3")) +
           link("far", ball("0.1")) + joint("base", "upper", "revolute", turn) +
           joint("upper", "fore", "revolute", turn) + joint("base", "mount", "revolute", turn) +
           joint("mount", "ring", "revolute", turn) +
           joint("base", "far", "prismatic", "<origin xyz='9 0 0'/><limit lower='0' upper='1'/>"));
  const PaddedRobot r = pad_robot(file, kCoarse);
  std::map<std::string, std::string> found;
  for (const Apart& p : r.model.apart)
    found[r.model.bodies[p.a].name + " " + r.model.bodies[p.b].name] = p.reason;
  EXPECT_EQ(found["base upper"], "Adjacent");
  EXPECT_EQ(found["base ring"], "Adjacent");  // mount has no shapes
  EXPECT_EQ(found["base far"], "Adjacent");
  for (const char* pair : {"upper far", "fore far", "ring far"}) EXPECT_EQ(found[pair], "Never") << pair;
  EXPECT_EQ(found["upper ring"], "Default");  // the ring is around all of the upper arm
  EXPECT_FALSE(found.contains("base fore"));  // the fore arm reaches back to the base in some poses
  const auto base = 0u, fore = 2u;
  bool seen = false;
  for (double a = -3; a < 3 && !seen; a += 0.05)
    for (double b = -3; b < 3; b += 0.05) {
      const auto poses = poses_at(r.model, {0, a, b, 0, 0, 0});
      seen |= (poses[base] * r.model.bodies[base].cluster.centers[0] -
               poses[fore] * r.model.bodies[fore].cluster.centers[0])
                  .norm() < 0.4;
    }
  EXPECT_TRUE(seen);
  const PaddedRobot none = pad_robot(file, kCoarse, {.reading = {}, .max_spheres = 0, .poses = 0});
  for (const Apart& p : none.model.apart) EXPECT_TRUE(p.reason == "Adjacent" || p.reason == "Default");
}

// What no pose with such a joint at 0 shows is not said to happen never.
TEST_F(RobotTest, JointsWithSeveralWaysToMoveLeavePairsUndecided) {
  for (const char* type : {"continuous", "spherical", "floating", "planar"}) {
    const std::string below = ball("0.2", "0 0 -0.5");
    const PaddedRobot r =
        coarse(link("base", below) + link("upper", below) + link("fore", below) +
               joint("base", "upper", type, "<origin xyz='0 0 1'/><axis xyz='0 1 0'/>") +
               joint("upper", "fore", "continuous", "<origin xyz='0 0 1'/><axis xyz='0 0 1'/>"));
    const bool never = std::ranges::any_of(r.model.apart, [](const Apart& p) { return p.reason == "Never"; });
    EXPECT_EQ(never, std::string(type) == "continuous") << type;
  }
}

TEST_F(RobotTest, PosesFollowJointsAndMimics) {
  Model m = arm();
  m.bodies[4].joint.mimic = "upper_joint", m.bodies[4].joint.multiplier = 0.5, m.bodies[4].joint.offset = 0.1;
  const auto poses = poses_at(m, {0, 0.7, 0, 0, 99});
  const Eigen::Isometry3d upper = m.bodies[1].pose * Eigen::AngleAxisd(0.7, Vector::UnitY());
  EXPECT_TRUE(poses[1].isApprox(upper));
  const Eigen::Isometry3d hand = upper * m.bodies[2].pose * m.bodies[3].pose;
  EXPECT_TRUE(poses[4].isApprox(hand * m.bodies[4].pose * Eigen::Translation3d(0, 0.45, 0)));
}

TEST_F(RobotTest, ACapsuleIsACylinderWithRoundEnds) {
  const PaddedRobot r = coarse(link("a", shape("<capsule radius='0.1' length='0.5'/>")));
  const Cluster& c = r.model.bodies[0].cluster;
  EXPECT_NEAR(c.mass.volume, std::numbers::pi * (0.005 + 4 / 3. * 0.001), 2e-4);
  EXPECT_NEAR(c.bounds.high.z(), 0.35, 1e-9);
  EXPECT_NEAR(c.bounds.high.x(), 0.1, 1e-3);
  EXPECT_GT(c.accuracy.volume_ratio, 0.9);
}

TEST_F(RobotTest, PackagesAreFoundByTheirNames) {
  const auto meshes = [&](const std::string& folder) {
    fs::create_directories(folder_ / folder / "meshes");
    write_file(folder_ / folder / "meshes/tet.obj", kTet);
  };
  const auto package = [&](const std::string& folder, const std::string& name) {
    meshes(folder);
    write_file(folder_ / folder / "package.xml", "<package format='3'><name>" + name + "</name></package>");
  };
  const auto found = [&](const std::string& name, RobotReadOptions options = {}) {
    const fs::path file =
        urdf(link("a", shape(mesh("package://" + name + "/meshes/tet.obj"))), "ws/robot/urdf/r.urdf");
    return fs::relative(read_urdf(file, options).links[0].shapes[0].file, folder_);
  };
  package("ws/robot", "robot_description");  // its own package, whose folder has another name
  package("ws/arm-1.2", "arm_description");  // one beside it
  meshes("install/share/tool_description");  // of ROS 2
  package("else/gripper-main", "gripper");
  package("ws/robot/urdf/parts-2", "parts");  // beside the URDF, and beside its folder
  package("ws/robot/tools", "tools_description");
  package("ws/arm%20 2", "a%20 2_description");
  EXPECT_EQ(found("a%2520%202_description"), "ws/arm%20 2/meshes/tet.obj");
  EXPECT_EQ(found("a%20 2_description"), "ws/arm%20 2/meshes/tet.obj");  // as it should not be written
  EXPECT_EQ(found("robot_description"), "ws/robot/meshes/tet.obj");
  EXPECT_EQ(found("arm_description"), "ws/arm-1.2/meshes/tet.obj");
  EXPECT_EQ(found("parts"), "ws/robot/urdf/parts-2/meshes/tet.obj");
  EXPECT_EQ(found("tools_description"), "ws/robot/tools/meshes/tet.obj");
  EXPECT_THROW(found("tool_description"), Error);
  setenv("AMENT_PREFIX_PATH", ("/nowhere:" + (folder_ / "install").string()).c_str(), 1);
  EXPECT_EQ(found("tool_description"), "install/share/tool_description/meshes/tet.obj");
  unsetenv("AMENT_PREFIX_PATH");
  EXPECT_THROW(found("gripper"), Error);
  EXPECT_EQ(found("gripper", {.package_folders = {folder_ / "else"}, .visual = false}),
            "else/gripper-main/meshes/tet.obj");
  package("deep/ws/src/repository/hand-1", "hand");
  meshes("deep/ws/src/foot");
  package("deep/other/inner", "inner");
  package("deep/other", "other");
  const RobotReadOptions deep{.package_folders = {folder_ / "deep"}};
  EXPECT_EQ(found("hand", deep), "deep/ws/src/repository/hand-1/meshes/tet.obj");
  EXPECT_EQ(found("foot", deep), "deep/ws/src/foot/meshes/tet.obj");
  EXPECT_THROW(found("inner", deep), Error);
}

TEST_F(RobotTest, AMeshIsFoundHoweverItIsWritten) {
  fs::create_directories(folder_ / "pkg/meshes");
  write_file(folder_ / "pkg/meshes/Tet.obj", "v 0 0 0\n");
  const auto read = [&](const std::string& name) {
    const RobotTree u = read_urdf(urdf(link("a", shape(mesh(name)))));
    return fs::relative(u.links[0].shapes[0].file, folder_).lexically_normal();
  };
  const std::string absolute = (folder_ / "pkg/meshes/Tet.obj").string();
  for (const std::string& name :
       {std::string("..\\meshes\\Tet.obj"), std::string("package://pkg\\meshes\\Tet.obj"),
        std::string("package:///pkg/meshes/Tet.obj"), std::string("file://$(find pkg)/meshes/Tet.obj"),
        std::string("$(find pkg)/meshes/Tet.obj"), "file://localhost" + absolute, "file://" + absolute,
        std::string("file://../meshes/Tet.obj"), std::string("pkg/meshes/Tet.obj")})
    EXPECT_EQ(read(name), "pkg/meshes/Tet.obj") << name;
  for (const std::string name : {"package://pkg/meshes/TET.obj", "../Meshes/tet.obj", "..\\meshes\\tet.OBJ"})
    EXPECT_TRUE(refuses([&] { read(name); }, "pkg/meshes/Tet.obj is there: write the name with")) << name;
  EXPECT_EQ(error_of([&] { read("../meshes/box.obj"); }).find("is there"), std::string::npos);
  EXPECT_TRUE(refuses([&] { read("../meshes"); }, "it is a folder"));
  EXPECT_TRUE(refuses([&] { read(""); }, "link a: its <mesh> has no filename"));
}

// One tolerance for all links, found for a number of spheres; and the same spheres for any number of threads.
TEST_F(RobotTest, ANumberOfSpheresForTheWholeRobot) {
  const fs::path file = urdf(link("a") + link("b", shape("<box size='0.1 0.1 0.1'/>")) + link("c") +
                             joint("a", "b") + joint("b", "c"));
  const auto padded = [&] { return pad_robot(file, {}, {.reading = {}, .max_spheres = 60, .poses = 0}); };
  const PaddedRobot r = padded();
  EXPECT_LE(r.model.spheres(), 60u);
  EXPECT_GE(r.model.spheres(), 40u);
  for (const Body& b : r.model.bodies) {
    EXPECT_LE(b.cluster.accuracy.gap_max, r.tolerance * (1 + 1e-9));
    EXPECT_LE(b.cluster.accuracy.protrusion_max, r.tolerance * (1 + 1e-9));
  }
  EXPECT_LT(r.model.bodies[1].cluster.size(), r.model.bodies[0].cluster.size());
  const PaddedRobot again = with_threads(5, padded);
  for (std::size_t k = 0; k < 3; k++)
    EXPECT_EQ(to_json(again.model.bodies[k].cluster), to_json(r.model.bodies[k].cluster));
  EXPECT_THROW(pad_robot(file, {}, {.reading = {}, .max_spheres = 2, .poses = 0}), Error);
}

TEST_F(RobotTest, ASphereInsideABoxIsNoCavityOfIt) {
  const PaddedRobot r =
      pad_robot(urdf(link("a") + link("b", kBox + ball("0.08", "0 0.05 0.1")) + joint("a", "b")),
                {.tolerance = Length::share(0.05), .effort = 0}, {.poses = 0});
  const Cluster &box = r.model.bodies[0].cluster, &both = r.model.bodies[1].cluster;
  EXPECT_NEAR(both.mass.volume, 0.2 * 0.4 * 0.6, 1e-12);
  EXPECT_NEAR(both.volume_union, box.volume_union, 0.01 * box.volume_union);
  EXPECT_EQ(r.reports[1].steps.cavities, 0u);
  EXPECT_TRUE(both.accuracy.certified);
}

// The union of the shapes is the link, whatever they are. A cavity of a mesh stays one.
TEST_F(RobotTest, AShapeInsideAMeshIsNoCavityOfIt) {
  const auto box = [](double half, bool inward) {
    std::string points, faces;
    for (int k = 0; k < 8; k++)
      points += "v " + std::to_string(k & 1 ? half : -half) + " " + std::to_string(k & 2 ? half : -half) +
                " " + std::to_string(k & 4 ? half : -half) + "\n";
    const int quads[6][4] = {{1, 3, 4, 2}, {5, 6, 8, 7}, {1, 2, 6, 5},
                             {3, 7, 8, 4}, {1, 5, 7, 3}, {2, 4, 8, 6}};
    for (const auto& q : quads) {
      faces += "f";
      for (int k = 0; k < 4; k++) faces += " " + std::to_string(q[inward ? 3 - k : k] - 9);
      faces += "\n";
    }
    return points + faces;
  };
  fs::create_directories(folder_ / "pkg/urdf");
  write_file(folder_ / "pkg/urdf/box.obj", box(0.5, false));
  write_file(folder_ / "pkg/urdf/room.obj", box(0.5, false) + box(0.4, true));
  const auto volume = [&](const std::string& outer, const std::string& inside) {
    const fs::path file = urdf(link("a", shape(mesh(outer)) + shape(inside)));
    return pad_robot(file, {.tolerance = Length::share(0.05), .effort = 0}, {.poses = 0})
        .model.bodies[0]
        .cluster.mass.volume;
  };
  EXPECT_NEAR(volume("box.obj", "<box size='.6 .6 .6'/>"), 1, 1e-9);
  EXPECT_NEAR(volume("box.obj", "<mesh filename='box.obj' scale='.5 .5 .5'/>"), 1, 1e-9);
  EXPECT_NEAR(volume("room.obj", "<box size='.1 .1 2'/>"), 1 - 0.512 + 0.008 + 0.01, 1e-9);
}

TEST_F(RobotTest, WhatAnInertialLacksFollowsFromTheShape) {
  for (const std::string inside : {"<density value='3'/>", "<inertia ixx='1' iyy='1' izz='1'/>"}) {
    const PaddedRobot r = coarse(link("a", "<inertial>" + inside + "</inertial>" + kBox));
    EXPECT_FALSE(r.model.bodies[0].inertial) << inside;
    ASSERT_EQ(r.notes.size(), 1u);
    EXPECT_TRUE(holds(r.notes[0], "lacks <mass>"));
    EXPECT_TRUE(read_urdf(write(r.model, "o.urdf")).model.bodies[0].inertial) << inside;
  }
  for (const std::string inside : {"<mass value='2'/>", "<mass value='2'/><inertia ixx='1'/>"}) {
    const PaddedRobot r = coarse(link("a", "<inertial>" + inside + "</inertial>" + kBox));
    ASSERT_EQ(r.notes.size(), 1u);
    EXPECT_TRUE(holds(r.notes[0], "lacks the moments"));
    const MassProperties& solid = r.model.bodies[0].cluster.mass;
    for (const auto& i :
         {r.model.bodies[0].inertial, read_urdf(write(r.model, "o.urdf")).model.bodies[0].inertial}) {
      ASSERT_TRUE(i) << inside;
      EXPECT_EQ(i->mass, 2) << inside;
      EXPECT_NEAR(i->inertia(0, 0), 2 / solid.volume * solid.inertia(0, 0), 1e-6) << inside;
    }
  }
  EXPECT_TRUE(refuses(
      [&] {
        read_urdf(
            urdf(link("a", "<inertial><mass value='x'/><inertia ixx='1' iyy='1' izz='1'/></inertial>")));
      },
      "link a, <mass>: value wants a number"));
}

// What a link has does not depend on whether another one has it, too.
TEST_F(RobotTest, LinksWithTheSameShapesGetTheSameSpheres) {
  const PaddedRobot one = coarse(link("b"));
  const PaddedRobot r =
      coarse(link("a") + link("b", kSeven + kBox) + link("c") + joint("a", "b") + joint("b", "c"));
  for (const Body& b : r.model.bodies) {
    expect_same_spheres(b.cluster, one.model.bodies[0].cluster);
    EXPECT_EQ(b.cluster.source.file, "r.urdf, link " + b.name);
    EXPECT_EQ(b.cluster.name, b.name);
  }
  EXPECT_EQ(r.model.bodies[1].inertial->mass, 7);
  EXPECT_NE(r.model.bodies[0].cluster.family, r.model.bodies[1].cluster.family);
  EXPECT_GT(r.reports[0].seconds.total() + r.reports[1].seconds.total() + r.reports[2].seconds.total(), 0);
}

TEST_F(RobotTest, SpheresOfNoRadiusAreLeftOut) {
  const PaddedRobot r =
      coarse(link("a", ball("0.0") + ball("0.1")) + link("b", ball("0.0")) + joint("a", "b"));
  EXPECT_EQ(r.model.spheres(), 1u);
  EXPECT_EQ(r.notes.size(), 3u);
  EXPECT_THROW(read_urdf(urdf(link("a", ball("-1")))), Error);
}

TEST_F(RobotTest, SpheresStayAndAreNotMeasured) {
  const std::string seen = "<visual><geometry><box size='1 1 1'/></geometry></visual>";
  const PaddedRobot r = coarse(link("a", ball("0.1") + seen));
  EXPECT_EQ(r.kept[0], 1);
  EXPECT_EQ(r.model.spheres(), 1u);
  ASSERT_EQ(r.notes.size(), 1u);
  EXPECT_TRUE(holds(r.notes[0], "not measured"));
  const PaddedRobot again = pad_robot(urdf(link("a", ball("0.1") + seen)), kCoarse,
                                      {.reading = {.package_folders = {}, .visual = true}});
  EXPECT_EQ(again.kept[0], 0);
  EXPECT_NEAR(again.model.bodies[0].cluster.mass.volume, 1, 1e-6);
}

TEST_F(RobotTest, AXacroFileIsExpandedOrTheProgramIsNamed) {
  const fs::path file = urdf(link("a"), "r.urdf");
  fs::rename(file, folder_ / "r.xacro");
  fs::create_directories(folder_ / "bin");
  const std::string path = std::getenv("PATH");
  setenv("PATH", ((folder_ / "bin").string() + ":/usr/bin:/bin").c_str(), 1);
  if (!have("xacro")) {
    EXPECT_TRUE(refuses([&] { read_urdf(folder_ / "r.xacro"); }, "the program xacro"));
  }
  write_file(folder_ / "bin/xacro", "#!/bin/sh\ncat \"$1\"\n");  // what is left to expand is nothing
  fs::permissions(folder_ / "bin/xacro", fs::perms::owner_all);
  EXPECT_EQ(read_urdf(folder_ / "r.xacro").links.size(), 1u);
  write_file(folder_ / "bin/xacro", "#!/bin/sh\nsed \"s/name='a'/name='$2'/\" \"$1\"\n");
  fs::permissions(folder_ / "bin/xacro", fs::perms::owner_all);
  EXPECT_EQ(read_urdf(folder_ / "r.xacro", {.package_folders = {}, .xacro = {"b c;$(x)"}}).links[0].name,
            "b c;$(x)");
  setenv("PATH", path.c_str(), 1);
}

// Written back as the UTF-8 that its declaration then says. Numbers may have a sign and blanks around them.
TEST_F(RobotTest, AUrdfInAnotherEncodingIsWrittenBack) {
  write_file(folder_ / "latin.urdf",
             "<?xml version='1.0' encoding='ISO-8859-1'?><robot name='r'><link name='t\xe4st'><collision>"
             "<geometry><sphere radius=' +0.1 '/></geometry></collision></link></robot>");
  const PaddedRobot r = pad_robot(folder_ / "latin.urdf", {});
  const std::string written = text(r.model, "out.urdf");
  EXPECT_NE(written.find("encoding=\"UTF-8\""), written.npos) << written;
  EXPECT_EQ(read_urdf(folder_ / "out.urdf").links[0].name, "t\xc3\xa4st");
}

TEST_F(RobotTest, MimicEffortDampingAndFriction) {
  const std::string ab = link("a") + link("b") + link("c") + joint("a", "b");
  const RobotTree u =
      read_urdf(urdf(ab + joint("a", "c", "prismatic",
                                "<limit lower='-1' upper='2' effort='20' velocity='1'/><dynamics damping='3' "
                                "friction='0.5'/><mimic joint='a_b' multiplier='-1' offset='0.1'/>")));
  const Joint& j = u.model.bodies[2].joint;
  EXPECT_EQ(j.effort, 20);
  EXPECT_EQ(j.damping, 3);
  EXPECT_EQ(j.friction, 0.5);
  EXPECT_EQ(j.mimic, "a_b");
  EXPECT_EQ(j.multiplier, -1);
  EXPECT_EQ(j.offset, 0.1);
  EXPECT_TRUE(u.notes.empty());
  const auto notes = read_urdf(urdf(ab + joint("a", "c", "prismatic", "<limit lower='3' upper='2'/>"))).notes;
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_TRUE(holds(notes[0], "are taken to have no limits: a_c"));
}

TEST_F(RobotTest, WhatIsWrongIsNamed) {
  const auto faulty = [&](const std::string& elements, const std::string& words) {
    EXPECT_TRUE(refuses([&] { read_urdf(urdf(elements)); }, words)) << words;
  };
  faulty(link("a") + joint("world", "a"), "its parent \"world\" is not a link");
  faulty(link("a", shape("<sphere radius='1'/>", "<origin rpy='1 1 1 1'/>")),
         "rpy wants three numbers, not \"1 1 1 1\"");
  faulty(link("a", "<collision><origin rpy='0 0 0' quat_xyzw='0 0 0 1'/></collision>"), "leave one out");
  faulty(link("a", "<collision><origin quat_xyzw='0 0 0 0'/></collision>"), "quat_xyzw wants four numbers");
  faulty(link("a", "<collision><origin rpy='${pi} 0 0'/></collision>"), "with the program xacro first");
  faulty(link("a") + "<xacro:gripper parent='a'/>", "it holds <xacro:gripper>");
  faulty(link("a", shape("<sphere/>")), "a number is wanted as its radius");
  faulty(link("a", shape("<drake:capsule/>")), "but <drake:capsule>");
  faulty(link("a", ball("x")), "radius wants a number, not \"x\"");
  const RobotTree u = read_urdf(
      urdf(link("a", "<inertial><mass value='1'/><inertia ixx='1' iyy='2' izz='3'/></inertial>" + ball("1")) +
           link("b", "<visual><geometry><sphere radius='1'/></geometry></visual>") + joint("a", "b")));
  EXPECT_EQ(u.model.bodies[0].inertial->inertia, Vector(1, 2, 3).asDiagonal().toDenseMatrix());
  ASSERT_EQ(u.notes.size(), 1u);
  EXPECT_EQ(u.notes[0],
            "links that have visual geometry alone get no spheres (--visual pads the visual geometry of all "
            "links instead): b");
}

// As urdfdom, which reads these.
TEST_F(RobotTest, JointsWithoutAxisOrLeaderAreReadWithANote) {
  const RobotTree u = read_urdf(urdf(link("a") + link("b") + link("c") +
                                     joint("a", "b", "continuous", "<axis xyz='0 0 0'/>") +
                                     joint("a", "c", "continuous", "<mimic joint='none'/>")));
  EXPECT_EQ(u.model.bodies[1].joint.type, Joint::Type::fixed);
  EXPECT_EQ(u.model.bodies[2].joint.mimic, "");
  EXPECT_EQ(u.notes, (std::vector<std::string>{
                         "joints whose axis has no length are taken as fixed: a_b",
                         "joints that mimic one that is not there are taken to follow none: a_c"}));
}

TEST_F(RobotTest, AQuaternionTurnsAsRollPitchAndYaw) {
  const RobotTree u =
      read_urdf(urdf(link("a") + link("b", shape("<box size='1 2 3'/>", "<origin quat_xyzw='0 0 2 2'/>")) +
                     joint("a", "b", "fixed", "<origin xyz='1 0 0' quat_xyzw='1 0 0 0'/>")));
  EXPECT_NEAR((u.links[1].shapes[0].pose.linear() * Vector::UnitX() - Vector::UnitY()).norm(), 0, 1e-15);
  EXPECT_NEAR((u.model.bodies[1].pose * Point(0, 1, 0) - Point(1, -1, 0)).norm(), 0, 1e-15);
}

TEST_F(RobotTest, ARobotWithoutGeometryIsToldSo) {
  const std::string said = error_of([&] { pad_robot(urdf("<link name='a'/>"), kCoarse, {}, {}); });
  EXPECT_TRUE(said.ends_with("no link has any geometry")) << said;
  const std::string ball = "<geometry><sphere radius='1'/></geometry></visual>";
  const fs::path points =
      urdf("<link name='a'><collision><geometry><sphere radius='0'/></geometry></collision><visual>" + ball +
           "</link>");
  EXPECT_TRUE(error_of([&] {
                read_urdf(points);
              }).ends_with("all points, which are left out: --visual pads what can be seen"));
  EXPECT_EQ(read_urdf(points, {.package_folders = {}, .visual = true}).links[0].shapes.size(), 1u);
}

TEST_F(RobotTest, PadsBoxesCylindersSpheresAndMeshesInPlace) {
  fs::create_directories(folder_ / "pkg/meshes");
  write_file(folder_ / "pkg/meshes/tet.obj", kTet);
  const PaddedRobot r = coarse(
      link(
          "base",
          "<visual><geometry><mesh filename='package://pkg/meshes/absent.dae'/></geometry></visual>" + kBox) +
      link("ball", kSeven + ball("0.25", "1 0 0")) +
      link("tube", shape("<cylinder radius='0.1' length='1'/>", "<origin rpy='1.5707963267948966 0 0'/>")) +
      link("tet", shape(mesh("package://pkg/meshes/tet.obj", " scale='1 1 -2'"), "<origin xyz='0 0 5'/>")) +
      link("frame", "") + joint("base", "ball") + joint("base", "tube") + joint("tube", "tet") +
      joint("tet", "frame"));
  const auto body = [&](const std::string& name) { return body_of(r.model, name); };
  EXPECT_NEAR(body("base").cluster.mass.volume, 0.048, 1e-6);
  EXPECT_EQ(body("ball").cluster.centers, std::vector<Point>{Point(1, 0, 0)});
  EXPECT_EQ(body("ball").cluster.radii, std::vector<double>{0.25});
  EXPECT_EQ(body("ball").inertial->mass, 7);
  EXPECT_NEAR(body("tube").cluster.mass.volume, std::numbers::pi * 0.01, 1e-4 * std::numbers::pi);
  EXPECT_NEAR(body("tube").cluster.bounds.high.y(), 0.5, 1e-9);
  EXPECT_NEAR(body("tube").cluster.bounds.high.z(), 0.1, 1.02 / 400);
  EXPECT_NEAR(body("tet").cluster.mass.volume, 1 / 3., 1e-6);
  EXPECT_NEAR(body("tet").cluster.mass.center.z(), 4.5, 1e-6);
  EXPECT_EQ(body("frame").cluster.size(), 0u);
  // The URDF keeps what it had. Only collisions are new, and inertia where there was none.
  const std::string out = text(r.model, "out.urdf");
  EXPECT_TRUE(holds(out, "package://pkg/meshes/absent.dae"));
  EXPECT_EQ(out.find("<box"), std::string::npos);
  EXPECT_TRUE(holds(out, "<mass value=\"7\""));
  std::size_t masses = 0;
  for (std::size_t at = 0; (at = out.find("<mass ", at)) != std::string::npos; at++) masses++;
  EXPECT_EQ(masses, 4u);
  expect_same_spheres(read_spheres(folder_ / "out.urdf", "tet"), body("tet").cluster);
}

TEST_F(RobotTest, AnErrorNamesItsLinkOnce) {
  const std::string thin = shape("<cylinder radius='1e-200' length='1'/>");
  const fs::path path = urdf(link("a", thin));
  const std::string said = error_of([&] { pad_robot(path, kCoarse, {}, {}); });
  EXPECT_EQ(said.rfind("link a"), said.find("link a")) << said;
  EXPECT_EQ(said.find(path.string() + ", link a: no triangle has an area"), 0u) << said;
}

TEST_F(RobotTest, VisualsAreTakenWhenThereIsNothingElse) {
  const PaddedRobot r = coarse(link("a", "<visual><geometry><box size='1 1 1'/></geometry></visual>"));
  EXPECT_GT(r.model.spheres(), 0u);
  ASSERT_EQ(r.notes.size(), 1u);
}

TEST_F(RobotTest, ColladaOfTheUr5StandsLikeItsStl) {
  const fs::path robots = fs::path(PADDER_SHARED) / "meshes/robots";
  if (!fs::exists(robots)) GTEST_SKIP() << "the shared meshes are not there";
  fs::copy(robots / "ur5_forearm_collision.stl", folder_ / "a.stl");
  fs::copy(robots / "ur5_forearm_visual.dae", folder_ / "b.dae");
  const fs::path file =
      urdf(link("a", shape(mesh("a.stl"))) + link("b", shape(mesh("b.dae"))) + joint("a", "b"), "r.urdf");
  const RobotTree robot = read_urdf(file);
  const Box a = read_link(robot.links[0], file).mesh.bounds(),
            b = read_link(robot.links[1], file).mesh.bounds();
  EXPECT_LT((a.low - b.low).norm(), 0.002);
  EXPECT_LT((a.high - b.high).norm(), 0.002);
}

// Pads at 2 % and reads the result with every program that is here.
class RealRobotTest : public RobotTest {
 protected:
  void expect_accepted(const PaddedRobot& r) {
    const std::vector<CollisionFilter> filters = exporting::filters_of(r.model);
    for (const Body& b : r.model.bodies) {
      if (b.cluster.size() == 0) continue;
      const Accuracy& a = b.cluster.accuracy;
      const double allowed = 0.0201 * b.cluster.bounds.diagonal();
      EXPECT_LE(a.protrusion_max, allowed) << b.name;
      EXPECT_LE(a.gap_max, allowed) << b.name;
    }
    for (const char* file : {"r.urdf", "r.xml", "r.yaml", "r.xrdf", "r.srdf"}) {
      write(r.model, file);
      for (const Body& b : r.model.bodies)
        if (b.cluster.size() > 0) expect_same_spheres(read_spheres(folder_ / file, b.name), b.cluster);
    }
    if (have("check_urdf")) {
      const Ran ran = run("check_urdf '" + (folder_ / "r.urdf").string() + "'");
      EXPECT_EQ(ran.status, 0) << ran.output;
    }
    if (python_has("yaml")) {
      EXPECT_EQ(python(R"(
import yaml
c = yaml.safe_load(open("r.yaml"))["robot_cfg"]["kinematics"]
x = yaml.safe_load(open("r.xrdf"))
g, = x["geometry"].values()
assert g["spheres"] == c["collision_spheres"]
print(sum(len(s) for s in g["spheres"].values()))
)"),
                std::to_string(r.model.spheres()));
    }
#ifdef PADDER_MUJOCO
    std::string xml = read_file(folder_ / "r.xml");
    xml.insert(xml.find("  <default>"), "  <size nconmax=\"5000\" njmax=\"3000\"/>\n");
    write_file(folder_ / "r.xml", xml);
    const InMujoco m(folder_ / "r.xml");
    mjData* d = m.data;
    EXPECT_EQ(static_cast<std::size_t>(m->ngeom), r.model.spheres());
    for (int k = 0; k < m->nq; k++) d->qpos[k] = 0.5 * (m->jnt_range[2 * k] + m->jnt_range[2 * k + 1]);
    mj_forward(m.model, d);
    for (int k = 0; k < d->ncon; k++) {
      const auto a = static_cast<std::size_t>(m->geom_bodyid[d->contact[k].geom1] - 1);
      const auto b = static_cast<std::size_t>(m->geom_bodyid[d->contact[k].geom2] - 1);
      EXPECT_TRUE(may_touch(filters[a], filters[b]))
          << r.model.bodies[a].name << " " << r.model.bodies[b].name;
    }
#endif
  }
};

TEST_F(RealRobotTest, Panda) {
  const fs::path panda =
      fs::path(PADDER_SHARED) / "meshes/robots/moveit_resources_panda_description/urdf/panda.urdf";
  if (!fs::exists(panda)) GTEST_SKIP() << "the shared meshes are not there";
  const PaddedRobot r = pad_robot(panda, {.tolerance = Length::share(0.02)});
  EXPECT_EQ(r.model.bodies.size(), 12u);
  std::size_t padded = 0;
  for (const Body& b : r.model.bodies) padded += b.cluster.size() > 0;
  EXPECT_EQ(padded, 11u);
  expect_accepted(r);
}

}  // namespace
}  // namespace padder::samples
