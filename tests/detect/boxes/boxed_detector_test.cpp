// SPDX-License-Identifier: MIT
// Detection by boxes gives the contacts of one Detector, pair for pair and record for record.
#include "detect/boxes/boxed_detector.h"

#include <atomic>

#include "tests/detect/boxes/boxed_scene.h"
#include "tests/error_of.h"

namespace padder::detect {
namespace {

void expect_right(const TestScene& scene, const std::string& what,
                  std::vector<std::uint32_t> boxes = {1, 2, 3, 8, 27}) {
  SCOPED_TRACE(what);
  const std::vector<Pair> wanted = brute_force(scene);
  const Arranged a(scene, Scalar::f64);
  for (const std::uint32_t n : boxes) {
    SCOPED_TRACE(std::to_string(n) + " boxes");
    BoxedDetector boxed(on_the_cpu(n, 1 + n % 3, 1 + n % 2));
    const Contacts& c = boxed.detect(a.input);
    ASSERT_EQ(sorted(c.pair_span()), wanted);
    ASSERT_EQ(boxed.hash(), hash_of(wanted));
    ASSERT_GE(boxed.report().boxes, n);
    expect_as_one_detector(a.input, boxed);
  }
}

TEST(BoxedDetector, ContactsOnFacesEdgesAndCornersBelongToOneBox) {
  // Midpoints on the planes of the cut: spheres of a lattice that touch exactly, and a point at every corner.
  TestScene corners = lattice(6, 1, 0.5);
  for (int x = 0; x < 6; x++)
    for (int y = 0; y < 6; y++)
      for (int z = 0; z < 6; z++) corners.spheres.push_back({x + 0.5, y + 0.5, z + 0.5, x % 2 ? 0 : 0.4});
  expect_right(corners, "points on corners", {8, 64, 125});
}

TEST(BoxedDetector, AHugeSphereAcrossAllBoxesBringsNobodyAlong) {
  TestScene scene = random_scene(2000, 1, 2, 3);
  const std::uint64_t without = scene.spheres.size();
  scene.spheres.push_back({10, 10, 10, 1e4});
  expect_right(scene, "huge", {1, 8, 27});
  const Arranged a(scene, Scalar::f64);
  BoxedDetector boxed(on_the_cpu(8));
  boxed.detect(a.input, {});
  EXPECT_LT(boxed.report().copies, without * 2 + 8);
}

TEST(BoxedDetector, OddScenes) {
  for (const TestScene& scene : odd_scenes(8, 1000)) expect_right(scene, "odd", {1, 2, 4, 9, 30});
}

TEST(BoxedDetector, MoreBoxesThanSpheres) { expect_right(random_scene(9, 2, 0.2, 5), "nine", {100, 1000}); }

TEST(BoxedDetector, ScenesOfAnySize) {
  for (const double by : {1e-150, 1e-30, 1e60}) {
    TestScene scene = random_scene(600, 4, 0.3, 23);
    scene.scale(by);
    expect_right(scene, "scaled by " + std::to_string(std::log10(by)), {8});
  }
}

struct Bodied : TestBodies {
  TestScene grains;
  Input input(const Arranged& of_grains) const {
    Input in = TestBodies::input();
    in.spheres = of_grains.input.spheres;
    return in;
  }
};

// Two shapes of some spheres, an empty one, a rod that reaches through many boxes, and loose grains between.
Bodied bodied(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  Bodied s;
  s.assets.resize(4);
  for (int k = 0; k < 20; k++) s.assets[0].push_back({unit(random), unit(random), unit(random), 0.2});
  for (int k = 0; k < 150; k++) s.assets[1].push_back({2 * unit(random), 0.3 * unit(random), 0, 0.05});
  for (int k = 0; k < 300; k++) s.assets[2].push_back({0.1 * k, 0, 0, 0.1});
  for (int k = 0; k < 200; k++) {
    Body b = body_at(k % 11 == 0 ? 3 : k % 2, 12 * unit(random), 5 * unit(random), 5 * unit(random), random);
    b.family = static_cast<std::uint32_t>(random() % 4), b.mask = static_cast<std::uint32_t>(random() % 4),
    b.is_static = random() % 3 == 0;
    s.bodies.push_back(b);
  }
  s.bodies.push_back(body_at(2, -5, 2.5, 2.5));
  s.grains = random_scene(800, 3, 1, static_cast<std::uint32_t>(seed));
  double edge = 0;
  for (const Sphere& p : s.grains.spheres) edge = std::max(edge, p.x);
  s.grains.scale(12 / edge);
  return s;
}

// A lattice in its own order: whole runs of spheres go to one box. The arrays are together, or apart.
TEST(BoxedDetector, NeighboursWithNeighbouringNumbersGoTogether) {
  TestScene scene = lattice(26, 1.9, 1).rounded();
  for (std::size_t k = 0; k < scene.spheres.size(); k += 97) scene.spheres[k].r = 4;
  scene.tag(5, 16);
  std::vector<std::uint8_t> is_static;
  for (std::size_t k = 0; k < scene.spheres.size(); k++) is_static.push_back(k % 2);
  std::vector<float> centers, radii;
  for (const Sphere& s : scene.spheres) {
    for (const double v : {s.x, s.y, s.z}) centers.push_back(static_cast<float>(v));
    radii.push_back(static_cast<float>(s.r));
  }
  const Arranged single(scene, Scalar::f32), twice(scene, Scalar::f64);
  Input apart = single.input;
  apart.spheres.centers = centers.data(), apart.spheres.radii = radii.data();
  apart.spheres.center_stride = 3, apart.spheres.radius_stride = 1;
  for (Input input : {single.input, twice.input, apart})
    for (const bool marked : {false, true}) {
      if (marked) input.spheres.is_static = is_static.data();
      BoxedDetector boxed(on_the_cpu(11, 2, 3));
      expect_as_one_detector(input, boxed);
    }
}

TEST(BoxedDetector, BatchesHoldTheListAndRunOneAtATime) {
  const TestScene scene = random_scene(20000, 1, 0.05, 43);
  const Arranged a(scene, Scalar::f32);
  BoxOptions o = on_the_cpu(3, 3);
  o.detector.width = Width::normals, o.detector.scalar = Scalar::f32;
  BoxedDetector boxed(o);
  std::atomic<int> inside = 0;
  std::uint64_t hash = 0, count = 0;
  std::map<std::pair<std::uint64_t, std::uint64_t>, float> depth;
  const BoxReport& r = boxed.detect(a.input, [&](const ContactBatch& b) {
    EXPECT_EQ(++inside, 1);
    EXPECT_LT(b.box, 3u);
    EXPECT_EQ(b.width, Width::normals);
    EXPECT_EQ(b.points, nullptr);
    for (std::size_t k = 0; k < b.pairs.size(); k++) {
      hash += wide_pair_hash(b.pairs[k].i, b.pairs[k].j), count++;
      depth[{b.pairs[k].i, b.pairs[k].j}] = static_cast<const Normal<float>*>(b.normals)[k].depth;
    }
    inside--;
  });
  EXPECT_EQ(r.hash, hash);
  EXPECT_EQ(r.contacts, count);
  EXPECT_GT(count, std::uint64_t(3) << 16);  // several batches a box
  Detector one = one_on_the_cpu(o.detector);
  const Contacts& c = one.detect(a.input);
  EXPECT_EQ(one.hash(), hash);
  for (std::uint64_t k = 0; k < c.count; k++)
    ASSERT_EQ((depth[{c.pairs[k].i, c.pairs[k].j}]), c.normal_span<float>()[k].depth);
}

TEST(BoxedDetector, WhatTheConsumerThrowsEndsTheCall) {
  const Arranged a(random_scene(1000, 1, 0.3, 47), Scalar::f32);
  BoxedDetector boxed(on_the_cpu(8, 3));
  EXPECT_THROW(boxed.detect(a.input, [](const ContactBatch&) { throw std::out_of_range("enough"); }),
               std::out_of_range);
  EXPECT_EQ(boxed.hash(), 0u);
  expect_as_one_detector(a.input, boxed);
}

testing::AssertionResult refused(BoxedDetector& boxed, const Input& input, const std::string& words) {
  return refuses([&] { boxed.detect(input, {}); }, words);
}

TEST(BoxedDetector, FaultsAreNamedAsByOneDetector) {
  Bodied s = bodied(5);
  s.grains.spheres[700].r = -1, s.grains.spheres[701].x = NAN;
  const auto expect_same = [&](Bodied& given) {
    const Arranged a(given.grains, Scalar::f64);
    BoxedDetector boxed(on_the_cpu(8));
    Detector one = one_on_the_cpu(on_the_cpu(1).detector);
    const std::string wanted = error_of([&] { one.detect(given.input(a)); });
    EXPECT_NE(wanted, "");
    EXPECT_EQ(error_of([&] { boxed.detect(given.input(a), {}); }), wanted);
  };
  expect_same(s);
  s.bodies[20].position[1] = INFINITY;
  expect_same(s);
  s.assets[1][3].r = -2;
  expect_same(s);
  s.bodies[3].shape = 9;
  expect_same(s);
}

// Spheres are looked at in groups: the first of one or more faults is named, wherever it stands.
TEST(BoxedDetector, TheFirstFaultyLooseSphereIsNamed) {
  const std::size_t places[] = {0, 3, 255, 256, 300, 999};
  const auto inf = std::numeric_limits<double>::infinity();
  const Sphere faults[] = {{NAN, 1, 1, 1}, {1, inf, 1, 1},  {1, 1, -inf, 1},  {1, 1, 1, NAN},
                           {1, 1, 1, inf}, {1, 1, 1, -0.5}, {1, 1e101, 1, 1}, {1, 1, 1, 1e101}};
  for (const Scalar scalar : {Scalar::f32, Scalar::f64})
    for (const std::size_t place : places)
      for (const Sphere& fault : faults) {
        TestScene scene = random_scene(1000, 1, 0.3, 3);
        for (std::size_t k = place; k < 1000; k += 77) scene.spheres[k] = fault;
        const Arranged a(scene, scalar);
        BoxedDetector boxed(on_the_cpu(4, 1, 3));
        EXPECT_TRUE(refused(boxed, a.input, "sphere " + std::to_string(place) + " at ("));
      }
  TestScene zero = random_scene(1000, 1, 0.3, 3);
  zero.spheres[4].r = -0.0;
  const Arranged fine(zero, Scalar::f32);
  BoxedDetector boxed(on_the_cpu(4));
  expect_as_one_detector(fine.input, boxed);
}

TEST(BoxedDetector, OptionsAndInputsThatCannotBeMeantAreRefused) {
  const Arranged a(random_scene(10, 1, 1, 3), Scalar::f32);
  BoxedDetector boxed(on_the_cpu(4));
  boxed.options().own.low[1] = NAN;
  EXPECT_TRUE(refused(boxed, a.input, "is not a number along y"));
  boxed.options() = on_the_cpu(4).detector;
  boxed.options().threads = -1;
  EXPECT_TRUE(refused(boxed, a.input, "number of threads"));
  boxed.options().threads = 0;
  Input device = a.input;
  device.spheres.memory = Memory::device;
  EXPECT_TRUE(refused(boxed, device, "host memory"));
  BoxOptions absent = on_the_cpu(1);
  absent.devices = {{BackendKind::cuda, 1000}};
  EXPECT_THROW(BoxedDetector{absent}, Error);
  expect_as_one_detector(a.input, boxed);
}

TEST(BoxedDetector, EveryDeviceThereIsTakesPart) {
  const Arranged a(random_scene(30000, 4, 0.5, 59), Scalar::f32);
  BoxOptions o = on_the_cpu(0);
  o.devices = all_devices();
  ASSERT_FALSE(o.devices.empty());
  o.devices.push_back({BackendKind::omp, 0});
  BoxedDetector boxed(o);
  boxed.detect(a.input, {});
  EXPECT_EQ(boxed.report().boxes, o.devices.size());
  Detector one = one_on_the_cpu(o.detector);
  one.detect(a.input);
  EXPECT_EQ(boxed.hash(), one.hash());
}

TEST(WidePairHash, IsThatOfADetectorForNumbersThatADetectorHas) {
  EXPECT_EQ(wide_pair_hash(3, 0xfffffffe), pair_hash(3, 0xfffffffe));
  EXPECT_EQ(wide_pair_hash(0, 1), pair_hash(0, 1));
  const std::uint64_t big = std::uint64_t(1) << 32;
  EXPECT_NE(wide_pair_hash(3, big + 7), wide_pair_hash(3, 7));
  EXPECT_NE(wide_pair_hash(big, big + 7), wide_pair_hash(0, big + 7));
}

}  // namespace
}  // namespace padder::detect
