// SPDX-License-Identifier: MIT
// A scene that moves between the calls: spheres change their box, boxes are cut anew, and the hash is that of
// one box after every step.

#include "detect/boxes/boxed_detector.h"
#include "tests/detect/boxes/boxed_scene.h"

namespace padder::detect {
namespace {

TEST(BoxStepping, AHundredStepsGiveTheHashOfOneBox) {
  std::mt19937_64 random(101);
  std::normal_distribution<float> jump(0, 1);
  std::vector<FloatSphere> spheres;
  for (const Sphere& s : random_scene(4000, 4, 0.6, 101).spheres)
    spheres.push_back(
        {static_cast<float>(s.x), static_cast<float>(s.y), static_cast<float>(s.z), static_cast<float>(s.r)});
  BoxedDetector boxed(on_the_cpu(6, 3));
  Detector one = one_on_the_cpu(on_the_cpu(1).detector);
  int cuts = 0, crossed = 0;
  for (int step = 0; step < 100; step++) {
    const Input input = input_of(spheres);
    one.detect(input);
    const BoxReport& r = boxed.detect(input, {});
    ASSERT_EQ(r.hash, one.hash()) << "step " << step;
    cuts += r.cut;
    // A pile that collapses to one side, and jitters.
    for (FloatSphere& s : spheres) {
      const bool left = s.x < 10;
      s.x = 0.985f * s.x + 0.2f * jump(random), s.y += 0.2f * jump(random), s.z += 0.2f * jump(random);
      crossed += left != (s.x < 10);
    }
  }
  EXPECT_GT(crossed, 1000);
  EXPECT_GT(cuts, 2);
  EXPECT_LT(cuts, 60);
  expect_as_one_detector(input_of(spheres), boxed);
}

TEST(BoxStepping, ABoxThatBecameHeavyIsCutAnew) {
  // Half of the space ten times as dense: the first cut counts spheres, the next ones contacts too.
  TestScene scene = random_scene(20000, 1, 1, 5);
  const double edge = scene.spheres.back().x;
  for (std::size_t k = 0; k < 15000; k++) scene.spheres[k].x *= 0.1;
  const Arranged a(scene, Scalar::f32);
  BoxedDetector boxed(on_the_cpu(4, 4));
  boxed.detect(a.input, {});
  EXPECT_TRUE(boxed.report().cut);
  const double first = boxed.report().imbalance;
  for (int k = 0; k < 3; k++) boxed.detect(a.input, {});
  EXPECT_LT(boxed.report().imbalance, 1.15) << "it was " << first << ", edge " << edge;
  boxed.detect(a.input, {});
  EXPECT_FALSE(boxed.report().cut);
}

TEST(BoxStepping, ScenesMayChangeAltogether) {
  BoxedDetector boxed(on_the_cpu(5, 2));
  for (const std::uint32_t n : {3000u, 10u, 0u, 1u, 20000u, 500u}) {
    const Arranged a(random_scene(n, n % 3 ? 1 : 20, 0.5, n), n % 2 ? Scalar::f32 : Scalar::f64);
    expect_as_one_detector(a.input, boxed);
  }
}

struct Pile {
  std::vector<Sphere> spheres;
  std::vector<Shape> shapes;
  std::vector<Body> bodies;
  explicit Pile(std::mt19937_64& random) {
    std::uniform_real_distribution<double> unit(0, 1);
    for (int k = 0; k < 30; k++) spheres.push_back({unit(random), unit(random), unit(random), 0.1});
    shapes.push_back({spheres.data(), spheres.size()});
    for (int k = 0; k < 300; k++) {
      Body b;
      for (double& p : b.position) p = 7 * unit(random);
      b.is_static = k % 4 == 0;
      bodies.push_back(b);
    }
  }
};

// A body that nobody says has moved stands where it stood, whatever `bodies` says of it, also when it is in
// another box by now.
TEST(BoxStepping, RevisionsMeanWhatTheyMeanToOneDetector) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> unit(0, 1);
  Pile pile(random);
  BoxedDetector boxed(on_the_cpu(6, 2));
  Detector one = one_on_the_cpu(on_the_cpu(1).detector);
  std::vector<std::uint32_t> moved;
  std::vector<Pose> poses(pile.bodies.size());
  for (int step = 0; step < 60; step++) {
    moved.clear();
    for (std::uint32_t k = 0; k < pile.bodies.size(); k++) {
      if (random() % 3 == 0)
        for (double& p : pile.bodies[k].position) p = 7 * unit(random);  // perhaps without saying so
      if (random() % 3 == 0) moved.push_back(k);
      for (double& p : poses[k].position) p = 7 * unit(random);
    }
    Input input;
    input.shapes = pile.shapes, input.bodies = pile.bodies;
    input.revision = random() % 5 == 0 ? 0 : 1 + static_cast<std::uint64_t>(step) / 10;
    input.moved = moved;
    if (random() % 3 == 0) input.poses = poses.data();
    if (random() % 8 == 0) {  // a call that throws counts as none
      Input wrong = input;
      const std::uint32_t far[] = {1000};
      wrong.moved = far;
      EXPECT_THROW(boxed.detect(wrong, {}), Error);
      EXPECT_THROW(one.detect(wrong), Error);
    }
    const std::uint64_t contacts = one.detect(input).count;
    ASSERT_EQ(boxed.detect(input, {}).contacts, contacts) << "step " << step;
    ASSERT_EQ(boxed.hash(), one.hash()) << "step " << step;
  }
}

}  // namespace
}  // namespace padder::detect
