// SPDX-License-Identifier: GPL-3.0-or-later
// MJCF as input, against MuJoCo itself: every geom stands where MuJoCo puts it, for any place of the joints.
#include "padding/robots/mjcf.h"

#include <algorithm>
#include <random>
#include <set>

#include "padding/robot.h"
#include "padding/robots/robot_file.h"
#include "tests/error_of.h"
#include "tests/padding/export/samples.h"
#include "tests/padding/in_mujoco.h"

namespace padder::samples {
namespace {

class MjcfTest : public ExportTest {
 protected:
  fs::path put(const std::string& inside, const std::string& name = "r.xml") {
    write_file(folder_ / name, "<mujoco model='r'>" + inside + "</mujoco>");
    return folder_ / name;
  }
  fs::path world(const std::string& inside) { return put("<worldbody>" + inside + "</worldbody>"); }
  std::string fault(const std::string& inside) {
    return error_of([&] { read_mjcf(put(inside)); });
  }

  // Sets random values in MuJoCo and in ours, and compares each shape's place.
  static void expect_as_in_mujoco(const fs::path& file) {
    SCOPED_TRACE(file.string());
    const InMujoco in(file);
    const mjModel* m = in.model;
    mjData* d = in.data;
    const RobotTree robot = read_mjcf(file);
    constexpr std::uint64_t seed = 7;
    std::mt19937_64 random(seed);
    std::size_t compared = 0;
    for (int pose = 0; pose < 20; pose++) {
      mj_resetData(m, d);
      std::vector<double> values(robot.links.size());
      for (std::size_t k = 0; k < values.size(); k++) {
        const Joint& joint = robot.model.bodies[k].joint;
        const int id = in.id(mjOBJ_JOINT, joint.name);
        const bool one_way = joint.type == Joint::Type::revolute || joint.type == Joint::Type::continuous ||
                             joint.type == Joint::Type::prismatic;
        if (id < 0 || !one_way) continue;
        values[k] = std::uniform_real_distribution<>(-1, 1)(random);
        d->qpos[m->jnt_qposadr[id]] = values[k];
      }
      Model free = robot.model;  // followers, too, stand where they were put
      for (Body& b : free.bodies) b.joint.mimic.clear();
      mj_forward(m, d);
      const auto places = poses_at(free, values);
      int body = 0;  // MuJoCo counts them as they stand in the file, and knows no links of single joints
      for (std::size_t k = 0; k < robot.links.size(); k++)
        if (robot.links[k].name.find(':') == std::string::npos)
          compared += compare(m, d, body++, robot.links[k], places[k]);
      EXPECT_EQ(body, m->nbody);
    }
    EXPECT_GT(compared, 0u);
  }

 private:
  static std::size_t compare(const mjModel* m, const mjData* d, int body, const RobotLink& link,
                             const Eigen::Isometry3d& place) {
    std::vector<int> geoms;
    for (int k = 0; k < m->body_geomnum[body]; k++) {
      const int g = m->body_geomadr[body] + k, type = m->geom_type[g];
      if (type != mjGEOM_PLANE && type != mjGEOM_HFIELD && (m->geom_contype[g] || m->geom_conaffinity[g]))
        geoms.push_back(g);
    }
    EXPECT_EQ(geoms.size(), link.shapes.size()) << link.name;
    for (std::size_t k = 0; k < std::min(geoms.size(), link.shapes.size()); k++)
      compare(m, d, geoms[k], link.shapes[k], place * link.shapes[k].pose);
    return geoms.size();
  }
  static void compare(const mjModel* m, const mjData* d, int g, const RobotShape& shape,
                      const Eigen::Isometry3d& pose) {
    Eigen::Isometry3d theirs = Eigen::Isometry3d::Identity();
    for (int row = 0; row < 3; row++) {
      theirs.translation()[row] = d->geom_xpos[3 * g + row];
      for (int column = 0; column < 3; column++)
        theirs.linear()(row, column) = d->geom_xmat[9 * g + 3 * row + column];
    }
    const mjtNum* size = m->geom_size + 3 * g;
    const Vector half(size[0], size[1], size[2]);
    if (shape.type == RobotShape::Type::mesh) {
      const Mesh mesh = read_mesh(shape.file).mesh;
      const int id = m->geom_dataid[g];
      for (int v = 0; v < m->mesh_vertnum[id]; v++) {
        const float* p = m->mesh_vert + 3 * (m->mesh_vertadr[id] + v);
        const Point at = theirs * Point(p[0], p[1], p[2]);
        double nearest = 1e9;
        for (const Point& q : mesh.points)
          nearest = std::min(nearest, (pose * q.cwiseProduct(shape.scale) - at).norm());
        EXPECT_LT(nearest, 1e-6);
      }
      return;
    }
    EXPECT_LT((pose.translation() - theirs.translation()).norm(), 1e-9);
    switch (shape.type) {
      case RobotShape::Type::box:
        EXPECT_TRUE(shape.size.isApprox(2 * half, 1e-12));
        EXPECT_TRUE((pose.linear() * half.asDiagonal() * pose.linear().transpose())
                        .isApprox(theirs.linear() * half.asDiagonal() * theirs.linear().transpose(), 1e-9));
        // Square ones, too: axes along axes, in whatever order.
        for (const double c : (theirs.linear().transpose() * pose.linear()).cwiseAbs().reshaped())
          EXPECT_TRUE(c < 1e-6 || c > 1 - 1e-6) << c;
        break;
      case RobotShape::Type::ellipsoid:
        EXPECT_TRUE(shape.size.isApprox(half, 1e-12));
        EXPECT_TRUE(pose.linear().isApprox(theirs.linear(), 1e-9));
        break;
      case RobotShape::Type::sphere:
        EXPECT_NEAR(shape.size.x(), half.x(), 1e-12);
        break;
      default:
        EXPECT_NEAR(shape.size.x(), half.x(), 1e-12);
        EXPECT_NEAR(shape.size.z(), 2 * half.y(), 1e-12);
        EXPECT_NEAR(std::abs(pose.linear().col(2).dot(theirs.linear().col(2))), 1, 1e-9);
    }
  }
};

// Every way to say where something is, in degrees and in radians, with classes and an included file.
TEST_F(MjcfTest, EveryGeomStandsWhereMuJoCoPutsIt) {
  fs::create_directories(folder_ / "meshes");
  write_file(folder_ / "meshes/tet.obj", kTet);
  write_file(
      folder_ / "hand.xml",
      "<mujoco><body name='hand' pos='0 0 .4' zaxis='1 1 3'><joint name='wrist' type='hinge' axis='1 0 "
      "0' pos='.1 0 .05' ref='.3' range='-1 2'/><joint name='slide' type='slide' axis='1 2 0' ref='-.2' "
      "range='-1 1'/><joint name='twist' axis='0 0 2'/><geom type='mesh' mesh='tet' pos='0 .1 0' euler='.1 "
      ".2 .3'/><geom type='mesh' mesh='turned'/><geom class='thin' fromto='0 0 0 .2 .1 "
      ".3'/></body></mujoco>");
  const std::string inside =
      "<asset><mesh name='tet' file='tet.obj' scale='.1 -.2 .3' refpos='.1 .2 .3'/>"
      "<mesh name='turned' file='tet.obj' scale='-.1 -.1 -.1' refpos='.1 .2 .3' refquat='1 .2 0 .3'/></asset>"
      "<default class='top'><geom size='.1 .2 .3'/><joint damping='3'/><default class='arm'><geom "
      "type='capsule' euler='.3 .2 .1'/><default class='thin'><geom "
      "size='.02'/></default></default></default>"
      "<worldbody><geom type='plane' size='1 1 1'/><geom class='top' type='box' pos='3 0 0' quat='1 2 3 4'/>"
      "<body name='base' pos='0 0 1' axisangle='1 1 0 .5'><freejoint name='root'/><geom type='ellipsoid' "
      "xyaxes='1 1 0 -1 1 .5'/><body name='upper' childclass='arm' pos='0 .2 0' euler='.3 -.2 1'>"
      "<joint name='shoulder' axis='0 1 1'/><geom/><geom type='cylinder' pos='.1 .2 .3'/><geom type='sphere' "
      "class='thin' contype='0' conaffinity='0'/><geom type='box' fromto='0 0 0 .1 .2 .3'/><include "
      "file='hand.xml'/></body></body></worldbody>";
  for (const std::string compiler :
       {"<compiler autolimits='true' meshdir='meshes'/>",
        "<compiler autolimits='true' meshdir='meshes' angle='radian' eulerseq='zyx'/>",
        "<compiler autolimits='true' meshdir='meshes' angle='radian' eulerseq='XYZ'/>",
        "<compiler autolimits='true' meshdir='meshes' angle='radian' eulerseq='xYz'/>"})
    expect_as_in_mujoco(put(compiler + inside));
}

TEST_F(MjcfTest, AnElementAndItsClassesAreMixedAsInMuJoCo) {
  const std::string bodies =
      "<worldbody><body name='b'><joint name='j'/><geom type='box' quat='1 2 0 0'/><geom type='capsule' "
      "size='.07'/><geom type='ellipsoid' class='q' size='.01'/></body></worldbody>";
  for (const std::string turn : {"euler='0 80 0'", "axisangle='0 1 0 80'", "zaxis='1 0 1'", "quat='0 1 1 0'"})
    expect_as_in_mujoco(put("<default><geom size='.05 .1 .4' " + turn +
                            "/><default class='q'><geom size='.2 .3'/></default></default>" + bodies));
}

TEST_F(MjcfTest, InventedNamesAreThoseOfNoOther) {
  const std::string box = "<geom type='box' size='.1 .1 .1'/>";
  const fs::path file =
      world("<body><joint/>" + box + "<body name='body_1' pos='1 0 0'><joint name='body_1__joint'/>" + box +
            "</body></body><body name='b'>" + box + "</body><body name='x'><joint/><joint axis='1 0 0'/>" +
            box + "<body name='x:x_joint_'><joint name='b_fixed'/><joint name='x_joint' axis='1 0 0'/>" +
            box + "</body></body>");
  std::set<std::string> bodies, joints;
  const Model model = read_mjcf(file).model;
  for (const Body& b : model.bodies) bodies.insert(b.name), joints.insert(b.joint.name);
  EXPECT_EQ(bodies.size(), model.bodies.size());
  EXPECT_EQ(joints.size(), model.bodies.size());
}

TEST_F(MjcfTest, JointsLimitsMotorsAndPairs) {
  const RobotTree r = read_mjcf(put(
      "<default><motor ctrlrange='-2 3'/></default><worldbody><body name='a'><geom size='.1'/><joint "
      "name='j' range='-90 45' damping='2' frictionloss='.5'/><body name='b' pos='1 0 0'><joint name='k' "
      "type='slide' range='-1 1' limited='false'/><geom size='.1'/><body name='c' pos='1 0 0'><joint "
      "name='l' ref='10'/><geom size='.1'/>"
      "<inertial pos='1 2 3' mass='4' fullinertia='3 4 5 .1 .2 .3'/></body></body><body name='d' pos='0 9 "
      "0'><geom size='.1' contype='2' conaffinity='2'/><joint name='m' "
      "type='ball'/></body></body></worldbody>"
      "<contact><exclude body1='a' body2='c'/></contact><actuator><motor joint='j' gear='5'/></actuator>"
      "<equality><joint joint1='l' joint2='j' polycoef='.1 .5 0 0 0'/><joint joint1='k' joint2='j' "
      "active='false'/></equality>"));
  const auto body = [&](const std::string& name) { return body_of(r.model, name); };
  EXPECT_EQ(body("a").joint.type, Joint::Type::revolute);
  EXPECT_NEAR(body("a").joint.lower, -std::numbers::pi / 2, 1e-12);
  EXPECT_EQ(body("a").joint.effort, 15);
  EXPECT_EQ(body("a").joint.damping, 2);
  EXPECT_EQ(body("a").joint.friction, 0.5);
  EXPECT_FALSE(body("b").joint.limited());
  EXPECT_EQ(body("b").joint.mimic, "");
  EXPECT_EQ(body("c").joint.mimic, "j");
  EXPECT_NEAR(body("c").joint.offset, 0.1 + std::numbers::pi / 18, 1e-12);
  EXPECT_EQ(body("c").joint.multiplier, 0.5);
  EXPECT_EQ(body("c").inertial->mass, 4);
  EXPECT_EQ(body("c").inertial->inertia(1, 2), 0.3);
  EXPECT_EQ(body("d").joint.type, Joint::Type::ball);
  std::set<std::string> apart;
  for (const Apart& p : r.model.apart)
    apart.insert(r.links[p.a].name + " " + r.links[p.b].name + " " + p.reason);
  EXPECT_EQ(apart, (std::set<std::string>{"a c User", "b d User", "c d User"}));  // a and d are neighbours
}

// MuJoCo keeps a body from its parent, but not from the world and what is fixed to it.
TEST_F(MjcfTest, WhatMovesMayTouchTheWorld) {
  const std::string box = "<geom type='box' size='.1 .1 .1'/>";
  const RobotTree r = read_mjcf(
      world("<geom type='box' size='5 5 .1'/><body name='free' pos='0 0 .5'><freejoint/>" + box +
            "</body><body name='hopper' pos='1 0 1'><joint type='slide' range='-5 5' limited='true'/>" + box +
            "<body name='foot'><joint/>" + box + "</body></body><body name='base' pos='3 0 0'>" + box +
            "<body name='arm'><joint/>" + box + "</body></body>"));
  std::set<std::string> names;
  for (const auto& [i, j] : neighbours(r)) names.insert(r.links[i].name + " " + r.links[j].name);
  EXPECT_EQ(names, (std::set<std::string>{"world base", "hopper foot"}));
}

// At 0 the two lie apart, and at their references in one another.
TEST_F(MjcfTest, TheFirstPoseIsThatOfTheReferences) {
  const fs::path file = world(
      "<body name='p' pos='0 0 1'><joint name='px' type='slide' axis='1 0 0' ref='1' limited='true' "
      "range='-2 2'/><geom type='box' size='.2 .2 .2'/></body><body name='q' pos='.1 0 1'><joint name='qx' "
      "type='slide' axis='1 0 0' ref='2' limited='true' range='-3 3'/><geom type='box' size='.2 .2 "
      ".2'/></body>");
  const PaddedRobot r = pad_robot(file, {.tolerance = Length::share(0.05)});
  ASSERT_EQ(r.model.apart.size(), 1u);
  EXPECT_EQ(r.model.apart[0].reason, "Default");
  write(r.model, "out.xml");
  const InMujoco m(folder_ / "out.xml");
  EXPECT_EQ(m->qpos0[0], 1);
  EXPECT_EQ(m->qpos0[1], 2);
  EXPECT_NEAR(m->body_pos[3 * m.id(mjOBJ_BODY, "q")], 0.1, 1e-15);
}

TEST_F(MjcfTest, WhatNoFormatGetsIsListedInOneNote) {
  const std::string bodies =
      "<worldbody><body name='a'><joint name='j' armature='.3' stiffness='5' springref='1'/><site name='s'/>"
      "<camera/><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/><geom type='box' size='1 1 "
      "1'/></body></worldbody>";
  const RobotTree r = read_mjcf(put(
      "<option gravity='0 0 -1' timestep='.1'/>" + bodies +
      "<equality><connect body1='a' anchor='0 0 0'/></equality><tendon><fixed name='t'/></tendon><actuator>"
      "<position joint='j'/></actuator><sensor><jointpos joint='j'/></sensor><keyframe><key "
      "qpos='0'/></keyframe>"));
  ASSERT_EQ(r.notes.size(), 1u);
  EXPECT_EQ(r.notes[0],
            "left out, since no link, joint or pair of links has it: actuators other than motors, armature, "
            "cameras, closed loops (connect, weld), gravity, keyframes, sensors, sites, springref, "
            "stiffness, tendons, timestep");
}

TEST_F(MjcfTest, BallsKeepTheirRangeAndMassesTheirTotal) {
  const auto inertial = [](int mass) {
    return "<inertial pos='0 0 0' mass='" + std::to_string(mass) + "' diaginertia='1 1 1'/>";
  };
  const fs::path file =
      put("<compiler settotalmass='10'/><worldbody><body name='a'><joint name='b' type='ball' range='0 90' "
          "limited='true' damping='2' frictionloss='.5'/>" +
          inertial(3) + "<geom type='box' size='.1 .1 .1'/><body name='c'>" + inertial(1) +
          "</body></body></worldbody>");
  const PaddedRobot r = pad_robot(file, {.tolerance = Length::share(0.1)});
  EXPECT_EQ(r.model.bodies[1].inertial->mass, 7.5);
  EXPECT_EQ(r.model.bodies[2].inertial->inertia(0, 0), 2.5);
  write(r.model, "out.xml");
  const InMujoco m(folder_ / "out.xml");
  EXPECT_TRUE(m->jnt_limited[0]);
  EXPECT_NEAR(m->jnt_range[1], std::numbers::pi / 2, 1e-12);
  EXPECT_EQ(m->dof_damping[2], 2);
  EXPECT_EQ(m->dof_frictionloss[2], 0.5);
  const RobotTree open =
      read_mjcf(put("<compiler settotalmass='10'/><worldbody><body name='a'><geom type='box' size='1 1 1' "
                    "shellinertia='true'/></body></worldbody>"));
  EXPECT_TRUE(holds(open.notes.at(0), "settotalmass"));
}

TEST_F(MjcfTest, WhatIsLeftOutIsCountedInNotes) {
  const RobotTree r = read_mjcf(
      put("<worldbody><geom type='plane' size='1 1 1'/><flexcomp name='cloth'/>"
          "<body name='a'><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/><geom type='box' size='1 1 1'/>"
          "</body></worldbody><deformable><flex name='bag'/></deformable>"));
  EXPECT_EQ(r.notes, (std::vector<std::string>{"planes and height fields, which are left out: 1",
                                               "soft bodies (flex), which are left out: 2"}));
}

TEST_F(MjcfTest, WhatIsNotReadIsSaidInASentence) {
  for (const auto& [inside, words] :
       {std::pair("<compiler coordinate='global'/>", "global coordinates"),
        {"<worldbody><replicate count='3'><geom size='1'/></replicate></worldbody>", "mj_saveLastXML"},
        {"<asset><mesh name='m' vertex='0 0 0 1 0 0 0 1 0 0 0 1'/></asset><worldbody><geom type='mesh' "
         "mesh='m'/></worldbody>",
         "it names no file"},
        {"<worldbody><geom type='mesh' mesh='none'/></worldbody>", "no mesh asset \"none\""},
        {"<asset><mesh file='none.stl'/></asset><worldbody><geom type='mesh' mesh='none'/></worldbody>",
         "is not there"},
        {"<asset><mesh file='m.stl'/></asset><worldbody><geom type='box' mesh='m'/></worldbody>",
         "fitted to a mesh"},
        {"<asset><mesh file='m.stl'/></asset><worldbody><geom mesh='m'/></worldbody>",
         "a sphere that is fitted to a mesh"},
        {"<worldbody><geom class='none' size='1'/></worldbody>", "no default class \"none\""},
        {"<worldbody><geom size='x'/></worldbody>", "size takes 1 to 3 numbers, not \"x\""},
        {"<worldbody><geom size='1 2 3 4'/></worldbody>", "size takes"},
        {"<worldbody><geom type='capsule' size='1'/></worldbody>", "needs 2 sizes"},
        {"<worldbody><geom type='box' size='1 0 1'/></worldbody>", "needs 3 sizes"},
        {"<worldbody><body name='a'/><body name='a'/></worldbody>", "two bodies are called a"},
        {"<worldbody><body><joint name='a'/><joint name='a'/></body></worldbody>", "two joints"},
        {"<worldbody><body><joint type='screw'/></body></worldbody>", "no type of joint"},
        {"<include file='r.xml'/>", "included twice"},
        {"<include file='none.xml'/>", "none.xml"},
        {"<contact><exclude body1='x' body2='y'/></contact>", "a body that is not there"}})
    EXPECT_TRUE(holds(fault(inside), words)) << inside << ": " << fault(inside);
}

TEST_F(MjcfTest, WhatMuJoCoRefusesIsRefused) {
  const std::string box = "<geom type='box' size='1 1 1'/>";
  for (const auto& [inside, words] :
       {std::pair<std::string, const char*>("<body><joint range='1 -1'/>", "the lower end first"),
        {"<body><joint range='1 1' limited='true'/>", "the lower end first"},
        {"<body><joint limited='true'/>", "the lower end first"},
        {"<body><joint type='ball' range='1 2'/>", "the range of a ball is 0 and an angle above 0"},
        {"<body><joint range='-1 1' limited='maybe'/>", "limited is true, false or auto, not \"maybe\""},
        {"<body name='a'>" + box + "<body><freejoint/>", "take it out of a"},
        {"<body><freejoint/><joint/>", "no other joint"},
        {"<body><joint/><joint type='free'/>", "no other joint"},
        {"<freejoint/><body>", "the world has no joints"},
        {"<body><geom size='1' mass='-1'/>", "mass or density is below 0"},
        {"<body><geom size='1' density='-1'/>", "mass or density is below 0"},
        {"<body zaxis='0 0 0'>", "its zaxis has a direction without length"},
        {"<body axisangle='0 0 0 1'>", "without length"},
        {"<body xyaxes='1 0 0 2 0 0'>", "without length"}}) {
    const bool nested = inside.find("name='a'") != std::string::npos;
    const fs::path file = world(inside + box + "</body>" + (nested ? "</body>" : ""));
    EXPECT_TRUE(refuses([&] { read_mjcf(file); }, words)) << inside;
    char error[1000] = "";
    EXPECT_EQ(mj_loadXML(file.c_str(), nullptr, error, sizeof error), nullptr) << inside;
  }
  for (const char* joint : {"<joint range='1 -1' limited='false'/>", "<joint range='0 0'/>"})
    EXPECT_EQ(read_mjcf(world("<body>" + std::string(joint) + box + "</body>")).model.bodies[1].joint.type,
              Joint::Type::continuous);
}

TEST_F(MjcfTest, NothingIsQuotedOfAFileThatIsNoXml) {
  write_file(folder_ / "secret", "root:x:0:0");
  EXPECT_TRUE(holds(fault("<include file='secret'/>"), "secret: there is no element in it"));
}

TEST_F(MjcfTest, BodiesOnlyToLookAtAreNamedAndPairsTouch) {
  const std::string bodies =
      "<worldbody><geom name='floor' type='plane' size='1 1 1'/><body name='a'><joint/><geom size='.1'/>"
      "<geom name='ga' size='.2' contype='0' conaffinity='0'/></body><body name='hand' pos='1 0 0'><joint/>"
      "<geom name='gh' size='.1' contype='0' conaffinity='0'/></body><body name='look' pos='2 0 0'><joint/>"
      "<geom size='.1' contype='0' conaffinity='0'/></body></worldbody><contact>";
  const RobotTree r =
      read_mjcf(put(bodies + "<pair geom1='ga' geom2='gh'/><pair geom1='floor' geom2='gh'/></contact>"));
  EXPECT_EQ(r.links[1].shapes.size(), 2u);
  EXPECT_EQ(r.links[2].shapes.size(), 1u);
  EXPECT_EQ(r.links[3].shapes.size(), 0u);
  EXPECT_TRUE(r.model.apart.empty());
  ASSERT_EQ(r.notes.size(), 2u);
  EXPECT_EQ(r.notes[0],
            "links that have visual geometry alone get no spheres (--visual pads the visual geometry of all "
            "links instead): look");
  EXPECT_TRUE(holds(fault(bodies + "<pair geom1='ga' geom2='none'/></contact>"), "its geom2 is not there"));
}

TEST_F(MjcfTest, AStatedMassCountsWhereMuJoCoTakesIt) {
  const std::string mass = "<inertial pos='0 0 0' mass='3' diaginertia='1 1 1'/>";
  const RobotTree r =
      read_mjcf(put("<compiler inertiafromgeom='true'/><worldbody><body name='a'>" + mass +
                    "<geom size='.1'/><body name='b'><joint/>" + mass + "</body></body></worldbody>"));
  EXPECT_NEAR(r.model.bodies[1].inertial->mass, 4000 / 3. * std::numbers::pi * 1e-3, 1e-12);
  EXPECT_EQ(r.model.bodies[2].inertial->mass, 3);
}

TEST_F(MjcfTest, BodiesWithoutInertialWeighWhatTheirGeomsDo) {
  std::string bodies;
  for (const char* place : {"pos='.1 .2 .3' euler='30 40 50", "fromto='0 0 0 1 2 3"})
    for (const char* kind : {"sphere' size='.2", "capsule' size='.1 .3", "cylinder' size='.2 .1",
                             "box' size='.1 .2 .3", "ellipsoid' size='.1 .2 .3"})
      for (const char* weight : {"", "density='50'", "mass='2'"}) {
        if (*place == 'f' && *kind == 's') continue;  // a sphere has no two ends
        const std::string geom = std::string("<geom type='") + kind + "' " + weight;
        bodies += "<body pos='1 2 3' euler='10 20 30'><joint/>" + geom + " " + place + "'/>" + geom +
                  " contype='0' conaffinity='0'/><geom class='heavy'/><geom size='1' group='3'/><geom "
                  "size='1' mass='0'/></body>";
      }
  const fs::path file = put(
      "<compiler inertiagrouprange='0 2'/><default><default class='heavy'><geom type='box' size='.1 .1 .1' "
      "pos='1 1 1' density='5000'/></default></default><worldbody>" +
      bodies + "</worldbody>");
  const InMujoco m(file);
  const RobotTree robot = read_mjcf(file);
  ASSERT_EQ(robot.links.size(), 28u);
  EXPECT_TRUE(robot.notes.empty()) << robot.notes[0];
  for (std::size_t k = 1; k < robot.links.size(); k++) {
    const Inertial& ours = *robot.model.bodies[k].inertial;
    EXPECT_NEAR(ours.mass, m->body_mass[k], 1e-9 * ours.mass);
    EXPECT_LT((ours.center - Vector(m->body_ipos + 3 * k)).norm(), 1e-9);
    const mjtNum* q = m->body_iquat + 4 * k;
    const Eigen::Matrix3d turn = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).toRotationMatrix();
    const Eigen::Matrix3d theirs = turn * Vector(m->body_inertia + 3 * k).asDiagonal() * turn.transpose();
    EXPECT_LT((ours.inertia - theirs).norm(), 1e-6 * theirs.norm()) << k;
  }
}

TEST_F(MjcfTest, MassesThatNeedAMeshAreNotKnown) {
  write_file(folder_ / "tet.obj", kTet);
  const auto read = [&](const std::string& geom) {
    return read_mjcf(
        put("<asset><mesh file='tet.obj'/></asset><worldbody><body name='a'><joint/><geom type='mesh' "
            "mesh='tet' " +
            geom + "</body></worldbody>"));
  };
  const RobotTree padded = read("/>"),
                  bare = read("contype='0' conaffinity='0'/><body><geom size='1'/></body>");
  EXPECT_FALSE(padded.model.bodies[1].inertial);
  EXPECT_EQ(
      padded.notes.at(0),
      "bodies without <inertial> that have meshes or shells, so that their mass follows from a density and "
      "not from their geoms: a");
  EXPECT_TRUE(holds(bare.notes.at(1), "which get no mass, though MuJoCo gives them that of their geoms: a"));
  EXPECT_EQ(read("mass='0'/>").model.bodies[1].inertial->mass, 0);  // stated, and no density takes its place
  // So is a stated density, if it is the same for all geoms.
  const PaddedRobot dense = pad_robot(
      put("<asset><mesh file='tet.obj'/></asset><default><geom density='600'/></default><worldbody><body "
          "name='a'><joint/><geom type='mesh' mesh='tet'/></body><body name='b' pos='5 0 0'><joint/><geom "
          "type='mesh' mesh='tet'/><geom size='.1' pos='9 0 0' density='50'/></body></worldbody>"),
      {.tolerance = Length::share(0.1)});
  EXPECT_NEAR(dense.model.bodies[1].inertial->mass, 100, 1e-9);
  EXPECT_FALSE(dense.model.bodies[2].inertial);
  EXPECT_EQ(
      dense.notes.at(0),
      "bodies whose geoms state a density, and whose mass follows from it and the shape that is padded: a");
  EXPECT_TRUE(
      holds(dense.notes.at(1), "so that their mass follows from a density and not from their geoms: b"));
  // A stated mass is kept, and the shape gives the moments: a tetrahedron's, and a cube's of density 1000.
  const fs::path file =
      put("<compiler settotalmass='30'/><asset><mesh file='tet.obj'/></asset><worldbody><body "
          "name='a'><joint/><geom type='mesh' mesh='tet' mass='2'/></body><body pos='5 0 0'><joint/><geom "
          "type='box' size='.1 .1 .1'/></body></worldbody>");
  EXPECT_EQ(read_mjcf(file).notes.at(0),
            "bodies whose geoms state a mass, and whose moments follow from the shape that is padded: a");
  const PaddedRobot r = pad_robot(file, {.tolerance = Length::share(0.1)});
  const Inertial& tet = *r.model.bodies[1].inertial;
  EXPECT_NEAR(tet.mass, 6, 1e-12);
  EXPECT_LT((tet.center - Vector::Constant(0.25)).norm(), 1e-6);
  EXPECT_NEAR(tet.inertia(0, 0), 6 * 3 / 40., 1e-6);
  EXPECT_NEAR(tet.inertia(0, 1), 6 / 80., 1e-6);
  EXPECT_NEAR(r.model.bodies[2].inertial->mass, 24, 1e-9);
}

TEST_F(MjcfTest, BackslashesSeparateFolders) {
  fs::create_directories(folder_ / "meshes");
  write_file(folder_ / "meshes/tet.obj", kTet);
  const auto mesh = [&](const std::string& compiler, const std::string& file) {
    return read_mjcf(put(compiler + "<asset><mesh name='m' file='" + file +
                         "'/></asset><worldbody><geom type='mesh' mesh='m'/></worldbody>"))
        .links[0]
        .shapes.at(0)
        .file;
  };
  EXPECT_EQ(mesh("", "meshes\\tet.obj"), folder_ / "meshes/tet.obj");
  EXPECT_EQ(mesh("<compiler meshdir='meshes' strippath='true'/>", "C:\\parts\\tet.obj"),
            folder_ / "meshes/tet.obj");
  EXPECT_TRUE(refuses([&] { mesh("", "meshes/Tet.obj"); }, "meshes/tet.obj is there"));
  write_file(folder_ / "meshes/part.xml", "<mujoco><worldbody><geom size='1'/></worldbody></mujoco>");
  EXPECT_EQ(read_mjcf(put("<include file='meshes\\part.xml'/>")).links[0].shapes.size(), 1u);
}

// As a mesh file that is not there.
TEST_F(MjcfTest, AMeshThatNoPaddedGeomUsesIsNotRead) {
  const RobotTree r = read_mjcf(
      put("<asset><mesh name='m' vertex='0 0 0 1 0 0 0 1 0 0 0 1'/></asset><worldbody><body name='a'><geom "
          "type='mesh' mesh='m' contype='0' conaffinity='0'/><geom size='.1'/></body></worldbody>"));
  ASSERT_EQ(r.links[1].shapes.size(), 1u);
  EXPECT_EQ(r.links[1].shapes[0].type, RobotShape::Type::sphere);
}

// Spheres alone are converted as they are, if the file says no more than where they are in their bodies.
TEST_F(MjcfTest, SpheresThatSayMoreAreARobot) {
  const auto robot = [&](const std::string& text) {
    write_file(folder_ / "s.xml", text);
    return is_robot_file(folder_ / "s.xml");
  };
  const std::string plain = "<body name='b'><geom size='.1' pos='1 0 0'/></body>";
  EXPECT_FALSE(robot("<mujoco><worldbody>" + plain + "</worldbody></mujoco>"));
  for (const std::string& more : std::vector<std::string>{
           "<body name='b' pos='1 2 3'><geom size='.1'/></body>", "<geom size='.1'/>" + plain,
           std::string("<body name='b'><frame pos='0 0 1'><geom size='.1'/></frame></body>"),
           std::string("<body name='b'><geom pos='1 0 0'/></body>"),
           std::string("<body name='b'><geom size='.1'/><geom size='1' contype='0' conaffinity='0'/></body>"),
           std::string("<body name='b'><geom type='box' size='.1 .1 .1'/></body>")})
    EXPECT_TRUE(robot("<mujoco><worldbody>" + more + "</worldbody></mujoco>")) << more;
  EXPECT_TRUE(
      robot("<mujoco><default><geom size='.1'/></default><worldbody>" + plain + "</worldbody></mujoco>"));
  EXPECT_TRUE(
      robot("<mujoco><worldbody><body name='a'><geom size='.1'/><body name='b'><joint/><geom size='.1'/>"
            "</body></body></worldbody></mujoco>"));
  EXPECT_TRUE(robot("<mujoco><include file='spheres.xml'/></mujoco>"));
  EXPECT_TRUE(robot("<robot name='r'><link name='l'/></robot>"));
}

// What was read is written to MuJoCo again: the same tree, joints and masses, with spheres as geoms.
TEST_F(MjcfTest, APaddedRobotIsTheSameRobot) {
  const fs::path file = world(
      "<body name='base' pos='0 0 1'><freejoint name='root'/><inertial pos='0 0 0' mass='5' diaginertia='1 1 "
      "1'/><geom type='box' size='.1 .1 .1'/><body name='leg' pos='.3 0 0'><joint name='hip' axis='0 1 0' "
      "pos='0 0 .1' range='-60 60'/><inertial pos='0 0 -.2' mass='2' diaginertia='.1 .1 .1'/><geom "
      "type='capsule' size='.03' fromto='0 0 0 0 0 -.4'/></body></body>");
  ASSERT_TRUE(is_robot_file(file));
  for (const char* name : {"a.urdf", "A.URDF", "a.Xacro"}) EXPECT_TRUE(is_robot_file(name));
  EXPECT_FALSE(is_robot_file("a.stl"));
  const PaddedRobot r = pad_robot(file, {.tolerance = Length::share(0.05)});
  EXPECT_TRUE(is_robot_file(write(r.model, "out.xml")));
  EXPECT_EQ(read_mjcf(folder_ / "out.xml").links.size(), r.model.bodies.size());
  const InMujoco m(folder_ / "out.xml");
  EXPECT_EQ(m->nv, 7);
  EXPECT_EQ(static_cast<std::size_t>(m->ngeom), r.model.spheres());
  EXPECT_EQ(m->body_mass[m.id(mjOBJ_BODY, "leg")], 2);
  EXPECT_NEAR(m->jnt_range[2 * m.id(mjOBJ_JOINT, "hip")], -std::numbers::pi / 3, 1e-12);
  if (have("check_urdf")) {
    write(r.model, "out.urdf");
    EXPECT_EQ(run("check_urdf '" + (folder_ / "out.urdf").string() + "'").status, 0);
  }
  for (const char* other : {"o.xrdf", "o.yaml", "o.srdf", "o.usda"}) write(r.model, other);
}

// Names that MuJoCo has already, or that stand for parts of a joint; a joint that follows a fixed one.
TEST_F(MjcfTest, NamesOfAUrdfThatMuJoCoWouldRefuse) {
  const std::string ball = "<collision><geometry><sphere radius='.1'/></geometry></collision></link>";
  const auto joint = [](const std::string& name, const std::string& type, const std::string& parent,
                        const std::string& child, const std::string& more = "") {
    return "<joint name='" + name + "' type='" + type + "'><parent link='" + parent + "'/><child link='" +
           child + "'/><origin xyz='1 0 0'/><axis xyz='0 0 1'/>" + more + "</joint>";
  };
  std::string text = "<robot name='r'>";
  for (const char* link : {"base", "world", "world_", "a", "b"})
    text += "<link name='" + std::string(link) + "'>" + ball;
  text += joint("p", "planar", "base", "world") + joint("p_x", "fixed", "world", "world_") +
          joint("p_y", "continuous", "world_", "a") +
          joint("q", "continuous", "a", "b", "<mimic joint='p_x' multiplier='2' offset='.3'/>") + "</robot>";
  write_file(folder_ / "r.urdf", text);
  const PaddedRobot r = pad_robot(folder_ / "r.urdf", {});
  write(r.model, "out.xml");
  const InMujoco m(folder_ / "out.xml");
  EXPECT_EQ(m->njnt, 5);
  EXPECT_EQ(m->neq, 1);
  EXPECT_GE(m.id(mjOBJ_BODY, "world__"), 0);
}

}  // namespace
}  // namespace padder::samples
