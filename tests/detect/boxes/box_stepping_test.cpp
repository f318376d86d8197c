// SPDX-License-Identifier: MIT
// A scene that moves between the calls: spheres change their box, boxes are cut anew, and the hash is that of
// one box after every step.

#include "detect/boxes/boxed_detector.h"
#include "tests/detect/boxes/boxed_scene.h"

namespace padder::detect {
namespace {

TEST(BoxStepping, AHundredStepsGiveTheHashOfOneBox) {
  BoxedDetector boxed(on_the_cpu(6, 3));
  const int cuts = expect_steps(100, 4000, 0.985, [&](const Input& input, int) {
    const BoxReport& r = boxed.detect(input, {});
    return std::pair(r.hash, r.cut);
  });
  EXPECT_GT(cuts, 2);
  EXPECT_LT(cuts, 60);
  expect_as_one_detector(Arranged(random_scene(4000, 4, 0.6, 101), Scalar::f32).input, boxed);
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

// A body that nobody says has moved stands where it stood, whatever `bodies` says of it, also when it is in
// another box by now.
TEST(BoxStepping, RevisionsMeanWhatTheyMeanToOneDetector) {
  Pile pile(300);
  BoxedDetector boxed(on_the_cpu(6, 2));
  Detector one = one_on_the_cpu(on_the_cpu(1).detector);
  for (int step = 0; step < 60; step++) {
    const Input input = pile.step(step);
    if (pile.random() % 8 == 0) {  // a call that throws counts as none
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
