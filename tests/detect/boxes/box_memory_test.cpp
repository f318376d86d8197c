// SPDX-License-Identifier: MIT
// Scenes that are larger than the memory limit: boxes become smaller, and the contacts stay the same.

#include "detect/boxes/assignment.h"
#include "detect/boxes/boxed_detector.h"
#include "tests/detect/boxes/boxed_scene.h"
#include "tests/error_of.h"

namespace padder::detect {
namespace {

std::uint64_t hash_of_one(const Input& input) {
  CallOptions o = on_the_cpu(1, 1, 2).detector;
  o.width = Width::pairs;
  Detector one = one_on_the_cpu(o);
  one.detect(input);
  return one.hash();
}

BoxOptions limited(std::uint64_t bytes, std::size_t devices = 1) {
  BoxOptions o = on_the_cpu(0, devices, 2);
  o.detector.width = Width::normals, o.detector.scalar = Scalar::f32;
  o.memory_limit = bytes;
  return o;
}

TEST(BoxMemory, ASceneTenTimesTheLimitHasTheSameHash) {
  const std::vector<FloatSphere> spheres = generate("dense", 1000000);
  for (const std::size_t devices : {1, 2}) {
    Input input = input_of(spheres);
    if (devices == 2) input.spheres.count /= 2;
    const std::uint64_t limit = spheres.size() * sizeof(FloatSphere) / 10, wanted = hash_of_one(input);
    BoxedDetector boxed(limited(limit, devices));
    const BoxReport& r = boxed.detect(input, {});
    EXPECT_EQ(r.hash, wanted);
    EXPECT_LE(r.memory, limit);
    EXPECT_GT(r.memory_boxes, 10u);
    EXPECT_GT(r.rounds, 5u);
    std::printf("%zu devices: %u boxes, %u splits, %u rounds, %.2f copies a sphere, %llu of %llu bytes\n",
                devices, r.boxes, r.splits, r.rounds,
                static_cast<double>(r.copies) / static_cast<double>(r.spheres),
                static_cast<unsigned long long>(r.memory), static_cast<unsigned long long>(limit));
  }
}

TEST(BoxMemory, UnevenScenesAndBatchesStayWithinTheLimit) {
  const TestScene scene = random_scene(100000, 100, 0.3, 3);
  const Arranged a(scene, Scalar::f64);
  const std::uint64_t limit = 4 << 20;
  BoxedDetector boxed(limited(limit));
  std::uint64_t hash = 0;
  const BoxReport& r = boxed.detect(a.input, [&](const ContactBatch& b) {
    for (const WidePair& p : b.pairs) hash += wide_pair_hash(p.i, p.j);
  });
  EXPECT_EQ(hash, hash_of_one(a.input));
  EXPECT_EQ(r.hash, hash);
  EXPECT_LE(r.memory, limit);
}

// The detector's own limit is far below what a box needs: the box is halved while it is in work.
TEST(BoxMemory, ABoxThatItsDetectorCannotHoldIsSplit) {
  const TestScene scene = random_scene(30000, 3, 0.05, 5);  // some ten contacts a sphere
  TestScene tagged = scene;
  for (std::size_t k = 0; k < scene.spheres.size(); k++)
    tagged.family.push_back(static_cast<std::uint32_t>(k % 3)),
        tagged.mask.push_back(static_cast<std::uint32_t>(k % 2));
  const Arranged a(tagged, Scalar::f32);
  const std::uint64_t wanted = hash_of_one(a.input);
  BoxOptions o = on_the_cpu(2, 2);
  o.detector.memory_limit = 2 << 20;
  o.memory_limit = 1 << 30;
  BoxedDetector boxed(o);
  EXPECT_EQ(boxed.detect(a.input, {}).hash, wanted);
  EXPECT_GT(boxed.report().splits + boxed.report().memory_boxes, 0u);
  const std::uint32_t before = boxed.report().splits;
  EXPECT_GT(before, 0u);
  for (int k = 0; k < 4; k++) EXPECT_EQ(boxed.detect(a.input, {}).hash, wanted);
  EXPECT_LT(boxed.report().splits, before);  // the next calls begin with smaller boxes
}

TEST(BoxMemory, BodiesAreSplitToo) {
  std::mt19937_64 random(9);
  std::vector<Sphere> spheres;
  for (int k = 0; k < 100; k++) spheres.push_back({unit(random), unit(random), unit(random), 0.05});
  const Shape shape{spheres.data(), spheres.size()};
  std::vector<Body> bodies;
  for (int k = 0; k < 2000; k++) {
    Body b;
    rotation_of(unit(random) + 0.1, unit(random), unit(random), unit(random), b.rotation);
    for (double& p : b.position) p = 10 * unit(random);
    bodies.push_back(b);
  }
  const Arranged a(random_scene(5000, 1, 1, 9), Scalar::f32);
  Input input = a.input;
  input.shapes = {&shape, 1}, input.bodies = bodies;
  const std::uint64_t wanted = hash_of_one(input);
  BoxOptions o = limited(32 << 20);
  o.detector.memory_limit = 3 << 20, o.boxes = 2;
  BoxedDetector boxed(o);
  EXPECT_EQ(boxed.detect(input, {}).hash, wanted);
  EXPECT_GT(boxed.report().splits + boxed.report().memory_boxes, 0u);
}

TEST(BoxMemory, SpheresThatAllMeetAtOnePlaceAreRefusedInASentence) {
  TestScene scene;
  for (int k = 0; k < 3000; k++) scene.spheres.push_back({1, 2, 3, 0.5});
  const Arranged a(scene, Scalar::f32);
  BoxOptions o = on_the_cpu(2);
  o.detector.memory_limit = 1 << 20;  // 4.5 million contacts do not fit
  BoxedDetector boxed(o);
  const std::string said = error_of([&] { boxed.detect(a.input, {}); });
  EXPECT_NE(said.find("needs more memory on the CPU than the 1048576 bytes"), std::string::npos) << said;
  o.detector.memory_limit = 0, o.memory_limit = 1000;
  BoxedDetector small(o);
  EXPECT_THROW(small.detect(a.input, {}), Error);
}

// Numbers beyond 32 bits, which no test can give a detector: a load says what its spheres are called.
TEST(BoxMemory, NumbersOfAHugeSceneKeepTheir64Bits) {
  const std::uint64_t big = std::uint64_t(1) << 33;
  BoxLoad load;
  load.body_count = 2, load.body_spheres = 7, load.loose = 2;
  load.first_of_body = {0, 3, 7};
  load.body_ids.at_least(2), load.ids.at_least(2);
  load.body_ids.data()[0] = 5, load.body_ids.data()[1] = big, load.ids.data()[0] = big + 100,
  load.ids.data()[1] = big + 200;
  std::uint64_t near = 0;
  const std::uint64_t wanted[] = {5, 6, 7, big, big + 1, big + 2, big + 3, big + 100, big + 200};
  for (const std::uint64_t from : {0, 1})
    for (std::uint64_t k = 0; k < 9; k++) {
      near = from;
      EXPECT_EQ(load.id_of(k, near), wanted[k]);
    }
}

}  // namespace
}  // namespace padder::detect
