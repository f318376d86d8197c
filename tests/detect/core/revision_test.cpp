// SPDX-License-Identifier: MIT
// What Input::revision promises, on every backend and path: where bodies are that are not said to have moved,
// and what happens after a call that threw.

#include "detect/core/revision.h"

#include "tests/detect/oracle.h"

namespace padder::detect {
namespace {

struct Way {
  BackendKind backend;
  Path path;
  Bodies bodies;
};
void PrintTo(const Way& w, std::ostream* out) {
  *out << name_of(w.backend) << ' ' << name_of(w.path) << ' ' << name_of(w.bodies);
}

class RevisionTest : public testing::TestWithParam<Way> {
 protected:
  void SetUp() override {
    device_.backend = GetParam().backend;
    options_.path = GetParam().path, options_.bodies = GetParam().bodies;
    skip_without(device_.backend);
    for (int k = 0; k < 4; k++) at(k, 10.0 * k);
    input_.shapes = {&shape_, 1}, input_.bodies = bodies_;
    input_.revision = 7;
  }
  void at(int body, double x) { bodies_[body].position[0] = x; }
  std::vector<Pair> contacts(Detector& d, std::vector<std::uint32_t> moved = {}) {
    input_.moved = moved;
    return sorted(d.detect(input_).pair_span());
  }
  using Pairs = std::vector<Pair>;

  const Sphere sphere_{0, 0, 0, 1};
  const Shape shape_{&sphere_, 1};
  Body bodies_[4];
  Input input_;
  DeviceChoice device_;
  CallOptions options_;
};

TEST_P(RevisionTest, ARefusedCallForgetsIt) {
  for (int how = 0; how < 5; how++) {
    SCOPED_TRACE(how);
    Detector d(device_, options_);
    at(1, 10);
    EXPECT_EQ(contacts(d), Pairs());
    at(1, 1);  // now it touches body 0; only the call that is refused says so
    if (how == 0) d.options().bin_size = -1;
    if (how == 1) d.options().own.low[0] = NAN;
    if (how == 2) at(2, NAN);
    if (how == 3) d.options().threads = -1;
    std::vector<std::uint32_t> moved{1, 2};
    if (how == 4) moved.push_back(4);
    EXPECT_THROW(contacts(d, moved), Error);
    d.options() = options_, at(2, 20);
    EXPECT_EQ(contacts(d), (Pairs{{0, 1}}));
  }
}

TEST_P(RevisionTest, OnlyNamedBodiesAreReadAgain) {
  Detector d(device_, options_);
  EXPECT_EQ(contacts(d), Pairs());
  at(1, 1), at(2, 31);
  EXPECT_EQ(contacts(d), Pairs());
  EXPECT_EQ(contacts(d, {1}), (Pairs{{0, 1}}));
  EXPECT_EQ(contacts(d), (Pairs{{0, 1}}));
  EXPECT_EQ(contacts(d, {2}), (Pairs{{0, 1}, {2, 3}}));
  at(0, 100), at(1, 101), at(2, 20), at(3, 30);
  input_.revision = 8;
  EXPECT_EQ(contacts(d), (Pairs{{0, 1}}));
  input_.revision = 0, at(0, 0);
  EXPECT_EQ(contacts(d), Pairs());
  input_.revision = 8, at(1, 1);
  EXPECT_EQ(contacts(d), (Pairs{{0, 1}})) << "the call before had no revision";
}

TEST_P(RevisionTest, AStaticBodyStaysWhateverIsSaid) {
  bodies_[1].is_static = true;
  Detector d(device_, options_);
  EXPECT_EQ(contacts(d), Pairs());
  at(1, 1);
  EXPECT_EQ(contacts(d), Pairs());
  EXPECT_EQ(contacts(d, {1}), Pairs());
  at(0, 11);
  EXPECT_EQ(contacts(d, {0}), (Pairs{{0, 1}}));
  input_.revision = 8;
  EXPECT_EQ(contacts(d), Pairs());
}

TEST_P(RevisionTest, PosesApartFromBodies) {
  bodies_[1].is_static = true;
  std::vector<Pose> poses(4);
  for (int k = 0; k < 4; k++) poses[k].position[0] = 100.0 * k;
  input_.poses = poses.data();
  Detector d(device_, options_);
  EXPECT_EQ(contacts(d), Pairs());
  poses[0].position[0] = 101, poses[1].position[0] = 302.5, poses[2].position[0] = 301;
  EXPECT_EQ(contacts(d), (Pairs{{0, 1}, {2, 3}})) << "those that move stand there, the static one does not";
  EXPECT_THROW(contacts(d, {4}), Error);
  EXPECT_EQ(contacts(d), (Pairs{{1, 2}, {2, 3}})) << "after an error all is read";
  input_.poses = nullptr;
  EXPECT_EQ(contacts(d), (Pairs{{1, 2}, {2, 3}})) << "where they stood";
}

TEST(RevisionKeeper, ASettledInputHasAllPosesInItsBodies) {
  const Sphere sphere{0, 0, 0, 1};
  const Shape shape{&sphere, 1};
  Body bodies[2];
  Pose poses[2];
  bodies[0].is_static = true, bodies[1].family = 3;
  poses[0].position[0] = 4, poses[1].position[0] = 5;
  Input input;
  input.shapes = {&shape, 1}, input.bodies = bodies, input.poses = poses;
  const std::uint32_t moved[] = {1};
  RevisionKeeper keeper;
  const auto expect = [&](double first, double second) {
    const Input settled = keeper.settle(input);
    EXPECT_TRUE(settled.revision == 0 && settled.moved.empty() && !settled.poses);
    EXPECT_EQ(settled.bodies[0].position[0], first);
    EXPECT_EQ(settled.bodies[1].position[0], second);
    EXPECT_TRUE(settled.bodies[0].is_static && settled.bodies[1].family == 3);
  };
  expect(4, 5);
  input.revision = 1;
  expect(4, 5);
  poses[0].position[0] = 6, poses[1].position[0] = 7;
  expect(4, 7);
  input.poses = nullptr;
  expect(4, 7);
  bodies[1].position[0] = 8, input.moved = moved;
  expect(4, 8);
  input.revision = 0;
  expect(0, 8);
}

INSTANTIATE_TEST_SUITE_P(Ways, RevisionTest,
                         testing::Values(Way{BackendKind::omp, Path::grid, Bodies::first},
                                         Way{BackendKind::omp, Path::grid, Bodies::expanded},
                                         Way{BackendKind::omp, Path::nine_stages, Bodies::automatic},
                                         Way{BackendKind::cuda, Path::grid, Bodies::first},
                                         Way{BackendKind::cuda, Path::grid, Bodies::expanded},
                                         Way{BackendKind::cuda, Path::nine_stages, Bodies::automatic}),
                         name_in_one_word<Way>);

}  // namespace
}  // namespace padder::detect
