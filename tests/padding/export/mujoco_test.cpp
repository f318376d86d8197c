// MJCF in MuJoCo itself: padding/export/mujoco.cpp.
#include <mujoco/mujoco.h>

#include <algorithm>
#include <set>

#include "padding/error.h"
#include "padding/export/families.h"
#include "tests/padding/export/samples.h"

namespace padder::samples {
namespace {

class MujocoTest : public ExportTest {
 protected:
  void load(const Model& model) {
    char error[1000] = "";
    std::string xml = text(model, "m.xml");  // 100 contacts are MuJoCo 2.2's own limit
    xml.insert(xml.find("  <default>"), "  <size nconmax=\"5000\" njmax=\"3000\"/>\n");
    write_file(folder_ / "m.xml", xml);
    m_ = mj_loadXML((folder_ / "m.xml").c_str(), nullptr, error, sizeof error);
    ASSERT_NE(m_, nullptr) << error << "\n" << read_file(folder_ / "m.xml");
    EXPECT_STREQ(error, "");
    d_ = mj_makeData(m_);
    mj_forward(m_, d_);
  }
  void TearDown() override {
    mj_deleteData(d_), mj_deleteModel(m_);
    ExportTest::TearDown();
  }
  std::set<std::pair<int, int>> touching_bodies() const {  // numbered from 0: MuJoCo's 0 is the world
    std::set<std::pair<int, int>> pairs;
    for (int k = 0; k < d_->ncon; k++) {
      const int a = m_->geom_bodyid[d_->contact[k].geom1] - 1, b = m_->geom_bodyid[d_->contact[k].geom2] - 1;
      pairs.insert(std::minmax(a, b));
    }
    return pairs;
  }
  mjModel* m_ = nullptr;
  mjData* d_ = nullptr;
};

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
  std::set<std::pair<int, int>> expected;
  for (int i = 0; i < int(filters.size()); i++)
    for (int j = i + 1; j < int(filters.size()); j++)
      if (may_touch(filters[std::size_t(i)], filters[std::size_t(j)])) expected.emplace(i, j);
  EXPECT_EQ(touching_bodies(), expected);
  EXPECT_GT(expected.size(), 50u);
}

TEST_F(MujocoTest, AllThirtyTwoBitsAreUsedAndNoMore) {
  std::vector<CollisionFilter> chain;  // each masks the one before: no two alike
  for (std::uint32_t k = 1; k <= 32; k++) chain.push_back({k, k == 1 ? 0 : 1u << (k - 2)});
  load(heap(chain));
  std::set<std::pair<int, int>> expected;
  for (int i = 0; i < 32; i++)
    for (int j = i + 2; j < 32; j++) expected.emplace(i, j);
  EXPECT_EQ(touching_bodies(), expected);
  chain.push_back({33, 1});
  fs::remove(folder_ / "m.xml");
  EXPECT_THROW(write(heap(chain), "m.xml"), Error);
  EXPECT_FALSE(fs::exists(folder_ / "m.xml"));
}

TEST_F(MujocoTest, ARobotsJoints) {
  load(arm());
  EXPECT_EQ(m_->nbody, 6);
  EXPECT_EQ(m_->nv, 6 + 2);  // free root (no URDF behind it), one hinge, one slide
  const int hinge = mj_name2id(m_, mjOBJ_JOINT, "upper_joint"),
            slide = mj_name2id(m_, mjOBJ_JOINT, "finger_joint");
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

TEST_F(MujocoTest, EveryTypeOfJointAndNoMassAtAll) {
  for (const auto type : {Joint::Type::continuous, Joint::Type::planar, Joint::Type::floating}) {
    Model m = arm();
    m.bodies[1].joint.type = type;
    for (Body& b : m.bodies) b.cluster.mass = {};
    load(m);
    EXPECT_EQ(m_->nv, (type == Joint::Type::continuous ? 1 : type == Joint::Type::planar ? 3 : 6) + 1);
    mj_deleteData(d_), mj_deleteModel(m_);
    d_ = nullptr, m_ = nullptr;
  }
}

}  // namespace
}  // namespace padder::samples
