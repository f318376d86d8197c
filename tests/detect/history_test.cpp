// SPDX-License-Identifier: MIT
// Contacts::history beside a map from the pairs of the list before to their indices, on every backend: long
// lists, and what the model test (model/detector_model_test.cpp) has no scenes for.
#include <map>
#include <numbers>

#include "detect/core/nine_stages.h"
#include "tests/detect/oracle.h"
#include "tests/detect/some_cases.h"

namespace padder::detect {
namespace {

using Index = std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t>;

class HistoryTest : public BackendTest {
 protected:
  void SetUp() override {
    BackendTest::SetUp();
    if (IsSkipped()) return;
    options_.history = true;
    detector_ = std::make_unique<Detector>(device_, options_);
  }

  double unit() { return detect::unit(random_); }

  // Detects, and compares the history with what the list of the call before says.
  void expect_right(const Input& input) {
    const Contacts& c = detector_->detect(input);
    const auto history = c.history_span();
    ASSERT_EQ(history.size(), c.count);
    Index index;
    known_ = 0;
    for (std::uint32_t k = 0; k < c.count; k++) {
      const Pair p = c.pairs[k];
      const auto found = before_.find({p.i, p.j});
      ASSERT_EQ(history[k], found == before_.end() ? kNoContact : found->second) << p;
      known_ += found != before_.end(), index[{p.i, p.j}] = k;
    }
    before_.swap(index);
  }

  void expect_right(const TestScene& scene, Scalar scalar = Scalar::f32) {
    expect_right(Arranged(scene, scalar).input);
  }

  std::mt19937_64 random_ = random_of_new_seed();
  const std::uint32_t seed_ = static_cast<std::uint32_t>(random_());
  std::unique_ptr<Detector> detector_;
  Index before_;
  std::uint64_t known_ = 0;  // contacts of the last call that the list before has
};

TEST_P(HistoryTest, IsAllThereForTheSameSceneAndEmptyAfterACallWithoutContacts) {
  const TestScene scene = random_scene(1000, 1, 0.6, seed_);
  const Arranged a(scene, Scalar::f32);
  expect_right(a.input), expect_right(a.input);
  EXPECT_GT(known_, 0u);
  EXPECT_EQ(known_, before_.size());

  for (const Input& staged : {a.input, Input{}}) {
    detector_->stages(staged);
    before_.clear(), expect_right(a.input);
  }
  detector_->detect_worlds(a.input, 1, Answer::count);
  before_.clear(), expect_right(a.input);
  detector_->options().threads = -1;
  EXPECT_THROW(detector_->detect(a.input), Error);
  detector_->options().threads = 1;
  before_.clear(), expect_right(a.input);
  TestScene broken = scene;
  broken.spheres[7].r = -1;
  const Arranged b(broken, Scalar::f32);
  EXPECT_THROW(detector_->detect(b.input), Error);
  before_.clear(), expect_right(a.input);
  expect_right(a.input);
  EXPECT_EQ(known_, before_.size());
}

// Most pairs stay near their place in the list while spheres move a little. When the axes change places, all
// spheres keep their numbers and nearly all pairs, but the list has another order.
TEST_P(HistoryTest, FollowsALongListThroughAnotherOrder) {
  TestScene scene = random_scene(60000, 1, 0.6, seed_);
  for (int step = 0; step < 4; step++) {
    for (Sphere& s : scene.spheres) {
      if (step == 2) std::swap(s.x, s.z);
      s.x += 0.02 * (unit() - 0.5), s.y += 0.02 * (unit() - 0.5), s.z += 0.02 * (unit() - 0.5);
    }
    detector_->options().order = step % 2 ? Order::any : Order::stable;
    SCOPED_TRACE("step " + std::to_string(step));
    expect_right(scene);
    if (HasFatalFailure()) return;
    if (step > 0) {
      EXPECT_GT(known_, before_.size() / 10 * 9);
    }
    EXPECT_GT(before_.size(), 50000u);
  }
}

// The shorter list goes into a table where many pairs have left their place.
TEST_P(HistoryTest, FollowsAShortListAfterALongOneAndBack) {
  TestScene scene = random_scene(20000, 1, 0.6, seed_);
  for (const double by : {1.0, 0.4, 2.5, 0.4, 0.9, 1 / 0.36}) {
    for (Sphere& s : scene.spheres) std::swap(s.x, s.z), s.r *= by;
    SCOPED_TRACE("radii times " + std::to_string(by));
    expect_right(scene);
    if (HasFatalFailure()) return;
  }
  EXPECT_GT(known_, 100u);
}

// On a GPU contacts have slots that follow from how many there were in the calls before.
TEST_P(HistoryTest, TheListIsThatOfAPlainCallWhileContactsBecomeFewer) {
  const bool cuda = GetParam() == BackendKind::cuda;
  for (const double ratio : {1.0, 8.0}) {
    TestScene scene = random_scene(cuda ? 180000 : 20000, ratio, 0.6, seed_);
    Detector plain(device_);
    detector_->options().order = plain.options().order = Order::any;
    SomeCases some;
    for (int step = 0; step < (cuda ? 40 : 4); step++) {
      for (Sphere& s : scene.spheres) s.r *= 0.998;
      if (some.left_out()) continue;
      const Arranged a(scene, Scalar::f32);
      SCOPED_TRACE("step " + std::to_string(step) + ", radii 1 to " + std::to_string(ratio));
      ASSERT_EQ(detector_->detect(a.input).count, plain.detect(a.input).count);
      ASSERT_EQ(detector_->hash(), plain.hash());
    }
  }
}

// On a GPU the marks of pairs that were found carry the number of the pass in a byte.
TEST_P(HistoryTest, FollowsThroughMoreCallsThanAMarkCanNumber) {
  TestScene scene = random_scene(3000, 1, 0.6, seed_);
  const int steps = GetParam() == BackendKind::cuda ? 300 : 30;
  for (int step = 0; step < steps; step++) {
    for (Sphere& s : scene.spheres) std::swap(s.x, s.z), s.y += 0.02 * (unit() - 0.5);
    SCOPED_TRACE("step " + std::to_string(step));
    expect_right(scene);
    if (HasFatalFailure()) return;
  }
  EXPECT_GT(known_, 1500u);  // more than a window
}

// A sphere that touches all others has as many contacts as there are spheres.
TEST_P(HistoryTest, FollowsOneSphereThatTouchesAllOthers) {
  TestScene scene;
  scene.spheres.push_back({0, 0, 0, 100});
  for (int k = 0; k < 20000; k++) {
    const double z = 2 * unit() - 1, t = 2 * std::numbers::pi * unit(), c = 100 * std::sqrt(1 - z * z);
    scene.spheres.push_back({c * std::cos(t), c * std::sin(t), 100 * z, 0.1});
  }
  expect_right(scene, Scalar::f64);
  scene.spheres[0].r = 99.95;
  expect_right(scene, Scalar::f64);
  EXPECT_GE(known_, 20000u);
}

TEST_P(HistoryTest, SurvivesALimitThatMakesTheDetectorGiveMemoryBack) {
  const TestScene scene = random_scene(1000, 1, 0.6, seed_);
  const Arranged small(scene, Scalar::f32), large(random_scene(200000, 1, 3, seed_), Scalar::f32);
  expect_right(large.input);
  const std::uint64_t held = detector_->memory();
  expect_right(small.input);
  detector_->options().memory_limit = held - 1;
  expect_right(small.input);
  EXPECT_EQ(known_, before_.size());
  EXPECT_LT(detector_->memory(), held);
}

ON_EVERY_BACKEND(HistoryTest);

}  // namespace
}  // namespace padder::detect
