// SPDX-License-Identifier: MIT
// MJCF in MuJoCo itself: padding/export/mujoco.cpp.
#include <algorithm>
#include <optional>
#include <set>

#include "padding/asset/error.h"
#include "padding/export/families.h"
#include "tests/error_of.h"
#include "tests/padding/export/samples.h"
#include "tests/padding/in_mujoco.h"

namespace padder::samples {
namespace {

class MujocoTest : public ExportTest {
 protected:
  void load(const Model& model) {
    std::string xml = text(model, "m.xml");  // 100 contacts are MuJoCo 2.2's own limit
    xml.insert(xml.find("  <default>"), "  <size nconmax=\"5000\" njmax=\"3000\"/>\n");
    load_xml(xml);
  }
  void load_xml(const std::string& xml) {
    write_file(folder_ / "m.xml", xml);
    loaded_.emplace(folder_ / "m.xml");
    EXPECT_EQ(loaded_->warning, "");
    m_ = loaded_->model, d_ = loaded_->data;
    mj_forward(m_, d_);
  }
  std::set<std::pair<int, int>> touching_bodies() const {  // numbered from 0: MuJoCo's 0 is the world
    std::set<std::pair<int, int>> pairs;
    for (int k = 0; k < d_->ncon; k++) {
      const int a = m_->geom_bodyid[d_->contact[k].geom1] - 1, b = m_->geom_bodyid[d_->contact[k].geom2] - 1;
      pairs.insert(std::minmax(a, b));
    }
    return pairs;
  }
  std::optional<InMujoco> loaded_;
  mjModel* m_ = nullptr;
  mjData* d_ = nullptr;
};

// The pairs of bodies that our rule lets touch.
std::set<std::pair<int, int>> touching(const std::vector<CollisionFilter>& filters) {
  std::set<std::pair<int, int>> pairs;
  for (std::size_t i = 0; i < filters.size(); i++)
    for (std::size_t j = i + 1; j < filters.size(); j++)
      if (may_touch(filters[i], filters[j])) pairs.emplace(i, j);
  return pairs;
}

// The bodies of an MJCF.
std::string in_world(const std::string& xml) {
  const auto from = xml.find("<worldbody>\n") + 12;
  return xml.substr(from, xml.find("  </worldbody>") - from);
}

// Bodies on one spot, a filter each: MuJoCo's contacts must be the pairs of our rule.
Model heap(const std::vector<CollisionFilter>& filters) {
  Model m;
  m.name = "heap";
  for (std::size_t k = 0; k < filters.size(); k++) {
    Body b;
    b.name = "b" + std::to_string(k);
    b.cluster = brick();
    b.cluster.centers.resize(1), b.cluster.radii.resize(1);
    b.cluster.centers[0] += 0.001 * double(k) * Vector(1, 0.3, 0.7);
    b.cluster.family = filters[k].family, b.cluster.mask = filters[k].mask;
    m.bodies.push_back(b);
  }
  return m;
}

// MuJoCo's own answer is what 2.2.2 reads. A longer chain is written with a warning, until no version reads
// it.
TEST_F(MujocoTest, AChainThatIsTooLongForItsReaderIsTold) {
  const auto chain = [](int bodies) {
    Model m;
    m.name = "chain";
    for (int k = 0; k < bodies; k++) {
      Body b = heap({{0, 0}}).bodies[0];
      b.name = "b" + std::to_string(k), b.parent = k - 1;
      b.pose = Eigen::Translation3d(1, 0, 0);  // no two touch
      b.joint.name = "j" + std::to_string(k), b.joint.type = Joint::Type::revolute;
      m.bodies.push_back(std::move(b));
    }
    return m;
  };
  const auto told = [&](int bodies) {
    return write_model(chain(bodies), folder_ / "m.xml", find_format("m.xml", ""));
  };
  load(chain(96));
  EXPECT_TRUE(told(96).empty());
  ASSERT_EQ(told(97).size(), 1u);
  EXPECT_TRUE(holds(told(97)[0], "MuJoCo 2.2 reads 96"));
  EXPECT_THROW(InMujoco(folder_ / "m.xml"), Error);
  EXPECT_TRUE(refuses([&] { told(5000); }, "a chain of 5000"));
}

TEST_F(MujocoTest, AFreeBodyWithTheTrueMass) {
  load(model_of(brick()));
  EXPECT_EQ(m_->ngeom, 3);
  EXPECT_EQ(m_->nv, 6);
  EXPECT_NEAR(m_->body_mass[1], 48, 1e-9);
  std::sort(m_->body_inertia + 3, m_->body_inertia + 6);
  EXPECT_NEAR(m_->body_inertia[3], 4 * 0.20, 1e-6);
  EXPECT_NEAR(m_->body_inertia[5], 4 * 0.52, 1e-6);
  EXPECT_LT((Point(m_->body_ipos[3], m_->body_ipos[4], m_->body_ipos[5]) - Point(1, 2, 3)).norm(), 1e-9);
  for (int k = 0; k < 3; k++) EXPECT_EQ(m_->geom_size[3 * k], brick().radii[static_cast<std::size_t>(k)]);
}

TEST_F(MujocoTest, TheTruthTableOfFamilies) {
  std::vector<CollisionFilter> filters;
  for (const std::uint32_t family : {0u, 1u, 2u, 32u, 33u, 34u})
    for (const std::uint32_t mask : {0u, 1u, 2u, 0x80000000u, 3u}) filters.push_back({family, mask});
  load(heap(filters));
  const auto expected = touching(filters);
  EXPECT_EQ(touching_bodies(), expected);
  EXPECT_GT(expected.size(), 50u);
}

TEST_F(MujocoTest, FamilyAndMaskComeBack) {
  Cluster c = brick();
  c.family = 5, c.mask = 3;
  const Cluster back = read_spheres(write(model_of(c), "b.xml"));
  EXPECT_EQ(back.family, 5u);
  EXPECT_EQ(back.mask, 3u);
  EXPECT_EQ(back.unit, "m");
  // Geoms of other programs' bits say nothing about families.
  write_file(folder_ / "h.xml",
             "<mujoco><worldbody><body name='a'><geom size='1' contype='4'/><geom size='2' contype='8'/>"
             "</body></worldbody></mujoco>");
  EXPECT_EQ(read_spheres(folder_ / "h.xml").family, 0u);
}

TEST_F(MujocoTest, MoreFamiliesThanBitsInOneFile) {
  std::vector<CollisionFilter> chain;  // each masks the one before: no two alike
  for (std::uint32_t k = 1; k <= 32; k++) chain.push_back({k, k == 1 ? 0 : 1u << (k - 2)});
  for (const std::uint32_t k : {40u, 40u, 41u}) chain.push_back({k, 1u << 31});
  load(heap(chain));
  const auto expected = touching(chain);
  EXPECT_EQ(touching_bodies(), expected);
  EXPECT_EQ(expected.count({32, 33}), 0u);
  for (const std::uint32_t family : {31u, 33u})  // alone, with nothing in the file to be kept from
    EXPECT_THROW(write(heap({{family, 0}}), "one.xml"), Error);
  EXPECT_FALSE(fs::exists(folder_ / "one.xml"));
}

// Parts written to a file each and put into one world, where a ball of MuJoCo's own lies too.
TEST_F(MujocoTest, PartsOfSeveralFilesKnowEachOther) {
  std::vector<CollisionFilter> filters{{0, 0}, {0, 0}, {1, 0},       {1, 0},       {3, 0},  {3, 0},
                                       {0, 4}, {0, 5}, {4, 1u << 4}, {5, 1u << 3}, {30, 0}, {0, 1u << 29}};
  std::string bodies = "    <body name=\"own\"><freejoint/><geom size=\"0.5\" pos=\"1 2 3\"/></body>\n";
  for (std::size_t k = 0; k < filters.size(); k++) {
    Model m = heap({filters[k]});
    m.bodies[0].name = "b" + std::to_string(k);
    const std::string xml = text(m, "part.xml");
    EXPECT_EQ(xml.find("<exclude"), std::string::npos);
    bodies += in_world(xml);
  }
  load_xml("<mujoco><size nconmax=\"5000\" njmax=\"3000\"/><worldbody>\n" + bodies + "</worldbody></mujoco>");
  filters.insert(filters.begin(), {0, 0});  // the ball's
  EXPECT_EQ(touching_bodies(), touching(filters));
}

// Two balls, one above the other, and the lower is fixed: the upper falls through what it may not touch.
TEST_F(MujocoTest, FamiliesDecideWhatFallsThrough) {
  for (const auto& [a, b] : {std::pair(CollisionFilter{0, 0}, CollisionFilter{0, 0}),
                             {{1, 0}, {3, 0}},
                             {{3, 0}, {3, 0}},
                             {{0, 4}, {3, 0}},
                             {{0, 4}, {2, 0}},
                             {{0, 0}, {3, 4}}}) {
    std::string bodies;
    for (const auto& [f, z] : {std::pair(a, 0.0), {b, 0.5}}) {
      Model m = heap({f});
      m.bodies[0].name = z > 0 ? "upper" : "lower";
      m.bodies[0].cluster.centers[0] = m.bodies[0].cluster.mass.center;
      m.bodies[0].pose.translation() = Vector(0, 0, z) - m.bodies[0].cluster.mass.center;
      std::string xml = in_world(text(m, "part.xml"));
      if (z == 0) xml.erase(xml.find("<freejoint/>"), 12);
      bodies += xml;
    }
    load_xml("<mujoco><worldbody>\n" + bodies + "</worldbody></mujoco>");
    for (int step = 0; step < 1000; step++) mj_step(m_, d_);
    const int upper = loaded_->id(mjOBJ_BODY, "upper");
    const double fallen = 0.5 - d_->xipos[3 * upper + 2];
    EXPECT_EQ(fallen < 1, may_touch(a, b)) << a.family << " " << b.family << " " << fallen;
  }
}

TEST_F(MujocoTest, ARobotMeetsWhatIsOutsideIt) {
  Model robot = arm();
  robot.urdf = "<robot name='arm'/>";  // as one that was read: its families are about its links alone
  const std::string xml = text(robot, "robot.xml");
  EXPECT_EQ(xml.find("contype=\"2\""), std::string::npos);
  EXPECT_TRUE(holds(xml, "<exclude body1=\"base\" body2=\"upper\"/>"));
  load(robot);
  EXPECT_EQ(touching_bodies().count({0, 1}), 0u);
}

TEST_F(MujocoTest, ARobotsJoints) {
  load(arm());
  EXPECT_EQ(m_->nbody, 6);
  EXPECT_EQ(m_->nv, 6 + 2);  // free root (no URDF behind it), one hinge, one slide
  const int hinge = loaded_->id(mjOBJ_JOINT, "upper_joint"), slide = loaded_->id(mjOBJ_JOINT, "finger_joint");
  EXPECT_EQ(m_->jnt_type[hinge], mjJNT_HINGE);
  EXPECT_EQ(m_->jnt_type[slide], mjJNT_SLIDE);
  EXPECT_EQ(m_->jnt_range[2 * slide], -0.5);
  EXPECT_TRUE(m_->jnt_limited[slide]);
  // At 0 each body stands where the poses put it.
  const Model a = arm();
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  for (int k = 0; k < 5; k++) {
    pose = pose * a.bodies[std::size_t(k)].pose;
    const double* x = d_->xpos + 3 * (k + 1);
    EXPECT_LT((Point(x[0], x[1], x[2]) - pose.translation()).norm(), 1e-9) << k;
  }
  EXPECT_EQ(touching_bodies().count({0, 1}), 0u);
}

// A gripper whose second finger follows the first, in MuJoCo's own steps: a motor moves both.
TEST_F(MujocoTest, MimicDampingFrictionAndMotors) {
  Model m = arm();
  m.urdf = "<robot name='arm'/>";
  Body other = m.bodies[4];
  other.name = "other", other.joint.name = "other_joint";
  other.joint.mimic = "finger_joint", other.joint.multiplier = -0.5, other.joint.offset = 0.03;
  other.joint.lower = -1, other.joint.upper = 1;
  m.bodies.push_back(other);
  m.bodies[4].joint.effort = 2000, m.bodies[4].joint.damping = 700, m.bodies[4].joint.friction = 3;
  m.bodies[1].joint.effort = 87;
  for (std::size_t a = 0; a < m.bodies.size(); a++)  // nothing but the joints moves anything
    for (std::size_t b = a + 1; b < m.bodies.size(); b++) m.apart.push_back({a, b});
  load(m);
  ASSERT_EQ(m_->neq, 1);
  ASSERT_EQ(m_->nu, 2);  // not of the follower
  const int finger = loaded_->id(mjOBJ_JOINT, "finger_joint"),
            follower = loaded_->id(mjOBJ_JOINT, "other_joint"),
            motor = loaded_->id(mjOBJ_ACTUATOR, "finger_joint");
  ASSERT_GE(motor, 0);
  EXPECT_EQ(m_->dof_damping[m_->jnt_dofadr[finger]], 700);
  EXPECT_EQ(m_->dof_frictionloss[m_->jnt_dofadr[finger]], 3);
  EXPECT_EQ(m_->actuator_ctrlrange[2 * motor + 1], 2000);
  m_->opt.gravity[2] = 0;
  d_->ctrl[motor] = 20;
  for (int step = 0; step < 1000; step++) mj_step(m_, d_);
  const double x = d_->qpos[m_->jnt_qposadr[finger]], y = d_->qpos[m_->jnt_qposadr[follower]];
  EXPECT_GT(x, 0.01);
  EXPECT_NEAR(y, 0.03 - 0.5 * x, 0.005);
}

// The list of pairs has no limit of 32: a robot of 80 parts around one, of which no two may touch.
TEST_F(MujocoTest, PairsBeyondEveryFamilyAreExcluded) {
  Model m = heap(std::vector<CollisionFilter>(80));
  m.urdf = "<robot name='heap'/>";
  for (Body& b : m.bodies)
    b.joint.type = Joint::Type::continuous, b.joint.name = b.name;  // MuJoCo skips what stands
  for (std::size_t a = 0; a < 80; a++)
    for (std::size_t b = a + 1; b < 80; b++)
      if (a % 3 != 1 || b % 3 != 1) m.apart.push_back({b, a, "Never"});
  load(m);
  for (const auto& [a, b] : touching_bodies()) EXPECT_TRUE(a % 3 == 1 && b % 3 == 1) << a << " " << b;
  EXPECT_GT(touching_bodies().size(), 0u);
  EXPECT_TRUE(holds(text(m, "h.srdf"), "reason=\"Never\""));
  m.apart = {{0, 1}};
  EXPECT_THROW(write(m, "h.h", "chrono"), Error);  // before a link is padded: check_filters
}

// As the Allegro hand's: one moment above the sum of the others.
TEST_F(MujocoTest, MomentsThatNoBodyHasAreBalanced) {
  Model m = arm();
  m.bodies[1].inertial = Inertial{2, Point(0, 0, 0.1), Vector(1, 1, 7).asDiagonal()};
  load(m);
  const int upper = loaded_->id(mjOBJ_BODY, "upper");
  EXPECT_EQ(m_->body_mass[upper], 2);
  for (int k = 0; k < 3; k++) EXPECT_NEAR(m_->body_inertia[3 * upper + k], 3, 1e-9);
  EXPECT_EQ(text(arm(), "a.xml").find("balanceinertia"), std::string::npos);
}

// As those of Fetch's fingers and Sawyer's hand: a mass in a point, on a line, and moments below 0.
TEST_F(MujocoTest, MassesWithoutMomentsAreTaken) {
  for (const Vector& moments : {Vector(0, 0, 0), Vector(0, 2, 2), Vector(-1e-9, 1, 1), Vector(1e-14, 1, 1)}) {
    Model m = arm();
    const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.5, Vector(1, 2, 3).normalized()).toRotationMatrix();
    m.bodies[1].inertial = Inertial{2, Point(0, 0, 0.1), turn * moments.asDiagonal() * turn.transpose()};
    load(m);
    const int upper = loaded_->id(mjOBJ_BODY, "upper");
    EXPECT_EQ(m_->body_mass[upper], 2);
    double largest = 0;
    for (int k = 0; k < 3; k++) largest = std::max(largest, m_->body_inertia[3 * upper + k]);
    EXPECT_NEAR(largest, moments.maxCoeff(), 1e-6);
  }
}

TEST_F(MujocoTest, EveryTypeOfJointAndNoMassAtAll) {
  for (const auto& [type, ways] : {std::pair(Joint::Type::continuous, 1),
                                   {Joint::Type::planar, 3},
                                   {Joint::Type::ball, 3},
                                   {Joint::Type::floating, 6}}) {
    Model m = arm();
    m.bodies[1].joint.type = type;
    for (Body& b : m.bodies) b.cluster.mass = {};
    for (const bool stated : {false, true}) {  // a mass of 0, as URDFs have it for links without one
      for (Body& b : m.bodies)
        if (stated && b.parent >= 0) b.inertial = Inertial{};
      load(m);
      EXPECT_EQ(m_->nv, ways + 1);
    }
  }
}

}  // namespace
}  // namespace padder::samples
