// SPDX-License-Identifier: MIT
// Robots' links: padding/export/urdf.cpp, yaml.cpp, read_robots.cpp.
#include "padding/asset/error.h"
#include "tests/error_of.h"
#include "tests/padding/export/samples.h"

namespace padder::samples {
namespace {

class RobotsTest : public ExportTest {
 protected:
  // Every link's spheres are there again.
  void expect_arm(const std::string& file) {
    const Model m = arm();
    for (const Body& b : m.bodies) {
      SCOPED_TRACE(file + " " + b.name);
      if (b.cluster.size()) {
        const Cluster back = read_spheres(folder_ / file, b.name);
        expect_same_spheres(back, b.cluster);
        EXPECT_EQ(back.name, b.name);
      } else {
        EXPECT_THROW(read_spheres(folder_ / file, b.name), Error);
      }
    }
    EXPECT_THROW(read_spheres(folder_ / file), Error);  // which link?
  }
};

double mass(const std::string& urdf) {
  const auto at = urdf.find("<mass value=\"");
  return at == std::string::npos ? -1 : std::atof(urdf.c_str() + at + 13);
}

TEST_F(RobotsTest, EveryFormatGivesTheSameBitsBack) {
  for (const char* file : {"a.urdf", "a.yaml", "a.xrdf", "a.srdf", "a.xml"}) {
    write(arm(), file);
    expect_arm(file);
    const std::string one = std::string("b.") + fs::path(file).extension().string().substr(1);
    expect_same_spheres(read_spheres(write(model_of(brick()), one)), brick());
  }
}

TEST_F(RobotsTest, PairsThatMayNotTouchComeBack) {
  Model m = arm();
  m.apart.push_back({0, 4, "Never"});
  for (const char* file : {"a.yaml", "a.xrdf", "a.srdf", "a.xml"}) {
    const Model back = read_sphere_model(write(m, file)).model;
    std::string pairs;
    for (const Apart& p : back.apart) pairs += back.bodies[p.a].name + "-" + back.bodies[p.b].name + " ";
    const bool bits = std::string(file) == "a.xml";  // its families keep the others apart
    EXPECT_EQ(pairs,
              bits ? "base-finger " : "base-upper base-hand base-finger upper-hand upper-finger hand-finger ")
        << file;
    if (bits) continue;
    const bool reasons = std::string(file) == "a.srdf";
    EXPECT_EQ(back.apart[2].reason == "Never", reasons) << file;
  }
}

TEST_F(RobotsTest, MillimetresBecomeMetres) {
  Cluster c = brick();
  c.unit = "mm";
  for (const char* file : {"b.urdf", "b.yaml", "b.xrdf", "b.srdf", "b.xml"}) {
    const Cluster back = read_spheres(write(model_of(c), file));
    EXPECT_NEAR(back.centers[2].z(), 0.001 * c.centers[2].z(), 1e-15) << file;
    EXPECT_NEAR(back.radii[2], 0.001 * c.radii[2], 1e-15) << file;
  }
  // 1000 kg/m^3 in a box of 48e-3 mm^3.
  EXPECT_NEAR(mass(text(model_of(c), "b.urdf")), 48e-9, 1e-18);
}

TEST_F(RobotsTest, UrdfHasTrueMassAndThePairsBesideIt) {
  const std::string urdf = text(model_of(brick()), "b.urdf");
  EXPECT_NEAR(mass(urdf), 48, 1e-9);
  EXPECT_FALSE(fs::exists(folder_ / "b.srdf"));
  write(arm(), "arm.urdf");
  const std::string srdf = read_file(folder_ / "arm.srdf");
  for (const char* pair :
       {"link1=\"base\" link2=\"upper\"", "link1=\"base\" link2=\"hand\"", "link1=\"upper\" link2=\"hand\"",
        "link1=\"upper\" link2=\"finger\"", "link1=\"hand\" link2=\"finger\""})
    EXPECT_TRUE(holds(srdf, pair)) << pair;
  EXPECT_EQ(srdf.find("link1=\"base\" link2=\"finger\""), std::string::npos);
  EXPECT_EQ(srdf.find("frame"), std::string::npos);
}

TEST_F(RobotsTest, ARobotOfOneLinkLeavesNoPairsOfAnother) {
  write(arm(), "a.urdf");
  Model one = model_of(brick());
  one.file = "one.urdf";
  write(one, "a.urdf");
  EXPECT_EQ(read_file(folder_ / "a.srdf").find("disable_collisions"), std::string::npos);
}

TEST_F(RobotsTest, CheckUrdfAcceptsIt) {
  if (!have("check_urdf")) GTEST_SKIP() << "check_urdf (liburdfdom-tools) is not installed";
  for (const Model& m : {arm(), model_of(brick())}) {
    const Ran r = run("check_urdf '" + write(m, "a.urdf").string() + "'");
    EXPECT_EQ(r.status, 0) << r.output;
    EXPECT_TRUE(holds(r.output, "robot name is: " + m.name));
  }
  Model loose = arm();  // two roots: a world is put under them
  loose.bodies[3].parent = -1;
  const Ran r = run("check_urdf '" + write(loose, "a.urdf").string() + "'");
  EXPECT_EQ(r.status, 0) << r.output;
  EXPECT_TRUE(holds(r.output, "root Link: world has 2 child"));
}

TEST_F(RobotsTest, ABallJointThatFloatsInAUrdfIsTold) {
  Model m = arm();
  m.bodies[1].joint.type = Joint::Type::ball;
  const auto warnings = write_model(m, folder_ / "a.urdf", find_format("a.urdf"));
  ASSERT_EQ(warnings.size(), 2u);
  EXPECT_TRUE(holds(warnings[1], "set effort and velocity of finger_joint"));
  EXPECT_TRUE(holds(warnings[0], m.bodies[1].joint.name + " and any other one are floating joints"));
  EXPECT_TRUE(write_model(m, folder_ / "a.xml", find_format("a.xml")).empty());
}

// urdfdom refuses a URDF without them, which others read.
TEST_F(RobotsTest, MissingNumbersAreFilled) {
  Model m = arm();
  m.urdf = "<robot name='r'>";
  for (Body& b : m.bodies) b.inertial = Inertial{1, Point::Zero(), Vector(1, 2, 3).asDiagonal()};
  for (const Body& b : m.bodies)
    m.urdf += "<link name='" + b.name +
              "'><inertial><mass value='1'/><inertia ixx='1' iyy='2' izz='3'/></inertial></link>";
  m.urdf += "<joint name='j'><limit lower='-1'/></joint></robot>";
  const std::string out = text(m, "o.urdf");
  EXPECT_TRUE(holds(out, "<inertia ixx=\"1\" iyy=\"2\" izz=\"3\" ixy=\"0\" ixz=\"0\" iyz=\"0\""));
  EXPECT_TRUE(holds(out, "<limit lower=\"-1\" effort=\"1e+06\" velocity=\"1e+06\""));
}

// 0 would let a joint have no speed and no force.
TEST_F(RobotsTest, UnknownLimitsOfAUrdfLimitNothing) {
  Model m = arm();
  m.bodies[1].joint.effort = 3;
  m.bodies[4].joint.lower = Joint().lower, m.bodies[4].joint.upper = Joint().upper;
  const std::string out = text(m, "o.urdf");
  EXPECT_TRUE(holds(out, "upper=\"0.25\" effort=\"3\" velocity=\"1e+06\""));
  EXPECT_TRUE(holds(out, "<limit lower=\"-1e+06\" upper=\"1e+06\" effort=\"1e+06\""));
}

TEST_F(RobotsTest, CuroboNamesAUrdfThatItCanRead) {
  Model m = arm();
  for (const auto& [file, urdf, named] : {std::tuple("a.urdf", "", "a.urdf"),
                                          {"a.urdf", "b.urdf", "a.urdf"},
                                          {"a.xml", "", "a.urdf"},
                                          {"a.urdf.xacro", "b.urdf", "b.urdf"}}) {
    m.file = file;
    const auto warnings = write_model(m, folder_ / "o.yaml", find_format("o.yaml"), {.urdf = urdf});
    EXPECT_TRUE(holds(read_file(folder_ / "o.yaml"), "urdf_path: \"" + std::string(named) + "\"\n"))
        << file << " " << urdf;
    EXPECT_EQ(warnings.size(), std::string(file) == "a.xml" ? 1u : 0u);
  }
}

TEST_F(RobotsTest, PosesOfJointsSurviveTheirAngles) {
  Model m = arm();
  for (const Vector& angles :
       {Vector(0.1, 0.2, 0.3), Vector(1, std::numbers::pi / 2, 0), Vector(-3, -1.5, 3)}) {
    const Eigen::Matrix3d turn =
        (Eigen::AngleAxisd(angles.z(), Vector::UnitZ()) * Eigen::AngleAxisd(angles.y(), Vector::UnitY()) *
         Eigen::AngleAxisd(angles.x(), Vector::UnitX()))
            .toRotationMatrix();
    m.bodies[1].pose.linear() = turn;
    const std::string urdf = text(m, "a.urdf");
    const auto at = urdf.find("rpy=\"");
    double r, p, y;
    ASSERT_EQ(std::sscanf(urdf.c_str() + at, "rpy=\"%lf %lf %lf", &r, &p, &y), 3);
    const Eigen::Matrix3d back =
        (Eigen::AngleAxisd(y, Vector::UnitZ()) * Eigen::AngleAxisd(p, Vector::UnitY()) *
         Eigen::AngleAxisd(r, Vector::UnitX()))
            .toRotationMatrix();
    EXPECT_LT((back - turn).norm(), 1e-9);
  }
}

// PyYAML, which cuRobo reads with, is stricter about numbers than yaml-cpp.
TEST_F(RobotsTest, PyYamlReadsNumbersAndPairs) {
  if (!python_has("yaml")) GTEST_SKIP() << "python3-yaml is not installed";
  Model m = arm();
  m.bodies[0].cluster.centers[0] = {1e-5, -2e-9, 1e22};
  m.bodies[0].cluster.radii[0] = 5e-7;
  m.bodies[1].name = "yes: \"quoted\" # link";
  m.bodies[4].joint.lower = 0.1, m.bodies[4].joint.upper = 0.15;
  write(m, "a.yaml"), write(m, "a.xrdf");
  EXPECT_EQ(python(R"(
import yaml
c = yaml.safe_load(open("a.yaml"))["robot_cfg"]["kinematics"]
x = yaml.safe_load(open("a.xrdf"))
s = c["collision_spheres"]
assert s == x["geometry"]["arm_spheres"]["spheres"]
assert s["base"][0] == {"center": [1e-5, -2e-9, 1e22], "radius": 5e-7}, s["base"][0]
assert all(isinstance(v, (int, float)) for link in s.values() for b in link for v in b["center"] + [b["radius"]])
ignore = {'base': ['yes: "quoted" # link', 'hand'], 'yes: "quoted" # link': ['hand', 'finger'], 'hand': ['finger']}
assert c["self_collision_ignore"] == ignore == x["self_collision"]["ignore"], c["self_collision_ignore"]
assert c["collision_link_names"] == list(s)
assert x["format"] == "xrdf" and x["format_version"] == 1.0
assert x["collision"]["geometry"] == x["self_collision"]["geometry"] == "arm_spheres"
# What cuRobo's reader of XRDF asks for: joints, their limits and defaults of one length each, a frame of the tool.
joints = ["upper_joint", "finger_joint"]
assert x["cspace"]["joint_names"] == joints == c["cspace"]["joint_names"] == list(x["default_joint_positions"])
for key in ("acceleration_limits", "jerk_limits"):
    assert len(x["cspace"][key]) == 2 and all(isinstance(v, float) for v in x["cspace"][key])
assert x["tool_frames"] == ["finger"] == c["tool_frames"]
assert x["modifiers"] == [{"set_base_frame": "base"}] and c["base_link"] == "base"
for key in ("default_joint_position", "null_space_weight", "cspace_distance_weight"):
    assert len(c["cspace"][key]) == 2
assert c["cspace"]["default_joint_position"] == [0, 0.125]  # 0 is beyond the finger's limits: the middle
print("well")
)"),
            "well");
}

TEST_F(RobotsTest, FilesByHand) {
  const auto read = [&](const std::string& file, const std::string& content, const std::string& part = {}) {
    write_file(folder_ / file, content);
    return read_spheres(folder_ / file, part);
  };
  const std::string whole =
      "robot_cfg:\n  kinematics:\n    collision_spheres:\n      hand:\n      - center: [0, 1, 2]\n        "
      "radius: 0.5\n";
  EXPECT_EQ(read("w.yml", whole).centers[0], Point(0, 1, 2));
  EXPECT_EQ(read("w.yml", whole.substr(whole.find('\n') + 1)).centers[0], Point(0, 1, 2));
  const Cluster some = read("w.yml",
                            "collision_spheres: {hand: [{center: [0, 1, 2], radius: 1}, {center: [0, 0, 0], "
                            "radius: -10}]}");
  EXPECT_EQ(some.size(), 1u);
  EXPECT_EQ(read_sphere_model(folder_ / "w.yml").switched_off, 1u);
  EXPECT_EQ(read("u.urdf",
                 "<robot name='r'><link name='a'><collision><geometry><sphere "
                 "radius='2'/></geometry></collision><collision>"
                 "<geometry><box size='1 1 1'/></geometry></collision></link></robot>")
                .radii[0],
            2);
  EXPECT_EQ(read("m.xml",
                 "<mujoco><worldbody><geom type='plane' size='1 1 1'/><body name='a'><body name='b'><geom "
                 "size='.5' pos='1 2 "
                 "3'/><geom type='box' size='1 1 1'/></body></body></worldbody></mujoco>")
                .centers[0],
            Point(1, 2, 3));
  for (const char* wrong : {"robot_cfg: {kinematics: {collision_spheres: spheres/franka.yml}}",
                            "collision_spheres: {hand: [{center: [0, 1], radius: 1}]}",
                            "collision_spheres: {hand: [{center: [0, 1, x], radius: 1}]}",
                            "collision_spheres: {hand: [{center: [0, 1, 2], radius: 0}]}",
                            "collision_spheres: {hand: 5}", "collision_spheres: {}", "[1, 2", "5", ""})
    EXPECT_THROW(read("w.yml", wrong), Error) << wrong;
  for (const char* wrong : {"<robot><link name='a'>", "<robots/>",
                            "<robot><link name='a'><collision><origin xyz='1 2'/><geometry><sphere "
                            "radius='2'/></geometry></collision></link></robot>",
                            "<robot><link name='a'><collision><geometry><sphere "
                            "radius='two'/></geometry></collision></link></robot>"})
    EXPECT_THROW(read("u.urdf", wrong), Error) << wrong;
}

// What a file says twice is not chosen from, what it nests is bounded, and none of it comes back at length or
// in a library's words.
TEST_F(RobotsTest, HostileFilesEndInAShortSentence) {
  const std::string large(1000000, 'k'), sphere = "[{center: [0, 1, 2], radius: 1}]";
  const auto deep = [](const std::string& open, const std::string& close) {
    std::string out;
    for (int k = 0; k < 100000; k++) out += open;
    for (int k = 0; k < 100000; k++) out += close;
    return out;
  };
  const std::string body = "<collision><geometry><sphere radius='1'/></geometry></collision>";
  const std::tuple<const char*, std::string, const char*> table[] = {
      {"a.yaml", "collision_spheres: {h: " + sphere + ", h: " + sphere + "}", "the link 'h' is listed twice"},
      {"a.yaml", "collision_spheres: {h: " + sphere + "}\ncollision_spheres: {g: " + sphere + "}",
       "line 2: the key 'collision_spheres' stands twice"},
      {"a.yaml", "collision_spheres: {h: [{center: [0, 1, 2], radius: 1, radius: 2}]}",
       "the key 'radius' stands twice"},
      {"a.yaml", "geometry: {g: {spheres: {h: " + sphere + ", h: " + sphere + "}}}",
       "the link 'h' is listed twice"},
      {"a.yaml", "collision_spheres: " + large, "names another file, 'kkk"},
      {"a.yaml", "collision_spheres: [1, 2", "not YAML: check that the file is whole"},
      {"a.yaml", deep("[", "]"), "a.yaml"},
      {"a.urdf", "<robot><link name='a' name='b'>" + body + "</link></robot>",
       "has the attribute 'name' twice"},
      {"a.urdf",
       "<robot><link name='" + large +
           "'><collision><geometry><sphere radius='x'/></geometry></collision></link></robot>",
       "a sphere of 'kkk"},
      {"a.urdf", "<robot><link name='a'>\n<</robot>", "not XML at byte"},
      {"a.xml", "<mujoco><worldbody>" + deep("<body>", "</body>") + "</worldbody></mujoco>",
       "nested deeper than 256 levels"}};
  for (const auto& [file, content, words] : table) {
    write_file(folder_ / file, content);
    const std::string sentence = error_of([&, name = file] { read_spheres(folder_ / name); });
    EXPECT_TRUE(holds(sentence, words)) << content.substr(0, 200) << "\n" << sentence.substr(0, 400);
    EXPECT_LT(sentence.size(), 300u + folder_.string().size());
  }
  const std::string two =
      "<mujoco><worldbody><body name='a'><geom size='1'/></body><body name='a'><geom "
      "size='2'/></body></worldbody></mujoco>";
  write_file(folder_ / "two.xml", two);
  EXPECT_THROW(read_spheres(folder_ / "two.xml", "a"), Error);
  for (const char* ending : {"json", "csv", "npz", "vtp", "yaml", "urdf", "xml", "txt"}) {
    const fs::path link = folder_ / (std::string("zero.") + ending);
    fs::create_symlink("/dev/zero", link);
    EXPECT_THROW(read_spheres(link), Error) << ending;
  }
}

}  // namespace
}  // namespace padder::samples
